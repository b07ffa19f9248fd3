"""Pushing a loose object over the table with closed fingers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.grasping.candidates import reachable
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import CONTACT, CollisionQuery
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate

_GAP = 0.022  # between the TCP and the side that it pushes, before it starts [m]
# Of the TCP above the table, best first [m]: low, so that what stands does not fall.
_HEIGHTS = (0.02, 0.03, 0.012)
_RISES = (0.12, 0.07)  # from which the hand comes down beside the object [m]
_MAX_LINES = 48  # pushes tried from starts that are free
_TURNS = 4  # of the hand about the vertical
# Other things may be brushed as far as the planner allows, what is pushed as far as the push goes.
_PUSHING = replace(CONTACT, arm=0.002, target=-np.inf)


@dataclass(frozen=True)
class ObjectPush:
    """Joint targets: free_path `(t, 7)` to above the start, down beside the object `(s, 7)`, along `(k, 7)`."""

    free_path: Float[np.ndarray, "t 7"]
    down: Float[np.ndarray, "s 7"]
    along: Float[np.ndarray, "k 7"]


def push_object(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    obj: ObjectEstimate,
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
) -> ObjectPush | None:
    """A push of the object towards the first of the places that the hand can push it to.

    Args:
      planner: Plans in the scene of `estimate`.
      estimate: What is where.
      obj: What to push.
      destinations: `T_world_label`, of which only the places on the table count.
    """
    shifts = [destination[:2, 3] - obj.label_pose[:2, 3] for destination in destinations]
    starts = [(start, shift) for shift in shifts for start in _starts(obj, shift)]
    # Turns of the hand last: first every place and height with one of them.
    starts = [start for turn in range(_TURNS) for start in starts[turn::_TURNS]]
    if not starts:
        return None
    reach = reachable(np.array([start for start, _ in starts]), estimate.joints)
    query = CollisionQuery(_PUSHING, opening=0.0, target=obj.geoms)
    lines = 0
    for index, joints in zip(reach.index, reach.joints, strict=True):
        if planner.collides(joints, query) or lines == _MAX_LINES:
            continue
        lines += 1
        push = _push(planner, estimate, joints, *starts[int(index)], query)
        if push is not None:
            return push
    return None


def leave_pushed(
    planner: MotionPlanner,
    joints: Float[np.ndarray, "7"],
    obj: ObjectEstimate,
    direction: Float[np.ndarray, "2"],
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets back from what was pushed along `direction` and up, or straight up; None if there are none."""
    query = CollisionQuery(_PUSHING, target=obj.geoms)
    shift = -_GAP * direction / max(float(np.linalg.norm(direction)), _GAP)
    for back in (shift, np.zeros(2)):
        for rise in _RISES:
            beside = planner.tcp_pose(joints)
            beside[:2, 3] += back
            above = beside.copy()
            above[2, 3] += rise
            first = planner.line(joints, beside, query) if back.any() else joints[None]
            second = None if first is None else planner.line(first[-1], above, query)
            if first is not None and second is not None:
                return np.concatenate([first, second])
    return None


def _starts(obj: ObjectEstimate, shift: Float[np.ndarray, "2"]) -> Float[np.ndarray, "n 4 4"]:
    """`T_world_tcp` beside the object, pointing down, the likeliest heights first."""
    direction = np.array([*shift, 0.0]) / np.linalg.norm(shift)
    rotation = obj.label_pose[:3, :3]
    half = float(np.abs(rotation.T @ direction) @ obj.label.extents) / 2
    middle = obj.label_pose[:3, 3]
    at = middle - direction * (half + _GAP)
    top = middle[2] + float(np.abs(rotation[2]) @ obj.label.extents) / 2
    poses = []
    for height in _HEIGHTS:
        if height > max(top, _HEIGHTS[-1]):
            continue
        for turn in range(_TURNS):
            angle = np.arctan2(direction[1], direction[0]) + turn * np.pi / 2
            x = np.array([np.cos(angle), np.sin(angle), 0.0])
            pose = np.eye(4)
            pose[:3, :3] = np.stack([x, np.array([x[1], -x[0], 0.0]), [0.0, 0.0, -1.0]], axis=1)
            pose[:3, 3] = at[0], at[1], height
            poses.append(pose)
    return np.array(poses).reshape(-1, 4, 4)


def _push(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    joints: Float[np.ndarray, "7"],
    start: Float[np.ndarray, "4 4"],
    shift: Float[np.ndarray, "2"],
    query: CollisionQuery,
) -> ObjectPush | None:
    """From these joints, which have the TCP at `start`."""
    end = start.copy()
    end[:2, 3] += shift * (1 + _GAP / float(np.linalg.norm(shift)))
    along = planner.line(joints, end, query)
    if along is None:
        return None
    for rise in _RISES:
        above = start.copy()
        above[2, 3] += rise
        up = planner.line(joints, above, query)
        if up is None:
            continue
        free_path = planner.free_path(estimate.joints, up[-1], CollisionQuery(opening=0.0))
        if free_path is not None:
            return ObjectPush(free_path, np.concatenate([up[::-1], joints[None]]), along)
    return None
