"""Lifting what the hand has taken hold of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.grasping.retraction import retractions
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.cavity_mouth import way_out
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.failures import StageFailure

_ASKEW = 0.02  # how much deeper in its support the estimate of what is lifted may be [m]


def retraction_of(
    planner: MotionPlanner, estimate: SceneEstimate, name: str
) -> Float[np.ndarray, "t 7"]:
    """Joint targets that lift a held object off its support.

    Raises:
      StageFailure: There is no way.
    """
    way = way_out(estimate, estimate.objects[name].label_pose[:3, 3])
    held = estimate.in_hand(name)
    # The estimate of what lies askew may be deeper in the table than its surface is unsure.
    deeper = replace(held, uncertainty=held.uncertainty + _ASKEW)
    for attached in (held, deeper) if held.uncertainty > 0 else (held,):
        for retraction in retractions(planner, estimate.joints, attached, way):
            return retraction
    raise StageFailure("plan", f"no way to lift {name}")
