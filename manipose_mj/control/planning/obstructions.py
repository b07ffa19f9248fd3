"""What keeps the hand from an object: of each grasp, the other objects that it would hit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.grasping.approach import APPROACH
from manipose_mj.control.grasping.candidates import (
    OPENING_MARGIN,
    WIDE_MARGIN,
    Grasps,
    object_grasps,
    reachable,
)
from manipose_mj.control.motion.batch_ik import solve
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.grasp_table import GraspTable
from manipose_mj.control.planning.removal_order import Blockers, smallest
from manipose_mj.control.scene.collision_query import CONTACT, CollisionQuery
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.mjcf.panda.robot import HOME
from manipose_mj.tasks.goals import PoseGoal

_MAX_GRASPS = 64  # looked at, spread over all
_MAX_USABLE = 16  # of those that can have the object at its goal
_MAX_SETS = 8
_STANDOFF = 0.06  # of the hand before the approach [m]
_LIFTS = (0.03, 0.08)  # heights at which what is taken meets nothing [m]


def blockers_of(
    obj: ObjectEstimate,
    estimate: SceneEstimate,
    planner: MotionPlanner,
    goal: PoseGoal | None = None,
) -> Blockers:
    """Sets of other objects; without those of any one of them some grasp can be had and lifted.

    Args:
      obj: What to take.
      estimate: What is where.
      planner: Plans in the scene of `estimate`; what it may push aside does not block.
      goal: Where it shall go: grasps that can have it there count alone, if there are any.
    """
    lift = _lift_blockers(obj, estimate, planner)
    if lift is None:
        return ()
    grasps = object_grasps(obj)
    if goal is not None:
        table = GraspTable(planner, estimate, obj)
        usable = table.usable(goal.pose, table.clear_at(goal.pose), enough=_MAX_USABLE)
        sets = _sets(planner, estimate, obj, grasps.take(np.flatnonzero(usable)), lift)
        if sets:
            return sets
    return _sets(planner, estimate, obj, grasps, lift)


def _sets(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    obj: ObjectEstimate,
    grasps: Grasps,
    lift: frozenset[str],
) -> Blockers:
    """The blockers of a sample of the grasps in reach that the hand can come straight to, and of lifting the object."""
    if not len(grasps):
        return ()
    grasps = grasps.take(np.unique(np.linspace(0, len(grasps) - 1, _MAX_GRASPS).astype(int)))
    reach = reachable(grasps.tcp_poses, estimate.joints)
    before, solved = _backed_off(grasps.tcp_poses[reach.index], reach.joints)
    sets = []
    for k, index in enumerate(reach.index):
        if not solved[k]:
            continue
        for margin in (OPENING_MARGIN, WIDE_MARGIN):
            opening = float(replace(grasps, margin=margin).openings[index])
            query = CollisionQuery(APPROACH, opening=opening, target=obj.geoms)
            at, before_it = (planner.obstacles(q, query) for q in (reach.joints[k], before[k]))
            names = _objects_hit(at | before_it, estimate)
            if names is not None and obj.name not in names:
                sets.append(names | lift)
                break
    return smallest(sets, _MAX_SETS)


def _backed_off(
    tcp_poses: Float[np.ndarray, "n 4 4"], joints: Float[np.ndarray, "n 7"]
) -> tuple[Float[np.ndarray, "n 7"], Bool[np.ndarray, "n"]]:
    """Configurations shortly before these, and which of them there are."""
    if not len(tcp_poses):
        return joints, np.zeros(0, bool)
    back = tcp_poses.copy()
    back[:, :3, 3] -= _STANDOFF * back[:, :3, 2]
    before, solved = solve(back, joints[None])
    return before[0], solved[0]


def _lift_blockers(
    obj: ObjectEstimate, estimate: SceneEstimate, planner: MotionPlanner
) -> frozenset[str] | None:
    found: frozenset[str] = frozenset()
    for height in _LIFTS:
        lifted = obj.label_pose.copy()
        lifted[2, 3] += height
        query = CollisionQuery(CONTACT, attached=obj.placed_at(lifted))
        names = _objects_hit(planner.obstacles(HOME, query), estimate)
        if names is None:
            return None
        found |= names
    return found - {obj.name}


def _objects_hit(hit: Bool[np.ndarray, "ngeom"], estimate: SceneEstimate) -> frozenset[str] | None:
    """The objects that these geoms are of; None if one is of no object."""
    names = frozenset(name for name, obj in estimate.objects.items() if (obj.geoms & hit).any())
    of_objects = np.zeros(len(hit), bool)
    for name in names:
        of_objects |= estimate.objects[name].geoms
    return None if (hit & ~of_objects).any() else names
