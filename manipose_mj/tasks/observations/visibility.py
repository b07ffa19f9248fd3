"""How much of a target the cameras see: pixels in the scene over pixels of the target alone."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
from jaxtyping import Bool

from manipose_mj.mjcf.cameras.ray_camera import (
    camera_id,
    camera_intrinsics,
    camera_pose,
    image_rays,
)
from manipose_mj.mjcf.cameras.ray_casting import RayBundles, cast_rays, visible_geoms


def visible_share(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    target: Bool[np.ndarray, "ngeom"],
    cameras: Iterable[int | str],
    height: int = 120,
    width: int = 160,
) -> float:
    """The share of a target that the camera which sees most of it sees.

    Args:
      model: The compiled model.
      data: Its state after `mj_forward`.
      target: A mask over its geoms.
      cameras: Names or ids.
      height: Of the images [pixels].
      width: Of the images [pixels].

    Returns:
      In [0, 1]. A camera that would not see the target even if it were alone does not count.
    """
    shares = [0.0]
    for camera in cameras:
        index = camera_id(model, camera)
        rays = image_rays(camera_intrinsics(model, index, height, width))
        shares.append(share_seen(model, data, target, camera_pose(model, data, index), rays))
    return max(shares)


def share_seen(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    target: Bool[np.ndarray, "ngeom"],
    pose: np.ndarray,
    rays: RayBundles,
) -> float:
    """Pixels of a target over its pixels alone; 0 where it would not be seen.

    Args:
      model: The compiled model.
      data: Its state after `mj_forward`.
      target: A mask over its geoms.
      pose: `T_world_camera`, `(4, 4)`: x right, y down, z forward.
      rays: Through the pixels.
    """
    shown = visible_geoms(model)
    alone = cast_rays(model, data, pose, rays, shown=shown & target).geom_id
    count = int((alone >= 0).sum())
    if not count:
        return 0.0
    seen = cast_rays(model, data, pose, rays, shown=shown).geom_id
    return float(target[seen[seen >= 0]].sum()) / count
