"""What to do with the thing in the hand when a plan has failed, so that another can be made."""

from __future__ import annotations

import numpy as np

from manipose_mj.control.belief import Belief, ObjectBelief
from manipose_mj.control.executor import Actions
from manipose_mj.control.failure import StageFailure
from manipose_mj.control.plan import Step
from manipose_mj.control.primitives import Primitives
from manipose_mj.control.regrasp import Poses
from manipose_mj.control.table_places import poses_with_rotation, resting_rotation


def let_go_safely(
    primitives: Primitives, belief: Belief, failure: StageFailure, *, supported: bool = False
) -> Actions:
    """Set down what is held on the table, as it lies in the hand; let go of a handle where it is.

    So too of what lies on something yet: `supported`.

    Raises:
      StageFailure: It cannot be done.
    """
    name = primitives.held
    if name is None:
        return
    if name in belief.objects and failure.stage != "grasp" and not supported:
        poses = nearest_rests(belief.objects[name])
        yield from primitives.move_to(Step("move_to", name, poses=poses))
    yield from primitives.release(name)


def nearest_rests(thing: ObjectBelief) -> Poses:
    """`T_world_label` all over the table, resting on the side that now is lowest."""
    own = thing.label_pose[:3, :3]
    if not thing.rests:
        return poses_with_rotation(thing, own)
    down = own[2] @ thing.label.rotation.T
    rest = max(thing.rests, key=lambda rest: float(rest.rotation[2] @ down))
    upright = resting_rotation(thing, rest, 0.0)
    # The turn about the vertical that leaves least to do.
    turned = own @ upright.T
    yaw = float(np.arctan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]))
    return poses_with_rotation(thing, resting_rotation(thing, rest, yaw))
