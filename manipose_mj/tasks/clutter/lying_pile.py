"""A pile where it lies on the table in one episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset
from manipose_mj.tasks.clutter.pile import Pile
from manipose_mj.tasks.core.start import PlacedObject


@dataclass(frozen=True)
class LyingPile:
    """A pile with its place.

    Attributes:
      pile: How its objects lie.
      assets: Of each of them.
      pose: `T_world_pile`.
      side: Of the table's middle line that it lies on, -1 or 1.
    """

    pile: Pile
    assets: tuple[Asset, ...]
    pose: Float[np.ndarray, "4 4"]
    side: float

    @property
    def poses(self) -> Float[np.ndarray, "n 4 4"]:
        """`T_world_object` of each object."""
        return self.pose @ self.pile.poses

    def name(self, index: int) -> str:
        """The asset's name of an object of the pile."""
        return self.assets[index].name

    def placed(self) -> tuple[PlacedObject, ...]:
        """Each object where it lies."""
        return tuple(
            PlacedObject(int(index), self.pose @ pose)
            for index, pose in zip(self.pile.objects, self.pile.poses, strict=True)
        )
