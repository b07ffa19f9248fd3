"""What to do with the object in the hand when a plan has failed, so that another can be made."""

from __future__ import annotations

import numpy as np

from manipose_mj.control.execution.executor import Actions
from manipose_mj.control.execution.primitives import Primitives
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.regrasp import Poses
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
) -> Actions:
    """Set down what is held on the table, as it lies in the hand; let go of a handle where it is.

    So too of what lies on something yet: `supported`.

    Raises:
      StageFailure: It cannot be done.
    """
    name = primitives.held
    if name is None:
        return
    if name in estimate.objects and failure.stage != "grasp" and not supported:
        poses = nearest_rests(estimate.objects[name])
        yield from primitives.move_to(planner, Step("move_to", name, poses=poses))
    yield from primitives.release(planner, name)


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
