"""Plans that bring an object to rest where a goal wants it, set down on the way where they must."""

from __future__ import annotations

from itertools import islice

from manipose_mj.control.belief import Belief, ObjectBelief
from manipose_mj.control.motion_planner import MotionPlanner
from manipose_mj.control.plan import Plan, Step
from manipose_mj.control.regrasp import Poses, routes
from manipose_mj.control.table_places import poses_with_rotation, upright_poses
from manipose_mj.tasks.goals import OrientationGoal, PoseGoal, UprightGoal

RestGoal = PoseGoal | OrientationGoal | UprightGoal


def carry(
    goal: RestGoal, belief: Belief, planner: MotionPlanner | None = None, skip: int = 0
) -> Plan:
    """Steps that bring the goal's object to rest where it shall be.

    Args:
      goal: What is wanted.
      belief: What is where.
      planner: Of motions in the scene of `belief`; without one nothing is set down on the way.
      skip: So many of the ways that come first; they turned out not to work.
    """
    thing = belief.objects[goal.object]
    poses = destinations(goal, thing)
    if planner is None:
        return place(goal.object, poses)
    ways = list(islice(routes(planner, belief, thing, poses), skip + 1))
    return tuple(step for stop in ways[-1] for step in place(goal.object, stop))


def place(name: str, poses: Poses) -> Plan:
    """Take an object, bring its label to one of the poses, let go."""
    return (Step("grasp_at", name), Step("move_to", name, poses=poses), Step("release", name))


def destinations(goal: RestGoal, thing: ObjectBelief) -> Poses:
    """`T_world_label` that meet the goal, the likeliest first."""
    if isinstance(goal, PoseGoal):
        return (goal.pose,)
    if isinstance(goal, OrientationGoal):
        return poses_with_rotation(thing, goal.rotation)
    return upright_poses(thing)
