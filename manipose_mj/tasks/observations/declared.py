"""Observables that declare shape, type and bounds, and are blank until an episode begins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable
from dm_env import specs

Read = Callable[[mjcf.Physics], Any]


class Declared(observable.Generic):
    """What `read` gives, as an array of the declared shape and type."""

    def __init__(self, spec: specs.Array, read: Read, started: Callable[[], bool]) -> None:
        """Declares it.

        Args:
          spec: Shape, type, and bounds where there are some; zeros must be within them.
          read: Called with the physics.
          started: Whether there is an episode to observe. composer reads all observables
            once before the first, when no object has a place and no goal is drawn.
        """
        self._spec = spec
        blank = np.zeros(spec.shape, spec.dtype)
        spec.validate(blank)

        def value(physics: mjcf.Physics) -> np.ndarray:
            return np.asarray(read(physics), spec.dtype) if started() else blank

        super().__init__(value)

    @property
    def array_spec(self) -> specs.Array:
        return self._spec


def unbounded(shape: tuple[int, ...], dtype: type = np.float64) -> specs.Array:
    """The specification of an array of any finite values."""
    return specs.Array(shape, dtype)


def bounded(
    shape: tuple[int, ...], dtype: type, minimum: float, maximum: float
) -> specs.BoundedArray:
    """The specification of an array of values within limits, both included."""
    return specs.BoundedArray(shape, dtype, minimum, maximum)
