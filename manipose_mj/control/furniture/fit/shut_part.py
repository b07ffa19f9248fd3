"""A part of furniture as it was sensed, taken back to where it is shut and corrected by what shows there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.fit.door_hinge import (
    can_be_a_door,
    hung,
    is_level,
    likely_hinge,
    one_of_two,
    whole_front,
)
from manipose_mj.control.furniture.fit.object_frame import AJAR
from manipose_mj.control.furniture.sensing.part_sensing import SensedPart
from manipose_mj.control.furniture.shapes.furniture_model import motion_of
from manipose_mj.control.furniture.shapes.handle_shape import (
    ACROSS_FRONT,
    UP_FRONT,
    along_axes,
    handle_label,
    this_side_up,
)
from manipose_mj.control.furniture.shapes.open_panel import hinge_of_panel
from manipose_mj.control.furniture.shapes.relief import Bump
from manipose_mj.control.furniture.shapes.standing_out import column_of, twin_of
from manipose_mj.poses import compose, invert, transform

FACING = 0.6  # cosine between normals of the front and X, at least
_SNAP = float(np.cos(np.radians(8.0)))  # joints nearly along an axis of the body are along it
_TELLING = 150  # points of a panel that tell how far it swung, at least
_MISTAKEN = 0.05  # how far the estimated opening of a drawer may be off [m]
# How far the panel beside a handle is looked at [m], and the estimated opening of a door may be off [rad].
_BESIDE_HANDLE, _MISSWUNG = 0.15, 0.45
# How far a hinge is off an edge of its panel that is taken to be at it: at least, and within it at most [m].
_OFF_EDGE, _OFF_FLAP, _INSIDE, _INSIDE_FLAP = 0.04, 0.015, 0.10, 0.20
# What is flush below the hinge of a flap no higher than this may be so high; below higher ones a plinth stands back [m].
_LOW, _SILL = 0.50, 0.09
# How far from where an open panel shows its hinge an estimate may be to stay [m], by whether it is of this confidence.
_AGREE, _RELIED_ON = {False: 0.025, True: 0.08}, 0.6
_MISTURNED = 0.25  # how far its opening by its line may be from that by its normals [rad]
_FLAT = 0.012  # how far points of a flap, below which a plinth may be, are from its plane [m]
_LONG_BAR = 0.10  # half the length of a handle, from which on it is no knob's [m]
# Of a handle that was not measured, half of its usual length; of any, a little more than it takes up [m].
_USUAL_HALF, _BESIDE = 0.05, 0.005
_KNOBS = 0.5  # cosine between the axis of a knob and X, at least
_MISPLACED = 0.12  # how far a handle is from where it was estimated, at most [m]
_ABOVE_BAR = 0.05  # how far above its bar the front of an appliance's door or drawer ends [m]
_OUT = 0.9  # cosine between a handle's Y and the way out of the front, at least
_LONG = 1.5  # times as long as wide: a bar
# Of handles that look like a sensed one: how near another that was sensed would be it [m], their share of the confidence.
_KNOWN, _TWIN = 0.04, 0.8
_SURE = 0.25  # confidence of drawers that tell of others in their column, or row
# How far handles in a row differ in height, and in half of their lengths [m].
_LEVEL, ALIKE = 0.015, 0.010


class ShutPart:
    """A sensed part in the object frame, as if it were shut.

    Attributes: sensed; pose: `T_world_object`; kind; opening; axis; origin; handle: `T_object_handle`; half: of the
    handle's lengths along the object's axes, and a little more, as far as they show [m]; measured: whether they do; base: how far
    out what the handle stands on is, along X, where it is no part of the panel's plane [m]; bar_on_top: whether a bar is
    near the upper edge of its front, as on appliances.
    """

    def __init__(
        self, sensed: SensedPart, pose: Float[np.ndarray, "4 4"], bar_on_top: bool = False
    ) -> None:
        self.sensed, self.pose, self.bar_on_top = sensed, pose, bar_on_top
        self.kind: Literal["slide", "hinge"] = sensed.kind
        to_object = invert(pose)
        axis = to_object[:3, :3] @ sensed.axis
        self.axis = _snapped(axis / np.linalg.norm(axis))
        self.origin = transform(to_object, sensed.origin[None])[0]
        self.opening = sensed.opening if sensed.opening > AJAR[sensed.kind] else 0.0
        joint = Joint(self.kind, self.origin, self.axis, (0.0, 1.0))
        back = motion_of(joint, -self.opening)
        self.handle = back @ to_object @ sensed.handle
        self.handle[:3, :3] = along_axes(self.handle[:3, :3], _SNAP)
        self.back = back
        self.half = np.abs(self.handle[:3, 0]) * _USUAL_HALF + 2 * _BESIDE
        self.base: float | None = None
        self.measured = False

    def meet_handle(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
    ) -> bool:
        """Move a shut part's handle to what stands out of its front there: where it is tells which part is beside which.

        Returns:
          Whether its handle shows, or is not looked for: the part is open, or its front does not show.
        """
        front = panel_place(points, normals, self) if self.opening == 0.0 else None
        if front is None:
            return True
        if np.abs(self.handle[:3, :3]).max(axis=0).min() < _SNAP and self.handle[0, 1] > _OUT:
            self._straighten(points, front)
        label, seen = handle_label(points, self.handle, front)
        if seen and np.linalg.norm(label.origin - self.handle[:3, 3]) < _MISPLACED:
            self.handle[:3, 3] = label.origin
            self.half = np.abs(label.rotation) @ label.extents / 2 + _BESIDE
            self.measured = True
        return seen

    def _straighten(self, points: Float[np.ndarray, "n 3"], front: float) -> None:
        """Bars are upright or level; of a knob either does. What seems to be askew is whichever shows more of a bar."""
        slender: list[tuple[float, Float[np.ndarray, "3 3"]]] = []
        for turn in (UP_FRONT, ACROSS_FRONT):
            label, seen = handle_label(points, compose(turn, self.handle[:3, 3]), front)
            if seen:
                slender.append((float(label.extents[0] / label.extents[2]), turn))
        if slender:
            turn = max(slender, key=lambda each: each[0])[1]
            self.handle[:3, :3] = this_side_up(turn, self.handle[:3, :3])

    @property
    def is_bar(self) -> bool:
        """Whether its handle shows as a long bar: no knob."""
        return self.measured and float(self.half.max()) > _LONG_BAR

    @property
    def hangs_from_bar(self) -> bool:
        """Whether it is an appliance's door, or drawer, below a long level bar: no knob is below that bar on its front."""
        return self.bar_on_top and self.measured and float(self.half[1]) > _LONG_BAR

    @property
    def shows(self) -> bool:
        """Whether more than the network tells of it: its handle stands out, or it is open."""
        return self.measured or self.opening > 0.0 or self.sensed.certain

    def take(self, bump: Bump, points: Float[np.ndarray, "n 3"]) -> None:
        """Have for a handle what stands out of the front there."""
        across, upright = bump.size
        self.handle[:3, 3] = bump.middle
        if max(across, upright) > _LONG * min(across, upright):
            turn = UP_FRONT if upright > across else ACROSS_FRONT
            self.handle[:3, :3] = this_side_up(turn, self.handle[:3, :3])
        label, seen = handle_label(points, self.handle, bump.base)
        if seen:
            self.handle[:3, 3] = label.origin
        lengths = np.abs(label.rotation) @ label.extents if seen else np.array([0.0, *bump.size])
        self.half = lengths / 2 + _BESIDE
        self.base, self.measured = bump.base, seen

    def twin(
        self,
        others: Sequence[ShutPart],
        points: Float[np.ndarray, "n 3"],
        normals: Float[np.ndarray, "n 3"],
    ) -> ShutPart | None:
        """The other one of double doors, where its handle shows and was not sensed."""
        if self.kind == "slide" or self.opening > 0.0:
            return None
        front = panel_place(points, normals, self)
        if front is None:
            return None
        label, seen = handle_label(points, self.handle, front)
        place = twin_of(points, label, front) if seen else None
        if place is None or any(
            np.linalg.norm(other.handle[:3, 3] - place) < _KNOWN for other in others
        ):
            return None
        twin = ShutPart(replace(self.sensed, confidence=self.sensed.confidence * _TWIN), self.pose)
        twin.handle[:3, 3], twin.half, twin.measured = place, self.half, True
        # As in a mirror between the two handles.
        twin.origin[1] = self.handle[1, 3] + place[1] - self.origin[1]
        twin.axis = self.axis * [-1.0, 1.0, -1.0]
        return twin

    def column(
        self,
        others: Sequence[ShutPart],
        points: Float[np.ndarray, "n 3"],
        normals: Float[np.ndarray, "n 3"],
    ) -> list[ShutPart]:
        """Drawers above and below, where handles like this one's show: those not sensed; the sensed ones get surer."""
        front = None
        if self.kind == "slide" and self.opening == 0.0 and self.sensed.confidence >= _SURE:
            front = panel_place(points, normals, self)
        if front is None:
            return []
        label, seen = handle_label(points, self.handle, front)
        confidence = self.sensed.confidence * _TWIN
        found = []
        for place in column_of(points, label, front) if seen else ():
            near = [o for o in others if np.linalg.norm(o.handle[:3, 3] - place) < _KNOWN]
            for other in near:
                if other.kind == "slide":
                    surer = max(other.sensed.confidence, confidence)
                    other.sensed = replace(other.sensed, confidence=surer)
            if not near:
                drawer = ShutPart(replace(self.sensed, confidence=confidence), self.pose)
                drawer.origin = self.origin + place - self.handle[:3, 3]
                drawer.handle, drawer.half = compose(self.handle[:3, :3], place), self.half
                drawer.measured = True
                found.append(drawer)
        return found

    def turn_as_doors_do(
        self,
        others: Sequence[ShutPart],
        bounds: Float[np.ndarray, "2 3"],
        points: Float[np.ndarray, "n 3"],
        normals: Float[np.ndarray, "n 3"],
    ) -> None:
        """Where the estimated hinge is no door's, turn about the likely edge; slide as the drawer beside it does."""
        # What shows open is a door; where its handle is, shut, tells others little.
        if self.kind == "slide" or (self.opening > 0.0 and abs(self.axis[0]) < _KNOBS):
            return
        shut = [other for other in others if other.opening == 0.0 or other.kind == "slide"]
        between = between_neighbours(self, shut, bounds)
        front = panel_place(points, normals, self) if self.opening == 0.0 else None
        facing, flat = points[normals[:, 0] > FACING], between
        if front is not None:
            flat = whole_front(facing, front, self.handle, between, _FLAT)
            between = whole_front(facing, front, self.handle, between)
        length = 2 * float(self.half.max()) if self.measured else 0.0
        possible = can_be_a_door(self.origin, self.axis, self.handle, between, length)
        askew = not possible or np.abs(self.axis).max() < _SNAP
        if askew and self.opening == 0.0 and any(map(self._is_in_a_row_with, others)):
            self.kind, self.axis = "slide", np.array([1.0, 0.0, 0.0])
            self.origin = self.handle[:3, 3].copy()
        elif not possible:
            self.handle = invert(self.back) @ self.handle
            self.opening, self.back = 0.0, np.eye(4)
            self.origin, self.axis = likely_hinge(self.handle, between, length)
        elif front is not None:
            self._straighten_hinge()
            panel = flat if is_level(self.axis) else one_of_two(self.handle, between)
            self._turn_about_edge(panel)

    def _straighten_hinge(self) -> None:
        """Have the hinge upright or level, through where it is abreast of the handle."""
        along = int(np.abs(self.axis).argmax())
        further = (self.handle[along, 3] - self.origin[along]) / self.axis[along]
        self.origin = self.origin + further * self.axis
        self.axis = np.eye(3)[along] * np.sign(self.axis[along])

    def _turn_about_edge(self, panel: Float[np.ndarray, "2 3"]) -> None:
        """Have the hinge at the edge of the panel that it is beyond, or not far within."""
        across = 2 if is_level(self.axis) else 1
        side = float(np.sign(self.origin[across] - self.handle[across, 3]))
        edge = float(panel[1 if side > 0 else 0, across])
        beyond = side * (self.origin[across] - edge)
        # Beside an upright hinge there may be another door, whose handle was not found.
        inside = _INSIDE_FLAP if across == 2 else _INSIDE
        off = _OFF_FLAP if across == 2 else _OFF_EDGE
        if across == 2 and beyond < 0.0 and side * (edge - self.handle[2, 3]) < _LOW:
            off = _SILL
        if abs(beyond) > off and beyond > -inside:
            self.origin[across] = edge

    def hang(
        self,
        points: Float[np.ndarray, "n 3"],
        normals: Float[np.ndarray, "n 3"],
        bounds: Float[np.ndarray, "2 3"],
    ) -> None:
        """Have the hinge of a shut door where doors have theirs: just behind their front, within the body's sides."""
        if self.kind == "hinge" and self.opening == 0.0 and np.abs(self.axis[1:]).max() >= _SNAP:
            facing = points[normals[:, 0] > FACING]
            self.origin = hung(self.origin, self.axis, self.handle, facing, bounds)

    def _is_in_a_row_with(self, other: ShutPart) -> bool:
        """Whether a sure drawer has a handle of the same size at the same height, and both show."""
        if other is self or not (self.measured and other.measured):
            return False
        alike = np.abs(other.half - self.half).max() < ALIKE
        level = abs(float(other.handle[2, 3] - self.handle[2, 3])) < _LEVEL
        sure = other.kind == "slide" and other.sensed.confidence >= _SURE
        return sure and bool(alike and level)

    def meet_front(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], front: float
    ) -> None:
        """Correct how far a drawer is open: shut, its panel is where those of others are, along X [m]."""
        if self.kind != "slide" or self.opening == 0.0 or self.axis[0] < _SNAP:
            return
        own = panel_place(transform(self.back, points), normals, self)
        if own is not None and abs(own - front) < _MISTAKEN:
            self.opening += own - front
            self.back = compose(np.eye(3), -self.opening * self.axis)
            self.handle[:3, 3] -= (own - front) * self.axis

    def meet_swing(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
    ) -> None:
        """Correct how far a door is open: shut, its panel faces out of the front, or into it."""
        if self.kind == "slide" or self.opening == 0.0 or abs(self.axis[0]) > 0.1:
            return
        local = transform(self.back, points) - self.handle[:3, 3]
        turned = normals @ self.back[:3, :3].T
        on = (np.abs(local) < [_BESIDE_HANDLE / 2, _BESIDE_HANDLE, _BESIDE_HANDLE]).all(axis=1)
        on &= np.abs(turned[:, 0]) > np.cos(_MISSWUNG)
        if on.sum() < _TELLING:
            return
        faces = turned[on] * np.sign(turned[on, :1])
        ahead = np.cross(self.axis, np.array([1.0, 0.0, 0.0]))  # where X goes as it opens
        self._turn_back(float(np.median(np.arctan2(faces @ ahead, faces[:, 0]))))

    def meet_panel(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
    ) -> None:
        """Have a door that stands open turn about where its panel ends, and stand as open as its panel does.

        Not where the panel was seen before anything was fitted, nor where its line and its normals tell different openings.
        """
        if self.kind == "slide" or self.opening == 0.0 or np.abs(self.axis[1:]).max() < _SNAP:
            return
        if self.sensed.certain:
            return
        stands = invert(self.back) @ self.handle
        agree = _AGREE[self.sensed.confidence >= _RELIED_ON]
        found = hinge_of_panel(points, normals, stands, self.origin, self.axis, agree)
        if found is None:
            return
        hinge, way = found
        shut = np.cross(np.array([1.0, 0.0, 0.0]), self.axis)  # from the hinge to the handle
        opening = float(np.arctan2(way[0], way @ shut) % (2 * np.pi))
        if abs(opening - self.opening) < _MISTURNED:
            self.origin = hinge
            self._turn_back(opening - self.opening)

    def _turn_back(self, further: float) -> None:
        """Take it to be further open than was thought [rad]."""
        stands = invert(self.back) @ self.handle
        self.opening += further
        self.back = motion_of(Joint("hinge", self.origin, self.axis, (0.0, 1.0)), -self.opening)
        self.handle = self.back @ stands
        # The handle was taken to be as far open as the panel.
        self.handle[:3, :3] = along_axes(self.handle[:3, :3], float(np.cos(_MISSWUNG)))


def _snapped(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    nearest = int(np.abs(axis).argmax())
    if abs(axis[nearest]) < _SNAP:
        return axis
    return np.eye(3)[nearest] * np.sign(axis[nearest])


def panel_place(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], part: ShutPart
) -> float | None:
    """Where along X the panel behind a handle is [m]; None where it does not show."""
    facing = normals[:, 0] > FACING
    local = points[facing] - part.handle[:3, 3]
    near = (np.abs(local[:, 1:]) < 0.10).all(axis=1) & (local[:, 0] < 0.03)
    near &= local[:, 0] > -0.09
    if near.sum() < 30:
        return None
    counts, edges = np.histogram(local[near, 0], bins=np.arange(-0.092, 0.034, 0.003))
    smooth = np.convolve(counts, np.ones(3), mode="same")
    best = int(smooth.argmax())
    close = near & (np.abs(local[:, 0] - edges[best] - 0.0015) < 0.006)
    return float(np.median(local[close, 0]) + part.handle[0, 3])


def between_neighbours(
    part: ShutPart, others: Sequence[ShutPart], bounds: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, "2 3"]:
    """Of the body, what is nearer to a part's handle than to those of others: low and high corner."""
    low, high = bounds[0].copy(), bounds[1].copy()
    own, half = part.handle[:3, 3], part.half
    for other in others:
        bar = other.bar_on_top and other.is_bar and part.is_bar
        bar = bar and float(np.abs(other.half - part.half).max()) < ALIKE
        if other is part or not other.shows or (other.sensed.confidence < 0.15 and not bar):
            continue
        away = other.handle[:3, 3] - own
        axis = 2 if abs(away[2]) > abs(away[1]) else 1
        if abs(away[axis]) < 0.05:
            continue
        if axis == 2 and away[2] < 0.0 and part.hangs_from_bar and not other.is_bar:
            continue
        middle = own[axis] + away[axis] / 2
        if axis == 2 and bar:
            middle = min(own[2], other.handle[2, 3]) + _ABOVE_BAR
        if away[axis] > 0:
            high[axis] = min(high[axis], max(middle, own[axis] + half[axis]))
        else:
            low[axis] = max(low[axis], min(middle, own[axis] - half[axis]))
    return np.stack([low, high])
