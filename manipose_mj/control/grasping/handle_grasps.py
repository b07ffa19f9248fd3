"""Ways to touch a drawer or door: a grip around the handle's bar, or closed fingers that push."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import radians
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Float

from manipose_mj.assets.franka_hand import (
    FINGER_BOXES,
    FINGER_OFFSET,
    MAX_OPENING,
    PAD_BOX,
    TCP_OFFSET,
)
from manipose_mj.control.grasping.candidates import OPENING_MARGIN
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.scene_estimate import PartEstimate
from manipose_mj.poses import compose, invert, rotation_about

_TILT_STEP = radians(15)
_GRIP_TILT = radians(75)
_PUSH_TILT = radians(90)
# Of fingers that hold a bar askew, against the arm's joints. A thin bar turns in them; a wider one [m] pries them open, and
# they slide off: they tilt less.
_ASKEW_PRICE, _TURNING_WIDTH, _WIDE_TILT = 0.6, 0.02, radians(15)
_X = np.array([1.0, 0.0, 0.0])
_MIN_GRIP = 0.012  # of the bar beyond the middle of the fingers [m]
_MAX_WIDTH = MAX_OPENING - 0.004  # of what the gripper takes [m]
# Of the bar's frame: about the handle's Y, so that the hand may tilt about the handle's Z.
_CROSSWISE = compose(rotation_about(np.array([0.0, 1.0, 0.0]), -np.pi / 2), np.zeros(3))
# Of a hand farther out: at least [m], and of the depth of a bar and of a knob.
_BACK, _BACK_SHARE, _KNOB_SHARE = 0.004, 0.25, 0.5
_DEEP_SHARES = (0.125, 0.25, 0.375)  # of the depth of a knob
# The same of a wide bar, whose middle may be estimated too far out: the hand goes beyond it.
_WIDE_SHARES = (-0.375, -0.2)
_BEFORE = 0.002  # of a hand that holds a bar by its fingertips, from the bar's front [m]
_SLIDES = (0.0, 0.025, -0.025)  # along the bar, from its middle [m]
_ASIDE = (0.4, -0.4, 0.8, -0.8)  # the same, as shares of what is free on either side
# From the TCP to the closed fingers' tips, half their width and half their thickness [m].
_TIP = FINGER_BOXES[2][1][2] + FINGER_OFFSET - TCP_OFFSET
_HALF_WIDTH = PAD_BOX[1][0]
_HALF_THICKNESS = FINGER_BOXES[2][1][1]
_PRESS = 0.0015  # how far the fingers are sent into what they push [m]
_INSET = 0.022  # of a push on a door's inside, from its free edge [m]
_TURNS = ((True, 1.0), (False, 1.0), (True, -1.0), (False, -1.0))  # flat and sign of a push
_RADII = (1.0, 0.6, 0.35)  # where between hinge and free edge
_KNOB_LIKE = (
    0.1  # of a unit axis across the way out of the front: what has less turns as a knob does
)
_BESIDE = 0.01  # how far what carries a handle sticks out beside it [m]
# Where along the edge to push, as shares of half its length.
_ALONG = (0.0, 0.5, -0.5, 0.8, -0.8)


def _grid(limit: float) -> Float[np.ndarray, "n"]:
    count = round(limit / _TILT_STEP)
    return _TILT_STEP * np.arange(-count, count + 1)


@dataclass(frozen=True)
class Grip:
    """Fingers around a handle, about whose bar the hand may tilt.

    Attributes: bar: `T_part_bar`, its X along the bar and its Y outwards; upright: `T_bar_tcp` without a
    tilt; opening: of the gripper, closed on the bar [m]; askew_price: of each pose that is not straight, against arm
    joints, both [rad], 0 where the hand may turn about the bar; straight: tilt at which fingers hold it so [rad].
    """

    bar: Float[np.ndarray, "4 4"]
    upright: Float[np.ndarray, "4 4"]
    opening: float
    askew_price: float = 0.0
    straight: float = 0.0

    @property
    def opening_before(self) -> float:
        """Of the gripper as it comes and when it has let go [m]."""
        return min(self.opening + OPENING_MARGIN, MAX_OPENING)

    @property
    def tilts(self) -> Float[np.ndarray, "n"]:
        """Of the hand about the bar [rad]."""
        if self.askew_price:
            return self.straight + _grid(_WIDE_TILT)
        return _grid(_GRIP_TILT)

    def tcp_poses(self, tilts: Float[np.ndarray, "k"]) -> Float[np.ndarray, "k 4 4"]:
        """`T_part_tcp` at these tilts."""
        turns = np.stack([rotation_about(_X, float(tilt)) for tilt in tilts])
        return self.bar @ compose(turns, np.zeros((len(turns), 3))) @ self.upright


def grip_now(part: PartEstimate, tcp_pose: Float[np.ndarray, "4 4"], opening: float) -> Grip:
    """How the hand holds the handle now: that is straight, whatever its tilt."""
    along = np.abs((part.handle_pose[:3, :3].T @ tcp_pose[:3, 0])[[0, 2]])
    turn = _CROSSWISE if along[1] > along[0] else np.eye(4)
    now = invert(part.handle_pose @ turn) @ tcp_pose
    # Without a tilt the hand looks along -Y.
    tilt = float(np.arctan2(-now[2, 2], -now[1, 2]))
    back = compose(rotation_about(_X, -tilt), np.zeros(3))
    bar = part.handle.pose @ turn
    return Grip(bar, back @ now, opening, _askew_price(part), straight=tilt)


def _askew_price(part: PartEstimate) -> float:
    along, _, across = part.handle.extents
    return _ASKEW_PRICE if along > _MAX_WIDTH and across > _TURNING_WIDTH else 0.0


@dataclass(frozen=True)
class Push:
    """Closed fingers against a point of a part.

    Attributes:
      point: Of the surface, in the part's frame `(3,)` [m].
      normal: Of the surface there, outwards: where the hand comes from `(3,)`.
      axis: About which the hand tilts `(3,)`, a unit vector in the surface.
      flat: Whether the fingers lie side by side along the axis.
      sign: Which of two half turns about the approach.
      opening: Of the gripper [m].
      opening_before: Of the gripper as it comes [m].
      askew_price: Of each pose with a tilt, against arm joints, both [rad].
      straight: Tilt at which it is not askew [rad].
    """

    point: Float[np.ndarray, "3"]
    normal: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    flat: bool
    sign: float = 1.0
    opening: float = 0.0
    opening_before: float = 0.0
    askew_price: float = 0.0
    straight: float = 0.0

    @property
    def tilts(self) -> Float[np.ndarray, "n"]:
        """Of the hand about the axis [rad]."""
        return _grid(_PUSH_TILT)

    def tcp_poses(self, tilts: Float[np.ndarray, "k"]) -> Float[np.ndarray, "k 4 4"]:
        """`T_part_tcp` at these tilts."""
        side = _HALF_WIDTH if self.flat else _HALF_THICKNESS
        poses = []
        for tilt in tilts:
            approach = rotation_about(self.axis, float(tilt)) @ -self.normal
            across = self.sign * self.axis
            columns = (
                (np.cross(across, approach), across)
                if self.flat
                else (across, np.cross(approach, across))
            )
            rotation = np.stack([*columns, approach], axis=1)
            reach = _TIP * abs(np.cos(tilt)) + side * abs(np.sin(tilt)) - _PRESS
            poses.append(compose(rotation, self.point + reach * self.normal))
        return np.stack(poses)


GripKind = Literal["usual", "fingertips", "deep", "aside"]


def grips(part: PartEstimate, kind: GripKind = "usual") -> Iterator[Grip]:
    """Around the bar of the part's handle, its middle first; the hand comes along -Y of the label.

    A knob or a short bar is taken across too.

    Args:
      part: Has the handle.
      kind: `"fingertips"`: only by the front of the bar, which leaves the most room to what is behind it. `"deep"`:
        only around the widest place of a knob, or as near to it as there is room; a round one slips out of
        fingers on its front half; and behind the middle of a wide bar. No thin bar is so held. `"aside"`: only away
        from the middle of a long bar.
    """
    along, height, across = part.handle.extents
    knob = along < _MAX_WIDTH
    ways = [(np.eye(4), across, along)]
    if knob:
        ways.append((_CROSSWISE, along, across))
    # It is held by its front too: there is more room behind the fingertips, and the hand can tilt more.
    backs = (0.0, max((_KNOB_SHARE if knob else _BACK_SHARE) * height, _BACK))
    if kind == "fingertips":
        backs = (height / 2 + _BEFORE,)
    elif kind == "deep":
        wide = _WIDE_SHARES if _askew_price(part) else ()
        backs = tuple(share * height for share in (_DEEP_SHARES if knob else wide))
    elif kind == "aside":
        backs = (0.0,)
    for (turn, width, length), back in product(ways, backs):
        free = length / 2 - _MIN_GRIP
        for slide in _slides(free, back, kind):
            for sign in (1.0, -1.0):
                x = np.array([sign, 0.0, 0.0])
                approach = np.array([0.0, -1.0, 0.0])
                rotation = np.stack([x, np.cross(approach, x), approach], axis=1)
                upright = compose(rotation, slide * _X - back * approach)
                yield Grip(part.handle.pose @ turn, upright, float(width), _askew_price(part))


def _slides(free: float, back: float, kind: GripKind) -> list[float]:
    """Along the bar, from its middle [m]."""
    if kind == "aside":
        aside = [share * free for share in _ASIDE]
        return [slide for slide in aside if abs(slide) > _SLIDES[1]]
    return [slide for slide in _SLIDES if not slide or (abs(slide) <= free and not back)]


def shutting_pushes(planner: MotionPlanner, part: PartEstimate) -> Iterator[Push]:
    """On the front of the handle's bar; of a door also on its front. None of what turns as a knob does."""
    handle = part.handle
    normal = handle.rotation[:, 1]
    axis = handle.rotation[:, 0]
    if part.joint.kind == "hinge":
        axis = part.joint.axis - (part.joint.axis @ normal) * normal
        if np.linalg.norm(axis) < _KNOB_LIKE:
            return
        axis /= np.linalg.norm(axis)
    front = handle.origin + normal * handle.extents[1] / 2
    # Along the bar where that lies along the axis; a bar across it is met in its middle.
    free = max(handle.extents[0] / 2 - 0.02, 0.0) * abs(float(axis @ handle.rotation[:, 0]))
    for flat, sign in _TURNS:
        for share in _ALONG if free else (0.0,):
            yield Push(front + share * free * axis, normal, axis, flat, sign)
    if part.joint.kind == "hinge":
        yield from _pushes_on_face(planner, part, normal)


def opening_pushes(planner: MotionPlanner, part: PartEstimate) -> Iterator[Push]:
    """On the inside of a door."""
    return _pushes_on_face(planner, part, -part.handle.rotation[:, 1])


def _pushes_on_face(
    planner: MotionPlanner, part: PartEstimate, normal: Float[np.ndarray, "3"]
) -> Iterator[Push]:
    """On the face of a door with this normal: near its free edge and nearer to the hinge, at the handle's
    height and elsewhere."""
    low, high = part_bounds(planner, part)
    axis = part.joint.axis
    radial = np.cross(axis, normal)
    radial *= np.sign(radial @ (part.handle.origin - part.joint.origin))
    center, half = (low + high) / 2, (high - low) / 2
    face = _board_face(planner, part, normal)
    hinge = float(part.joint.origin @ radial)
    edge = _support(center, half, radial) - _INSET
    beside = float(np.abs(axis) @ half) - _INSET
    middle = float(center @ axis)
    heights = [float(part.handle.origin @ axis)] + [middle + share * beside for share in _ALONG]
    for flat, sign in _TURNS:
        for share in _RADII:
            for height in heights:
                away = hinge + share * (edge - hinge)
                point = face * normal + away * radial + height * axis
                yield Push(point, normal, axis, flat, sign)


def _board_face(
    planner: MotionPlanner, part: PartEstimate, normal: Float[np.ndarray, "3"]
) -> float:
    """How far the part reaches along a normal of its face, without its handle [m]."""
    boxes = geom_boxes(planner, part)
    handle = part.handle
    center, half = boxes.mean(axis=1), (boxes[:, 1] - boxes[:, 0]) / 2
    reach = half @ np.abs(handle.rotation) + np.abs((center - handle.origin) @ handle.rotation)
    carries = (reach[:, [0, 2]] < handle.extents[[0, 2]] / 2 + _BESIDE).all(axis=1)
    ends = center @ normal + half @ np.abs(normal)
    return float(ends[~carries].max() if not carries.all() else ends.max())


def part_bounds(
    planner: MotionPlanner, part: PartEstimate
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Low and high corner of the part's collision geometry in its own frame [m]."""
    boxes = geom_boxes(planner, part)
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def geom_boxes(planner: MotionPlanner, part: PartEstimate) -> Float[np.ndarray, "n 2 3"]:
    """Low and high corner of each of the part's collision geoms in its own frame [m]."""
    model = planner.scene.model
    boxes = []
    for geom in np.flatnonzero(part.geoms):
        if not model.geom_contype[geom] and not model.geom_conaffinity[geom]:
            continue
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        rotation = rotation.reshape(3, 3)
        box = model.geom_aabb[geom]
        center = model.geom_pos[geom] + rotation @ box[:3]
        half = np.abs(rotation) @ box[3:]
        boxes.append((center - half, center + half))
    return np.array(boxes)


def _support(
    center: Float[np.ndarray, "3"], half: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"]
) -> float:
    """How far a box reaches along a direction [m]."""
    return float(center @ direction + half @ np.abs(direction))


def shifted(push: Push, distance: float) -> Push:
    """The same, this far away from the surface [m]."""
    return replace(push, point=push.point + distance * push.normal)
