"""How uncertain the surface of an object is, by where goals have it lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate
from manipose_mj.poses import invert
from manipose_mj.tasks.goals import Goal, PoseGoal

# Of its longest side, how deep an object may seem to be in what it shall lie on for its shape to be what is wrong.
_DEEPEST = 0.1


def as_unsure_as_deep(
    obj: ObjectEstimate, goals: Sequence[Goal], scene: PlanningScene
) -> ObjectEstimate:
    """The object, whose surface is at least as uncertain as it is deep in what is fixed at the poses asked for.

    In such a pose it lies still: what of its shape is in its support there is not there.

    Args:
      obj: As estimated; one that counts as certain stays so.
      goals: All of them.
      scene: That has it, wherever it is.
    """
    uncertainty, most = obj.uncertainty, _DEEPEST * float(np.max(obj.label.extents))
    for goal in goals:
        if uncertainty and isinstance(goal, PoseGoal) and goal.object == obj.name:
            place = np.asarray(goal.pose) @ invert(obj.label.pose)
            depth = scene.with_body_at(obj.body, place).depth_in_fixed(obj.geoms)
            uncertainty = max(uncertainty, min(depth, most))
    return replace(obj, uncertainty=uncertainty)
