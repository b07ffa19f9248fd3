"""Ways to bring the hand's camera before something that was opened: it sees deeper in there than standing cameras."""

from __future__ import annotations

from itertools import islice

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Cavity
from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.control.motion.batch_ik import seeds_for, solve
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.cavity_mouth import outwards
from manipose_mj.control.scene.collision_query import CollisionQuery
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.mjcf.panda.kinematics import TCP_OFFSET, WRIST_CAMERA, WRIST_TILT
from manipose_mj.poses import compose, invert

# How far the camera is from the middle of the cavity [m], the best first: a depth camera sees nothing that is nearer
# than 0.4 m, and little of what is far.
_DISTANCES = (0.52, 0.45, 0.60, 0.40)
# How far its axis is from straight down, into drawers and behind doors [rad]; the best first.
_INTO_DRAWERS, _BEHIND_DOORS = (0.45, 0.15, 0.75), (1.1, 1.35, 0.85)
_MOST_PATHS = 4  # that are planned
_WIDE = CollisionQuery(opening=MAX_OPENING)  # closed fingers hide what the camera looks at
_UP = np.array([0.0, 0.0, 1.0])


def way_to_look_into(
    planner: MotionPlanner, estimate: SceneEstimate, part: PartEstimate
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets to where the hand's camera looks into an opened part past open fingers; None if there is no such
    place, or no way.

    Args:
      planner: In the scene as it is.
      estimate: What is where.
      part: Open.
    """
    if part.cavity is None:
        return None
    looks = _looks(part, part.cavity) @ invert(_camera_in_hand())
    joints, solved = solve(looks, seeds_for(looks))
    away = np.abs(joints - estimate.joints).sum(axis=-1)
    free = (
        joints[seed, look]
        for look in range(len(looks))
        for seed in np.argsort(away[:, look])
        if solved[seed, look] and not planner.collides(joints[seed, look], _WIDE)
    )
    for goal in islice(free, _MOST_PATHS):
        path = planner.free_path(estimate.joints, goal, _WIDE)
        if path is not None:
            return path
    return None


def _looks(part: PartEstimate, cavity: Cavity) -> Float[np.ndarray, "n 4 4"]:
    """`T_world_camera` of places to look into the cavity from, the best first; OpenCV's axes."""
    frame = part.pose if cavity.moves_with_part else part.base_pose
    target = frame[:3, :3] @ cavity.center + frame[:3, 3]
    out = part.base_pose[:3, :3] @ outwards(part)
    found = []
    for distance in _DISTANCES:
        for tilt in _INTO_DRAWERS if cavity.moves_with_part else _BEHIND_DOORS:
            axis = -np.cos(tilt) * _UP - np.sin(tilt) * out
            right = np.cross(axis, _UP)
            right /= np.linalg.norm(right)
            for side in (right, -right):  # upright, or head over with the hand above the camera
                rotation = np.stack([side, np.cross(axis, side), axis], axis=1)
                found.append(compose(rotation, target - distance * axis))
    return np.array(found)


def _camera_in_hand() -> Float[np.ndarray, "4 4"]:
    """`T_tcp_camera`, OpenCV's axes."""
    right = np.array([0.0, 1.0, 0.0])
    down = np.array([-np.cos(WRIST_TILT), 0.0, -np.sin(WRIST_TILT)])
    rotation = np.stack([right, down, np.cross(right, down)], axis=1)
    return compose(rotation, np.array(WRIST_CAMERA) - [0.0, 0.0, TCP_OFFSET])
