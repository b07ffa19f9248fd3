"""Gymnasium spaces that say what dm_env's specifications say."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from dm_env import specs
from gymnasium import spaces
from jaxtyping import Float

# Beyond all numbers of a simulation that has not diverged; learners and checkers want boxes to end somewhere.
FAR = 1e6


def observation_space(observations: Mapping[str, specs.Array]) -> spaces.Dict:
    """A dictionary of boxes, by the observations' flat names such as `panda/joint_positions`."""
    return spaces.Dict({name: box(spec) for name, spec in observations.items()})


def box(spec: specs.Array) -> spaces.Box:
    """A box of the array's shape, type and limits; without limits, of the type's, or of what no scene reaches."""
    dtype = np.dtype(spec.dtype)
    if isinstance(spec, specs.BoundedArray):
        low, high = np.clip(spec.minimum, -FAR, FAR), np.clip(spec.maximum, -FAR, FAR)
    elif np.issubdtype(dtype, np.floating):
        low, high = -FAR, FAR
    elif dtype == np.bool_:
        low, high = False, True
    else:
        low, high = np.iinfo(dtype).min, np.iinfo(dtype).max
    shape = tuple(spec.shape)
    return spaces.Box(
        np.broadcast_to(low, shape).astype(dtype),
        np.broadcast_to(high, shape).astype(dtype),
        shape,
        dtype.type,
    )


def action_box(spec: specs.BoundedArray) -> spaces.Box:
    """The actions as float32, which learners use, with limits rounded inwards."""
    low, high = _inwards(spec.minimum, 1.0), _inwards(spec.maximum, -1.0)
    return spaces.Box(low, high, tuple(spec.shape), np.float32)


def _inwards(limit: Float[np.ndarray, "n"], inside: float) -> Float[np.ndarray, "n"]:
    rounded = np.asarray(limit, np.float32)
    outside = (rounded - limit) * inside < 0
    return np.where(outside, np.nextafter(rounded, np.float32(inside * np.inf)), rounded)
