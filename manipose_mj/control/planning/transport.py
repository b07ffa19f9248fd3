"""Plans that bring an object to rest where a goal wants it, set down on the way where they must."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import Plan, Step
from manipose_mj.control.planning.regrasp import Poses, routes
from manipose_mj.control.planning.table_places import (
    poses_at_edge,
    poses_with_rotation,
    settled,
    upright_poses,
)
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.poses import pose_error
from manipose_mj.tasks.goals import Goal, OrientationGoal, PoseGoal, UprightGoal
from manipose_mj.tasks.goals.conditions import Tolerance

RestGoal = PoseGoal | OrientationGoal | UprightGoal


def transport_plans(
    goal: RestGoal, estimate: SceneEstimate, planner: MotionPlanner | None = None
) -> Iterator[Plan]:
    """Plans that bring the goal's object to rest where it shall be, the most promising first.

    Args:
      goal: What to reach.
      estimate: What is where.
      planner: Of motions in the scene of `estimate`; without one nothing is set down on the way.
    """
    obj = estimate.objects[goal.object]
    poses = destinations(goal, obj)
    if planner is None:
        yield place(goal.object, poses)
        return
    for stops in routes(planner, estimate, obj, poses):
        yield place_at_each(goal.object, stops)
    if isinstance(goal, OrientationGoal):
        for at_edge in poses_at_edge(obj, goal.rotation):
            yield place(goal.object, at_edge)


def lie_wrong(goals: tuple[Goal, ...], estimate: SceneEstimate, tolerance: Tolerance) -> bool:
    """Whether an object is seen to lie otherwise than a goal has it, by more than the task's tolerance."""
    symmetries = {name: obj.label.symmetry for name, obj in estimate.objects.items()}
    for goal in goals:
        frame = goal.goal_frame(symmetries) if isinstance(goal, RestGoal) else None
        if frame is None:
            continue
        pose = estimate.objects[frame.object].label_pose
        shift, turn = pose_error(pose, np.asarray(frame.pose), frame.symmetry)
        moved = frame.translation_counts and shift > tolerance.translation
        if moved or (frame.rotation_counts and turn > tolerance.rotation):
            return True
    return False


def place_at_each(name: str, stops: tuple[Poses, ...]) -> Plan:
    """Take an object to one stop after the other, each at any of its poses."""
    return tuple(step for stop in stops for step in place(name, stop))


def place(name: str, poses: Poses) -> Plan:
    """Take an object, bring its label to one of the poses, let go."""
    return (Step("grasp_at", name), Step("move_to", name, poses=poses), Step("release", name))


def destinations(goal: RestGoal, obj: ObjectEstimate) -> Poses:
    """`T_world_label` that meet the goal, the likeliest first."""
    if isinstance(goal, PoseGoal):
        return (settled(obj, goal.pose), goal.pose) if obj.guessed_frame else (goal.pose,)
    if isinstance(goal, OrientationGoal):
        return poses_with_rotation(obj, goal.rotation)
    return upright_poses(obj)
