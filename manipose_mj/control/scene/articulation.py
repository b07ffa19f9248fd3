"""Drawers and doors at other joint positions than the observed ones."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import PartEstimate
from manipose_mj.poses import compose, invert, rotation_about


def joint_motion(part: PartEstimate, position: float) -> Float[np.ndarray, "4 4"]:
    """How the part has moved, in the object frame, when its joint is at `position`."""
    joint = part.joint
    if joint.kind == "slide":
        return compose(np.eye(3), joint.axis * position)
    rotation = rotation_about(joint.axis, position)
    return compose(rotation, joint.origin - rotation @ joint.origin)


def with_part_at(scene: PlanningScene, part: PartEstimate, opening: float) -> PlanningScene:
    """The scene with the part, and the objects in it, at another opening [m or rad]."""
    moved = joint_motion(part, opening) @ invert(joint_motion(part, part.opening))
    motion = part.base_pose @ moved @ invert(part.base_pose)
    if scene.is_free(part.body):
        opened = scene.with_body_at(part.body, part.base_pose @ joint_motion(part, opening))
    else:
        opened = scene.with_joint_at(part.body, opening)
    for body in part.bodies_inside:
        opened = opened.with_body_at(body, motion @ scene.body_pose(body))
    return opened
