"""Coming to a grasp: where the open hand is free of collision there, and a straight way to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.grasping.candidates import Grasps, Reach, postures
from manipose_mj.control.motion.batch_ik import solve
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import CONTACT, CollisionQuery
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS

# The approach may brush nothing, but the open fingers pass the object closely.
APPROACH = replace(CONTACT, arm=0.002, target=0.0)
_STANDOFFS = (0.10, 0.06)
_CLOSE_STANDOFFS = (*_STANDOFFS, 0.035)  # where little room is left
_FEW = 12  # free grasps, below which the arm is bent otherwise
_BENDS = 16  # of the arm that are drawn for each grasp, where nothing else works
_LINES = 3  # tried of those, for each grasp
_ENOUGH = 60  # grasps with a straight approach
_LOW, _HIGH = POSITION_LIMITS.T


def free_of_collision(
    planner: MotionPlanner, grasps: Grasps, reaches: Sequence[Reach], target: np.ndarray
) -> Reach:
    """The grasps that are free as the arm comes to them first; where those are few, also as it comes otherwise."""
    kept: dict[int, Float[np.ndarray, "7"]] = {}
    for reach in reaches:
        if len(kept) >= _FEW:
            break
        for index, joints in zip(reach.index.tolist(), reach.joints, strict=True):
            query = _query(grasps, index, target)
            if index not in kept and not planner.collides(joints, query):
                kept[index] = joints
    index = np.array(sorted(kept), int)
    return Reach(index, np.array([kept[i] for i in index.tolist()]).reshape(-1, 7))


def straight_approach(
    planner: MotionPlanner,
    grasps: Grasps,
    index: int,
    joints: Float[np.ndarray, "7"],
    target: np.ndarray,
    standoffs: Sequence[float] = _STANDOFFS,
) -> Float[np.ndarray, "s 7"] | None:
    """Joint targets of a straight approach to a grasp; None if there is none.

    Args:
      planner: Plans in the scene.
      grasps: All of them.
      index: Of the grasp.
      joints: At the grasp [rad].
      target: Mask of the geoms of what is grasped.
      standoffs: How far back it may begin, best first [m].
    """
    query = _query(grasps, index, target)
    for standoff in standoffs:
        back = planner.line(joints, planner.backed_off(joints, standoff), query)
        if back is not None:
            return np.concatenate([back[::-1], joints[None]])
    return None


def bent_approaches(
    planner: MotionPlanner, grasps: Grasps, near: Float[np.ndarray, "7"], target: np.ndarray
) -> dict[int, Float[np.ndarray, "s 7"]]:
    """Straight approaches by grasp, the arm bent in whatever way leaves it room: a search that takes seconds.

    The arm has a joint more than a pose needs. Where a shelf or a wall is near its forearm, few of the ways it can
    bend are free at the grasp and back from it.

    Args:
      planner: Plans in the scene.
      grasps: To look at, best first.
      near: The preferred configuration [rad].
      target: Mask of the geoms of what is grasped.
    """
    found: dict[int, Float[np.ndarray, "s 7"]] = {}
    bends = np.random.default_rng(0).uniform(_LOW, _HIGH, (_BENDS, 1, 7))
    bends = np.broadcast_to(bends, (_BENDS, len(grasps), 7))
    by_grasp: dict[int, list[Float[np.ndarray, "7"]]] = {}
    for reach in postures(grasps.tcp_poses, near, extra_seeds=bends):
        for index, joints in zip(reach.index.tolist(), reach.joints, strict=True):
            by_grasp.setdefault(index, []).append(joints)
    for index in sorted(by_grasp):
        query = _query(grasps, index, target)
        free = np.array([q for q in by_grasp[index] if not planner.collides(q, query)])
        for standoff in _CLOSE_STANDOFFS if len(free) else ():
            back, solved = solve(planner.backed_off(free[0], standoff)[None], free[:, None])
            roomy = [
                q
                for q, behind, ok in zip(free, back[:, 0], solved[:, 0], strict=True)
                if ok and not planner.collides(behind, query)
            ]
            ways = (
                straight_approach(planner, grasps, index, q, target, (standoff,))
                for q in roomy[:_LINES]
            )
            way = next((way for way in ways if way is not None), None)
            if way is not None:
                found[index] = way
                break
        if len(found) == _ENOUGH:
            break
    return found


def _query(grasps: Grasps, index: int, target: np.ndarray) -> CollisionQuery:
    """About the open hand that comes to a grasp."""
    return CollisionQuery(APPROACH, opening=float(grasps.openings[index]), target=target)
