"""Straight ways out of a cavity behind a door: nothing comes out of it through its roof."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.poses import invert

# How far in front of the cavity the middle of what was in it must come [m].
_CLEAR = 0.17
_MARGIN = 0.02  # a point this far outside a cavity still counts as inside [m]


def outwards(part: PartEstimate) -> Float[np.ndarray, "3"]:
    """The open side of the part's cavity: an axis of the object frame."""
    direction = part.handle.rotation[:, 1] * [1.0, 1.0, 0.0]
    axis = int(np.argmax(np.abs(direction)))
    return np.eye(3)[axis] * np.sign(direction[axis])


def way_out(
    estimate: SceneEstimate, point_world: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3"] | None:
    """From a point in a cavity that stands still, straight out of it [m]; None if it is in none."""
    for part in estimate.parts.values():
        cavity = part.cavity
        if cavity is None or cavity.moves_with_part:
            continue
        point = (invert(part.base_pose) @ np.append(point_world, 1.0))[:3] - cavity.center
        if (np.abs(point) > cavity.extents / 2 + _MARGIN).any():
            continue
        direction = outwards(part)
        depth = float(cavity.extents @ np.abs(direction)) / 2 - float(point @ direction)
        return part.base_pose[:3, :3] @ direction * (depth + _CLEAR)
    return None
