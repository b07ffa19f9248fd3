"""Where what the hand holds is set down, as it lies in the hand."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.grasping.retraction import Place, find_place
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.scene.cavity_mouth import way_out
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.poses import invert


def place_held(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    step: Step,
    pose_tcp: Float[np.ndarray, "4 4"],
    near: Float[np.ndarray, "7"],
) -> Place | None:
    """How to set down what is held, as if it were held at `T_tcp_label`, near a configuration [rad]."""
    obj = estimate.objects[step.subject]
    way = way_out(estimate, step.poses[0][:3, 3])
    attached = obj.held_at(pose_tcp @ invert(obj.label.pose))
    return find_place(planner, pose_tcp, step.poses, obj.label.symmetry, attached, near, way)


def placed_again(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    step: Step,
    pose_tcp: Float[np.ndarray, "4 4"],
) -> tuple[Float[np.ndarray, "t 7"], Place] | None:
    """A short path and a descent for the object as it lies in the hand now."""
    place = place_held(planner, estimate, step, pose_tcp, estimate.joints)
    if place is None:
        return None
    query = estimate.in_hand(step.subject).query()
    free = planner.free_path(estimate.joints, place.above, query)
    return None if free is None else (free, place)
