"""What to do with the object in the hand when a plan has failed, so that another can be made."""

from __future__ import annotations

import numpy as np

from manipose_mj.control.execution.executor import Actions
from manipose_mj.control.execution.primitives import Primitives
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.regrasp import Poses
from manipose_mj.control.planning.set_aside import places_aside
from manipose_mj.control.planning.table_places import poses_with_rotation, resting_rotation
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.failures import StageFailure


def let_go_safely(
    primitives: Primitives,
    planner: MotionPlanner,
    estimate: SceneEstimate,
    failure: StageFailure,
    *,
    supported: bool = False,
    among_others: bool = False,
) -> Actions:
    """Set down what is held on the table, as it lies in the hand, or where it was; let go of a handle where it is.

    Args:
      primitives: What holds it.
      planner: Says what to assume.
      estimate: What is where.
      failure: Of the plan.
      supported: What is held lies on something yet: let go of it where it is, too.
      among_others: Where there is no room on the table, lower it onto what lies under it.

    Raises:
      StageFailure: It cannot be done.
    """
    name = primitives.held
    if name is None:
        return
    if name in estimate.objects and failure.stage != "grasp" and not supported:
        poses = nearest_rests(estimate.objects[name])
        try:
            yield from primitives.move_to(planner, Step("move_to", name, poses=poses))
        except StageFailure:
            if among_others:
                yield from _set_down_in_clutter(primitives, planner, name)
            else:
                yield from primitives.put_back()
    yield from primitives.release(planner, name)


def _set_down_in_clutter(primitives: Primitives, planner: MotionPlanner, name: str) -> Actions:
    """Where there is room for what is held; without any, as low as it can be lowered from where it is."""
    estimate = primitives.observe()
    poses = places_aside(estimate.objects[name], (), estimate, planner.within(estimate.scene))
    try:
        if poses:
            yield from primitives.move_to(planner, Step("move_to", name, poses=poses))
            return
    except StageFailure as failure:
        if failure.stage == "grasp":
            return
    yield from primitives.lower(planner, name)


def nearest_rests(obj: ObjectEstimate) -> Poses:
    """`T_world_label` all over the table, resting on the side that now is lowest."""
    own = obj.label_pose[:3, :3]
    if not obj.rests:
        return poses_with_rotation(obj, own)
    down = own[2] @ obj.label.rotation.T
    rest = max(obj.rests, key=lambda rest: float(rest.rotation[2] @ down))
    upright = resting_rotation(obj, rest, 0.0)
    # The turn about the vertical that leaves least to do.
    turned = own @ upright.T
    yaw = float(np.arctan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]))
    return poses_with_rotation(obj, resting_rotation(obj, rest, yaw))
