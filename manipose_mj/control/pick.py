"""Choosing a grasp: reachable, free of collision, and good for what comes next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.belief import Belief, ObjectBelief, PartBelief
from manipose_mj.control.failure import StageFailure
from manipose_mj.control.grasp_candidates import (
    Grasps,
    Reach,
    handle_grasps,
    object_grasps,
    reachable,
)
from manipose_mj.control.motion_planner import MotionPlanner, equivalent_poses
from manipose_mj.control.planning_scene import CONTACT, carried_free_body
from manipose_mj.poses import invert

_STANDOFFS = (0.10, 0.06)
# Grasps free of collision that are looked at further, and complete picks tried, at most.
_MAX_FREE = 24
_MAX_TRIES = 16
# The approach may brush nothing, but the open fingers pass the object closely.
_APPROACH = replace(CONTACT, arm=0.002, target=0.0)


@dataclass(frozen=True)
class ObjectPick:
    """How to take an object.

    Attributes:
      free_path: Joint targets to where the approach starts `(t, 7)`.
      approach: Joint targets to the grasp `(t, 7)`.
      width: Expected between the pads once closed [m].
      opening: Of the gripper on approach [m].
      goal: A configuration in which the object is where it shall go; the grasp's own if it goes
        nowhere.
    """

    free_path: Float[np.ndarray, "t 7"]
    approach: Float[np.ndarray, "t 7"]
    width: float
    opening: float
    goal: Float[np.ndarray, "7"]


@dataclass(frozen=True)
class PartPick(ObjectPick):
    """How to take a part by its handle."""


def pick_object(
    planner: MotionPlanner,
    belief: Belief,
    thing: ObjectBelief,
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
) -> ObjectPick:
    """The first grasp, in order of promise, that can be approached and can reach a destination.

    Args:
      planner: Plans in the scene of `belief`.
      belief: What is where.
      thing: What to take.
      destinations: `T_world_label` that it shall go to, any of them; empty if it only is to be held.

    Raises:
      StageFailure: There is none; the reason says at which filter the last ones fell.
    """
    grasps = object_grasps(thing)
    reach = reachable(grasps.tcp_poses, belief.joints)
    if not len(reach.index):
        raise StageFailure("plan", f"none of {len(grasps)} grasps of {thing.name} is in reach")
    free = _free_of_collision(planner, grasps, reach, thing.geoms)
    if not len(free.index):
        raise StageFailure("plan", f"all {len(reach.index)} reachable grasps of {thing.name} collide")
    tries = 0
    pairs = _with_destination(grasps, free, thing, destinations)
    if not pairs:
        raise StageFailure(
            "plan", f"none of {len(free.index)} free grasps of {thing.name} reaches its destination"
        )
    for index, joints, goal in pairs:
        tries += 1
        if tries > _MAX_TRIES:
            break
        if destinations and not _can_set_down(planner, grasps, index, thing, destinations, goal):
            continue
        found = _approach(planner, belief, grasps, index, joints, thing.geoms, frozenset())
        if found is not None:
            free_path, approach = found
            return ObjectPick(
                free_path, approach, float(grasps.widths[index]), float(grasps.openings[index]), goal
            )
    raise StageFailure("plan", f"no grasp of {thing.name} could be approached and set down again")


def pick_part(
    planner: MotionPlanner, belief: Belief, part: PartBelief, opening: float | None
) -> PartPick:
    """The first grasp of the handle that can be approached and can move the part to `opening`.

    Raises:
      StageFailure: There is none.
    """
    grasps = handle_grasps(part)
    reach = reachable(grasps.tcp_poses, belief.joints)
    free = _free_of_collision(planner, grasps, reach, part.geoms)
    touched = frozenset({planner.body_name(part.body)})
    for index, joints in zip(free.index, free.joints, strict=True):
        planner.scene.set_opening(float(grasps.openings[index]))
        if opening is not None and planner.part_path(joints, part, opening) is None:
            continue
        found = _approach(planner, belief, grasps, index, joints, part.geoms, touched)
        if found is not None:
            free_path, approach = found
            return PartPick(
                free_path, approach, float(grasps.widths[index]), float(grasps.openings[index]), joints
            )
    raise StageFailure(
        "plan",
        f"no grasp of {part.name}'s handle works: {len(grasps)} tried, {len(reach.index)} in reach, "
        f"{len(free.index)} free of collision",
    )


def _free_of_collision(
    planner: MotionPlanner, grasps: Grasps, reach: Reach, target: np.ndarray
) -> Reach:
    kept = []
    for k, index in enumerate(reach.index):
        planner.scene.set_opening(float(grasps.openings[index]))
        if not planner.collides(reach.joints[k], clearance=_APPROACH, target=target):
            kept.append(k)
            if len(kept) == _MAX_FREE:
                break
    return Reach(reach.index[kept], reach.joints[kept])


def _with_destination(
    grasps: Grasps,
    free: Reach,
    thing: ObjectBelief,
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
) -> list[tuple[int, Float[np.ndarray, "7"], Float[np.ndarray, "7"]]]:
    """Grasp index, joints at the grasp and at a destination, the most promising first."""
    if not destinations:
        return [(int(i), q, q) for i, q in zip(free.index, free.joints, strict=True)]
    goals = equivalent_poses(destinations, thing.label.symmetry)
    label_tcp = invert(thing.label_pose) @ grasps.tcp_poses[free.index]
    tcp_goals = (goals[None] @ label_tcp[:, None]).reshape(-1, 4, 4)
    starts = np.repeat(free.joints, len(goals), axis=0)
    reach = reachable(tcp_goals, free.joints.mean(axis=0), extra_seeds=starts)
    travel = np.abs(reach.joints - starts[reach.index]).max(axis=1)
    rank = (reach.index // len(goals)) / max(len(free.index), 1)
    # A short way with a middling grasp beats a long one with the best.
    order = np.argsort(travel + rank, kind="stable")
    best: list[tuple[int, np.ndarray, np.ndarray]] = []
    used: dict[int, int] = {}
    for k in order:
        grasp = int(reach.index[k] // len(goals))
        used[grasp] = used.get(grasp, 0) + 1
        if used[grasp] <= 2:
            best.append((int(free.index[grasp]), free.joints[grasp], reach.joints[k]))
    return best


def _can_set_down(
    planner: MotionPlanner,
    grasps: Grasps,
    index: int,
    thing: ObjectBelief,
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
    goal: Float[np.ndarray, "7"],
) -> bool:
    inverse = invert(grasps.tcp_poses[index])
    carried = carried_free_body(
        planner.scene.model, thing.body, planner.free_joint(thing), inverse @ thing.pose
    )
    planner.scene.set_opening(float(grasps.widths[index]))
    pose_tcp = inverse @ thing.label_pose
    place = planner.place(pose_tcp, destinations, thing.label.symmetry, carried, goal)
    return place is not None


def _approach(
    planner: MotionPlanner,
    belief: Belief,
    grasps: Grasps,
    index: int,
    joints: Float[np.ndarray, "7"],
    target: np.ndarray,
    touched: frozenset[str],
) -> tuple[Float[np.ndarray, "t 7"], Float[np.ndarray, "s 7"]] | None:
    """Free path to the standoff and straight approach from there."""
    planner.scene.set_opening(float(grasps.openings[index]))
    for standoff in _STANDOFFS:
        back = planner.line(
            joints,
            planner.backed_off(joints, standoff),
            clearance=_APPROACH,
            target=target,
            touched=touched,
        )
        if back is None:
            continue
        free = planner.free_path(belief.joints, back[-1])
        if free is not None:
            return free, np.concatenate([back[::-1], joints[None]])
    return None
