"""From a cloud of furniture and the parts that were sensed in it to its model in boxes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Cavity, MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.door_hinge import (
    WITH_KNOBS,
    can_be_a_door,
    likely_hinge,
    whole_front,
)
from manipose_mj.control.furniture.object_frame import AJAR, object_pose
from manipose_mj.control.furniture.part_sensing import SensedFurniture, SensedPart
from manipose_mj.control.furniture.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.body_shape import body_slices, ends_of
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.shapes.handle_shape import handle_boxes, handle_label
from manipose_mj.poses import compose, invert, transform

# How far parts open in the median of the training furniture: of the depth, [m]; [rad].
DRAWER_SHARE, TYPICAL_DRAWER = 0.70, 0.32
TYPICAL_SWING = {"microwave": 1.83, "oven": 1.57, "cabinet": 1.92}
LEVEL_SWING, ANY_SWING = 1.57, 1.75  # of other categories [rad]
_SNAP = np.cos(np.radians(8.0))  # joints along an axis of the body, or nearly so, are along it
_PANEL = 0.018  # thickness [m]
_WALL, _DOOR_WALL = 0.022, 0.03  # around cavities that were not seen [m]
_REAR = 0.03  # behind them [m]
_FACING = 0.6  # cosine between normals of the front and X, at least
# How far points of a panel's plane are from it [m]; points that tell its sides.
_FACE, _FACE_LEAST = 0.012, 150
_FREE_EDGE = 0.05  # of a door, from its handle [m]
_TO_SIDE = 0.09  # a side of the body that is no further from the handle is the door's edge [m]
_MISTAKEN = 0.05  # how far the estimated opening of a drawer may be off [m]
# How far the panel beside a handle is looked at [m], and the estimated opening of a door may be off [rad].
_BESIDE_HANDLE, _MISSWUNG = 0.15, 0.45
_KNOBS = 0.5  # cosine between the axis of a knob and X, at least
_ONE_HINGE = 0.04  # hinges nearer than this are one [m]
_UNSEEN = 0.4  # of its confidence that is left to a handle of which no point shows
_MISPLACED = 0.12  # how far a handle is from where it was estimated, at most [m]
_MEET = 0.01  # handles nearer than this are one [m]
_LOOKS = 500


def fit_furniture(cloud: SceneCloud, sensed: SensedFurniture, category: str) -> FurnitureModel:
    """The model of a piece of furniture.

    Args:
      cloud: Of it alone.
      sensed: Its front and parts.
      category: Such as `"cabinet"`.
    """
    pose = object_pose(cloud, sensed)
    points = transform(invert(pose), cloud.points)
    normals = cloud.normals @ pose[:3, :3]
    shut = [_Shut(part, pose) for part in sensed.parts]
    bounds = _bounds(points, normals, shut)
    for part in shut:
        part.meet_handle(points, normals)
    if category not in WITH_KNOBS:
        for part in shut:
            part.turn_as_doors_do(shut, bounds, points, normals)
    if any(part.opening == 0.0 for part in shut):
        for part in shut:
            part.meet_front(points, normals, float(bounds[1, 0]))
    for part in shut:
        part.meet_swing(points, normals)
    parts = [
        _part(number, part, shut, points, normals, bounds, category)
        for number, part in enumerate(shut)
    ]
    parts = _distinct(parts)
    return FurnitureModel(pose, body_slices(points, bounds), tuple(parts), category)


def _distinct(parts: list[PartModel]) -> list[PartModel]:
    """Of parts whose fitted handles meet, shut or as they stand, or that turn about one hinge, the surest."""
    kept: list[PartModel] = []
    for part in sorted(parts, key=lambda part: -part.confidence):
        if not any(_meet(part, other) or _one_door(part, other) for other in kept):
            kept.append(part)
    return kept


def _meet(part: PartModel, other: PartModel) -> bool:
    """Whether two handles take up one place, both shut or both as they stand."""
    pairs = [(part.handle[0], other.handle[0]), (_handle_now(part), _handle_now(other))]
    return any(
        bool(((mine[0] - _MEET < its[1]) & (mine[1] + _MEET > its[0])).all()) for mine, its in pairs
    )


def _handle_now(part: PartModel) -> Float[np.ndarray, "2 3"]:
    """Low and high corner of a handle's bar as it stands, object frame."""
    corners = np.array(list(product(*part.handle[0].T)))
    moved = transform(part.motion(part.opening), corners)
    return np.stack([moved.min(axis=0), moved.max(axis=0)])


def _one_door(part: PartModel, other: PartModel) -> bool:
    """Whether two parts turn about one hinge, at one height."""
    mine, its = part.part.joint, other.part.joint
    if mine.kind != "hinge" or its.kind != "hinge" or mine.axis @ its.axis < np.cos(0.2):
        return False
    apart = np.cross(mine.origin - its.origin, its.axis)
    overlap = np.minimum(part.panel[1], other.panel[1]) - np.maximum(part.panel[0], other.panel[0])
    return float(np.linalg.norm(apart)) < _ONE_HINGE and bool((overlap[1:] > 0.05).all())


class _Shut:
    """A sensed part in the object frame, as if it were shut.

    Attributes: sensed; kind; opening; axis; origin; handle: `T_object_handle`.
    """

    def __init__(self, sensed: SensedPart, pose: Float[np.ndarray, "4 4"]) -> None:
        self.sensed = sensed
        self.kind: Literal["slide", "hinge"] = sensed.kind
        to_object = invert(pose)
        axis = to_object[:3, :3] @ sensed.axis
        self.axis = _snapped(axis / np.linalg.norm(axis))
        self.origin = transform(to_object, sensed.origin[None])[0]
        self.opening = sensed.opening if sensed.opening > AJAR[sensed.kind] else 0.0
        joint = Joint(self.kind, self.origin, self.axis, (0.0, 1.0))
        back = _motion(joint, -self.opening)
        self.handle = back @ to_object @ sensed.handle
        self.handle[:3, :3] = _along_axes(self.handle[:3, :3])
        self.back = back

    def meet_handle(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
    ) -> None:
        """Move a shut part's handle to what stands out of its front there: where it is tells which part is beside which."""
        front = _panel_place(points, normals, self) if self.opening == 0.0 else None
        if front is not None:
            label, seen = handle_label(points, self.handle, front)
            if seen and np.linalg.norm(label.origin - self.handle[:3, 3]) < _MISPLACED:
                self.handle[:3, 3] = label.origin

    def turn_as_doors_do(
        self,
        others: Sequence[_Shut],
        bounds: Float[np.ndarray, "2 3"],
        points: Float[np.ndarray, "n 3"],
        normals: Float[np.ndarray, "n 3"],
    ) -> None:
        """Where the estimated hinge is no door's, turn about the likely edge."""
        # What shows open is a door; where its handle is, shut, tells others little.
        if self.kind == "slide" or (self.opening > 0.0 and abs(self.axis[0]) < _KNOBS):
            return
        shut = [other for other in others if other.opening == 0.0 or other.kind == "slide"]
        between = _between_neighbours(self, shut, bounds)
        if not can_be_a_door(self.origin, self.axis, self.handle, between):
            front = _panel_place(points, normals, self) if self.opening == 0.0 else None
            if front is not None:
                facing = points[normals[:, 0] > _FACING]
                between = whole_front(facing, front, self.handle, between)
            self.handle = invert(self.back) @ self.handle
            self.opening, self.back = 0.0, np.eye(4)
            self.origin, self.axis = likely_hinge(self.handle, between)

    def meet_front(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], front: float
    ) -> None:
        """Correct how far a drawer is open: shut, its panel is where those of others are, along X [m]."""
        if self.kind != "slide" or self.opening == 0.0 or self.axis[0] < _SNAP:
            return
        own = _panel_place(transform(self.back, points), normals, self)
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
        if on.sum() < _FACE_LEAST:
            return
        faces = turned[on] * np.sign(turned[on, :1])
        ahead = np.cross(self.axis, np.array([1.0, 0.0, 0.0]))  # where X goes as it opens
        self._turn_back(float(np.median(np.arctan2(faces @ ahead, faces[:, 0]))))

    def _turn_back(self, further: float) -> None:
        """Take it to be further open than was thought [rad]."""
        stands = invert(self.back) @ self.handle
        self.opening += further
        self.back = _motion(Joint("hinge", self.origin, self.axis, (0.0, 1.0)), -self.opening)
        self.handle = self.back @ stands
        # The handle was taken to be as far open as the panel.
        self.handle[:3, :3] = _along_axes(self.handle[:3, :3], np.cos(_MISSWUNG))


def _motion(joint: Joint, opening: float) -> Float[np.ndarray, "4 4"]:
    empty = np.zeros((0, 2, 3))
    moving = MovingPart("", joint, None, None)
    return PartModel(moving, np.zeros((2, 3)), empty, 0.0, 0.0, np.zeros((0, 3))).motion(opening)


def _snapped(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    nearest = int(np.abs(axis).argmax())
    if abs(axis[nearest]) < _SNAP:
        return axis
    return np.eye(3)[nearest] * np.sign(axis[nearest])


def _along_axes(
    rotation: Float[np.ndarray, "3 3"], least: float = _SNAP
) -> Float[np.ndarray, "3 3"]:
    """Along the axes of the body, where that is nearly so: by this cosine or more."""
    nearest = np.round(rotation)
    if abs(np.linalg.det(nearest) - 1) < 1e-6 and (rotation * nearest).sum(axis=0).min() > least:
        return nearest
    return rotation


def _bounds(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], shut: Sequence[_Shut]
) -> Float[np.ndarray, "2 3"]:
    """Low and high corner of the body; its front is where the panels of shut parts are."""
    low, high = ends_of(points)
    fronts = [_panel_place(points, normals, part) for part in shut if part.opening == 0.0]
    fronts = [front for front in fronts if front is not None]
    opened = [part for part in shut if part.opening > 0.0]
    if fronts:
        high[0] = float(np.median(fronts))
    if opened:
        front = high[0] if fronts else max(part.handle[0, 3] - 0.035 for part in opened)
        high[0] = front
        body = points[points[:, 0] < front]
        if len(body) > 200:
            low, ends = ends_of(body)
            high[1:] = ends[1:]
    return np.stack([low, high])


def _panel_place(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], part: _Shut
) -> float | None:
    """Where along X the panel behind a handle is [m]; None where it does not show."""
    facing = normals[:, 0] > _FACING
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


def _part(
    number: int,
    part: _Shut,
    others: Sequence[_Shut],
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    bounds: Float[np.ndarray, "2 3"],
    category: str,
) -> PartModel:
    """One part: its panel is what is nearer to its handle than to those of others."""
    moved = transform(part.back, points)
    turned = normals @ part.back[:3, :3].T
    front = _panel_place(moved, turned, part)
    if front is None:
        front = float(bounds[1, 0])
    panel = _panel(part, others, bounds, front)
    panel = _within_face(panel, moved[turned[:, 0] > _FACING], part)
    low, high = panel
    on = ((moved > low - 0.006) & (moved < high + 0.006)).all(axis=1)
    handle, seen = handle_label(moved, part.handle, front)
    held = np.abs(transform(invert(handle.pose), moved)) < handle.extents / 2 + 0.006
    rows = np.flatnonzero(on | held.all(axis=1))
    rows = np.random.default_rng(number).permutation(rows)[:_LOOKS]
    depth = float(bounds[1, 0] - bounds[0, 0])
    joint = Joint(part.kind, part.origin, part.axis, (0.0, _range(part, depth, category)))
    name = f"part_{number}"
    cavity = cavity_behind(panel, part.kind, joint.range[1], float(bounds[0, 0]))
    return PartModel(
        part=MovingPart(name, joint, handle, cavity),
        panel=panel,
        handle=handle_boxes(handle, front),
        opening=part.opening,
        confidence=part.sensed.confidence * (1.0 if seen or part.sensed.certain else _UNSEEN),
        looks=moved[rows],
    )


def _range(part: _Shut, depth: float, category: str) -> float:
    """How far the part may open [m or rad]: as is usual."""
    if part.kind == "slide":
        # The rear of what is deep, or stands at an angle, is out of all cameras' sight.
        return max(DRAWER_SHARE * depth, TYPICAL_DRAWER, part.opening)
    return max(usual_swing(part.axis, category), part.opening)


def usual_swing(axis: Float[np.ndarray, "3"], category: str) -> float:
    """How far doors open that turn about such an axis, object frame [rad]."""
    level = abs(axis[2]) < 0.7
    return LEVEL_SWING if level else TYPICAL_SWING.get(category, ANY_SWING)


def _panel(
    part: _Shut, others: Sequence[_Shut], bounds: Float[np.ndarray, "2 3"], front: float
) -> Float[np.ndarray, "2 3"]:
    """The rectangle between the handles of neighbours, the hinge and the body's sides."""
    low, high = _between_neighbours(part, others, bounds)
    own, half = part.handle[:3, 3], _half_handle(part)
    if part.kind == "hinge":
        axis = 1 if abs(part.axis[2]) > 0.7 else 2
        if part.origin[axis] > own[axis]:
            high[axis] = part.origin[axis] + 0.006
            edge = own[axis] - half[axis] - _FREE_EDGE
            low[axis] = low[axis] if own[axis] - low[axis] < _TO_SIDE else max(edge, low[axis])
        else:
            low[axis] = part.origin[axis] - 0.006
            edge = own[axis] + half[axis] + _FREE_EDGE
            high[axis] = high[axis] if high[axis] - own[axis] < _TO_SIDE else min(edge, high[axis])
    low[0], high[0] = front - _PANEL, front
    return np.stack([low, high])


def _between_neighbours(
    part: _Shut, others: Sequence[_Shut], bounds: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, "2 3"]:
    """Of the body, what is nearer to a part's handle than to those of others: low and high corner."""
    low, high = bounds[0].copy(), bounds[1].copy()
    own, half = part.handle[:3, 3], _half_handle(part)
    for other in others:
        if other is part or other.sensed.confidence < 0.15:
            continue
        away = other.handle[:3, 3] - own
        axis = 2 if abs(away[2]) > abs(away[1]) else 1
        if abs(away[axis]) < 0.05:
            continue
        middle = own[axis] + away[axis] / 2
        if away[axis] > 0:
            high[axis] = min(high[axis], max(middle, own[axis] + half[axis]))
        else:
            low[axis] = max(low[axis], min(middle, own[axis] - half[axis]))
    return np.stack([low, high])


def _within_face(
    panel: Float[np.ndarray, "2 3"], points: Float[np.ndarray, "n 3"], part: _Shut
) -> Float[np.ndarray, "2 3"]:
    """As much of a panel as its plane has points for: below there may be a plinth, behind the front."""
    on = np.abs(points[:, 0] - panel[1, 0]) < _FACE
    on &= ((points > panel[0] - 0.01) & (points < panel[1] + 0.01))[:, 1:].all(axis=1)
    if on.sum() < _FACE_LEAST:
        return panel
    low, high = ends_of(points[on])
    found = panel.copy()
    own, half = part.handle[:3, 3], _half_handle(part)
    for axis in (1, 2):
        found[0, axis] = min(max(panel[0, axis], low[axis] - 0.005), own[axis] - half[axis])
        found[1, axis] = max(min(panel[1, axis], high[axis] + 0.005), own[axis] + half[axis])
    return found


def _half_handle(part: _Shut) -> Float[np.ndarray, "3"]:
    return np.abs(part.handle[:3, 0]) * 0.05 + 0.01


def cavity_behind(
    panel: Float[np.ndarray, "2 3"], kind: Literal["slide", "hinge"], most: float, rear: float
) -> Cavity | None:
    """What may be behind a panel: a guess until it is open.

    Args:
      panel: Low and high corner, object frame [m].
      kind: Of the part's joint.
      most: How far a part that slides opens [m].
      rear: Of the furniture, along X [m].
    """
    slides = kind == "slide"
    wall = np.array([0.0, 1.0, 1.0]) * (_WALL if slides else _DOOR_WALL)
    low, high = panel[0] + wall, panel[1] - wall
    high[0] = panel[0, 0]
    low[0] = high[0] - most if slides else rear + _REAR
    if (high - low < 0.04).any():
        return None
    return Cavity((low + high) / 2, high - low, moves_with_part=slides)
