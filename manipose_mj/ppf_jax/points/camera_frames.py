"""Where calibrated cameras are, checked before their clouds are put together."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError

_ORTHONORMAL, _LAST_ROW = 1e-3, 1e-6  # how far a frame may be from a rigid transform


def checked_frames(
    T_common_camera: Float[np.ndarray, "v 4 4"], count: int
) -> Float[np.ndarray, "v 4 4"]:
    """The frames of `count` cameras in their common one [m], as float64.

    Raises:
      InputError: There are none, not one for each cloud, or one is no rigid transform; it is named by its number.
    """
    try:
        frames = np.asarray(T_common_camera, float)
    except (TypeError, ValueError):
        raise InputError(
            "camera frames are not made of numbers; expected (cameras, 4, 4)"
        ) from None
    if count == 0 or frames.shape != (count, 4, 4):
        raise InputError(
            f"{count} clouds and camera frames of shape {frames.shape}; expected one or more, "
            "and a 4x4 frame each"
        )
    for number, frame in enumerate(frames):
        if not _is_rigid(frame):
            raise InputError(f"camera frame {number} is no rigid transform")
    return frames


def _is_rigid(frame: Float[np.ndarray, "4 4"]) -> bool:
    rotation = frame[:3, :3]
    if not np.isfinite(frame).all() or np.abs(frame[3] - (0, 0, 0, 1)).max() > _LAST_ROW:
        return False
    orthonormal = np.allclose(rotation @ rotation.T, np.eye(3), atol=_ORTHONORMAL)
    return orthonormal and np.linalg.det(rotation) > 0
