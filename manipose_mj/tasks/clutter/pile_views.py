"""How much of a thing in a pile is seen from around, without a robot or a room."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.mjcf.cameras.ray_camera import Intrinsics, image_rays
from manipose_mj.poses import compose
from manipose_mj.tasks.observations.visibility import share_seen

# Directions to look from: so many azimuths from +x on, at these elevations [rad].
AZIMUTHS = 12
ELEVATIONS = (0.52, 1.22)
_DISTANCE = 0.9  # of the eye from the middle of the pile [m]
_MIDDLE = np.array([0.0, 0.0, 0.05])
_VIEW = Intrinsics(width=64, height=64, fx=110.0, fy=110.0, cx=31.5, cy=31.5)


def most_seen(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    obj: Bool[np.ndarray, "ngeom"],
    middle: Float[np.ndarray, "2"],
    enough: float = 1.0,
) -> float:
    """Pixels of a thing in the pile over its pixels alone, from where most of it is seen.

    Args:
      model: The compiled model.
      data: Its state after `mj_forward`.
      thing: A mask over its geoms.
      middle: Of the pile, which the eye looks at [m].
      enough: Look no further once so much is seen.
    """
    rays = image_rays(_VIEW)
    at = _MIDDLE + np.array([*middle, 0.0])
    most = 0.0
    for elevation in ELEVATIONS:
        for k in range(AZIMUTHS):
            pose = _eye(2 * np.pi * k / AZIMUTHS, elevation, at)
            most = max(most, share_seen(model, data, obj, pose, rays))
            if most > enough:
                return most
    return most


def _eye(azimuth: float, elevation: float, at: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    """`T_world_camera` (x right, y down, z forward) that looks at a point from this direction."""
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    towards = np.cos(elevation) * level + np.sin(elevation) * np.array([0.0, 0.0, 1.0])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    rotation = np.stack([right, np.cross(-towards, right), -towards], axis=1)
    return compose(rotation, at + _DISTANCE * towards)
