"""Ways to touch a drawer or door: a grip around the handle's bar, or closed fingers that push."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import radians

import mujoco
import numpy as np
from jaxtyping import Float

from manipose_mj.assets.franka_hand import FINGER_BOXES, FINGER_OFFSET, PAD_BOX, TCP_OFFSET
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.scene_estimate import PartEstimate
from manipose_mj.poses import compose, invert, rotation_about

_TILT_STEP = radians(15)
_GRIP_TILT = radians(75)
_PUSH_TILT = radians(90)
_X = np.array([1.0, 0.0, 0.0])
_MIN_GRIP = 0.012  # of the bar beyond the middle of the fingers [m]
_SLIDES = (0.0, 0.025, -0.025)  # along the bar, from its middle [m]
# From the TCP to the closed fingers' tips, half their width and half their thickness [m].
_TIP = FINGER_BOXES[2][1][2] + FINGER_OFFSET - TCP_OFFSET
_HALF_WIDTH = PAD_BOX[1][0]
_HALF_THICKNESS = FINGER_BOXES[2][1][1]
_PRESS = 0.0015  # how far the fingers are sent into what they push [m]
_INSET = 0.022  # of a push on a door's inside, from its free edge [m]
_TURNS = ((True, 1.0), (False, 1.0), (True, -1.0), (False, -1.0))  # flat and sign of a push
# Where along the edge to push, as shares of half its length.
_ALONG = (0.0, 0.5, -0.5, 0.8, -0.8)


def _grid(limit: float) -> Float[np.ndarray, "n"]:
    count = round(limit / _TILT_STEP)
    return _TILT_STEP * np.arange(-count, count + 1)


@dataclass(frozen=True)
class Grip:
    """Fingers around the bar of a handle, about whose long axis, the label's X, the hand may tilt.

    Attributes: handle: `T_part_handle`; upright: `T_handle_tcp` without a tilt; opening: of the
    gripper, closed on the bar [m].
    """

    handle: Float[np.ndarray, "4 4"]
    upright: Float[np.ndarray, "4 4"]
    opening: float

    @property
    def tilts(self) -> Float[np.ndarray, "n"]:
        """Of the hand about the bar [rad]."""
        return _grid(_GRIP_TILT)

    def tcp_poses(self, tilts: Float[np.ndarray, "k"]) -> Float[np.ndarray, "k 4 4"]:
        """`T_part_tcp` at these tilts."""
        turns = np.stack([rotation_about(_X, float(tilt)) for tilt in tilts])
        return self.handle @ compose(turns, np.zeros((len(turns), 3))) @ self.upright


def grip_now(
    part: PartEstimate, tcp_pose: Float[np.ndarray, "4 4"], opening: float
) -> tuple[Grip, float]:
    """How the hand holds the handle now, and its tilt [rad]."""
    now = invert(part.handle_pose) @ tcp_pose
    # Without a tilt the hand looks along -Y.
    tilt = float(np.arctan2(-now[2, 2], -now[1, 2]))
    back = compose(rotation_about(_X, -tilt), np.zeros(3))
    return Grip(part.handle.pose, back @ now, opening), tilt


@dataclass(frozen=True)
class Push:
    """Closed fingers against a point of a part.

    Attributes:
      point: Of the surface, in the part's frame `(3,)` [m].
      normal: Of the surface there, outwards: where the hand comes from `(3,)`.
      axis: About which the hand tilts `(3,)`, a unit vector in the surface.
      flat: Whether the fingers lie side by side along the axis.
      sign: Which of two half turns about the approach.
    """

    point: Float[np.ndarray, "3"]
    normal: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    flat: bool
    sign: float = 1.0
    opening: float = 0.0

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


def grips(part: PartEstimate) -> Iterator[Grip]:
    """Around the bar of the part's handle, its middle first; the hand comes along -Y of the label."""
    width = float(min(part.handle.extents[1:]))
    free = part.handle.extents[0] / 2 - _MIN_GRIP
    for slide in _SLIDES:
        if slide and abs(slide) > free:
            continue
        for sign in (1.0, -1.0):
            x = np.array([sign, 0.0, 0.0])
            approach = np.array([0.0, -1.0, 0.0])
            rotation = np.stack([x, np.cross(approach, x), approach], axis=1)
            yield Grip(part.handle.pose, compose(rotation, slide * _X), width)


def shutting_pushes(part: PartEstimate) -> Iterator[Push]:
    """On the front of the handle's bar."""
    handle = part.handle
    normal = handle.rotation[:, 1]
    axis = handle.rotation[:, 0]
    if part.joint.kind == "hinge":
        axis = part.joint.axis - (part.joint.axis @ normal) * normal
        axis /= np.linalg.norm(axis)
    front = handle.origin + normal * handle.extents[1] / 2
    # Along the bar where that lies along the axis; a bar across it is met in its middle.
    free = max(handle.extents[0] / 2 - 0.02, 0.0) * abs(float(axis @ handle.rotation[:, 0]))
    for flat, sign in _TURNS:
        for share in _ALONG if free else (0.0,):
            yield Push(front + share * free * axis, normal, axis, flat, sign)


def opening_pushes(planner: MotionPlanner, part: PartEstimate) -> Iterator[Push]:
    """On the inside of a door, near its free edge."""
    low, high = part_bounds(planner, part)
    normal = -part.handle.rotation[:, 1]
    axis = part.joint.axis
    radial = np.cross(axis, normal)
    lever = part.handle.origin - part.joint.origin
    radial *= np.sign(radial @ lever)
    center, half = (low + high) / 2, (high - low) / 2
    inside = _support(center, half, normal)
    edge = _support(center, half, radial) - _INSET
    along = center @ axis
    point = inside * normal + edge * radial + along * axis
    for flat, sign in _TURNS:
        for share in _ALONG:
            reach = share * (np.abs(axis) @ half) * axis
            yield Push(point + reach, normal, axis, flat, sign)


def part_bounds(
    planner: MotionPlanner, part: PartEstimate
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Low and high corner of the part's collision geometry in its own frame [m]."""
    model = planner.scene.model
    lows, highs = [], []
    for geom in np.flatnonzero(part.geoms):
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        rotation = rotation.reshape(3, 3)
        box = model.geom_aabb[geom]
        center = model.geom_pos[geom] + rotation @ box[:3]
        half = np.abs(rotation) @ box[3:]
        lows.append(center - half)
        highs.append(center + half)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _support(
    center: Float[np.ndarray, "3"], half: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"]
) -> float:
    """How far a box reaches along a direction [m]."""
    return float(center @ direction + half @ np.abs(direction))


def shifted(push: Push, distance: float) -> Push:
    """The same, this far away from the surface [m]."""
    return replace(push, point=push.point + distance * push.normal)
