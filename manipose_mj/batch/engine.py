"""What physics engines of batched worlds have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.batch.measurement import Measurement
from manipose_mj.poses import Array

Physics = (
    Any  # a tree of arrays with a leading axis of worlds; what is in it is the engine's business
)


class Engine(Protocol):
    """Steps many worlds; pure functions, for `jax.jit` and `jax.lax.scan`.

    Attributes:
      name: As users write it.
    """

    name: str

    def starts(self) -> Physics:
        """The simulations of all starts of the pool, one after the other."""
        ...

    def advance(
        self,
        physics: Physics,
        rows: Int[Array, " worlds"],
        targets: Float[Array, "worlds substeps 8"],
    ) -> tuple[Physics, Bool[Array, " worlds"], Measurement]:
        """One control step of all worlds.

        Args:
          physics: Of the worlds.
          rows: Of the starts that they began with.
          targets: Of the servos in each physics step: joint angles [rad] and the opening [m].

        Returns:
          The simulations after it, which of them diverged, and measurements of all.
        """
        ...

    def overflowed(self, physics: Physics) -> Bool[Array, " worlds"]:
        """Whether there was too little room for a world's contacts or constraints since its start."""
        ...

    def renderer(
        self, cameras: tuple[str, ...], height: int, width: int, rgb: bool
    ) -> Callable[[Physics, Int[Array, " worlds"]], tuple[Array, Array, Array | None]]:
        """What renders cameras: of the simulations and their starts, depth, geoms and colours of all pixels.

        Raises:
          InputError: The engine cannot.
        """
        ...

    def scene_geoms(self, row: int) -> Int[np.ndarray, " geoms"]:
        """For the geoms that a renderer names, those of the scene of a start; -1: none."""
        ...

    def close(self) -> None:
        """Free what the engine holds; it cannot be used afterwards."""
        ...
