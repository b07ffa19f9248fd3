"""Which objects the scene of an episode is made of."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec


@dataclass(frozen=True, eq=False)
class SceneObjects:
    """What a scene is compiled with.

    Attributes:
      assets: In the order that the task's factory expects.
      part: Name of the drawer or door that the task is about; None where there is none.
    """

    assets: tuple[Asset, ...]
    part: str | None = None

    @property
    def key(self) -> Hashable:
        """Scenes of one task with equal keys are the same."""
        return tuple(str(asset.folder) for asset in self.assets), self.part


Strata = tuple[tuple[EpisodeSpec, ...], ...]


class ObjectDraw(Protocol):
    """Draws the objects of an episode; the same generator and `spec` give the same objects."""

    def __call__(self, rng: np.random.RandomState, spec: EpisodeSpec) -> SceneObjects:
        """Raises InputError where `spec` asks for an object that there is not, or that cannot be used."""
        ...

    def strata(self) -> Strata:
        """What evaluations take equally often: groups, such as categories, of episodes about one object."""
        ...


# Made once for an environment; loads what its user chose.
ObjectDrawFactory = Callable[[EnvConfig], ObjectDraw]
