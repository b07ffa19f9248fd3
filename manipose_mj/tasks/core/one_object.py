"""Episodes that are about one rigid object of all that there are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from manipose_mj.assets.categories import Category
from manipose_mj.tasks.core.candidates import Candidates, Check, builtin, chosen
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.scene_objects import ObjectDrawFactory, SceneObjects, Strata


@dataclass(frozen=True)
class OneObject:
    """Attributes: candidates: of which each episode is about one."""

    candidates: Candidates

    def __call__(self, rng: np.random.RandomState, spec: EpisodeSpec) -> SceneObjects:
        return SceneObjects((self.candidates.draw(rng, spec.object),))

    def strata(self) -> Strata:
        groups = self.candidates.usable().values()
        return tuple(tuple(EpisodeSpec(object=name) for name in group) for group in groups)


def one_object(check: Check, rows: Iterable[Category]) -> ObjectDrawFactory:
    """A draw of one object: of the user's, or of all that are built in.

    Args:
      check: Raises `InputError` for an object that the task cannot use.
      rows: The categories of built-in objects.
    """
    rows = tuple(rows)

    def make(env_config: EnvConfig) -> OneObject:
        own = env_config.assets()
        pool = builtin(env_config.split, rows) if own is None else chosen(own)
        return OneObject(Candidates(pool, check))

    return make
