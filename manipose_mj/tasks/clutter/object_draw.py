"""Draws the objects of which the pile of an episode is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.errors import InputError
from manipose_mj.tasks.clutter.pile_layout import rolls
from manipose_mj.tasks.core.candidates import Candidates, builtin, chosen, rigid_rows
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.scene_objects import ObjectDrawFactory, SceneObjects, Strata
from manipose_mj.tasks.scene.resting import require_graspable

SETS = 200  # of built-in objects, in each split; their piles are kept on disk
OBJECTS = 12  # in a set; a pile is made of some of them
LONGEST = 0.20  # side of an object; longer ones reach out of a pile [m]
# What lies flat, and holds up what lies on it.
_FLAT = (
    "box", "camera", "clock", "computer_mouse", "container", "drinkbox", "remote", "steel_tape", "tissue", "wallet",
)  # fmt: skip
_GRASPS = 6  # clear of the table, with which an object that lies alone is easily taken
_OFTEN = 0.5  # of an object's falls, after which it has to lie so


@dataclass(frozen=True)
class Mixture:
    """Attributes: flat: how many objects of a set are of categories that lie flat, at least; rolling: how many
    may roll, at most."""

    flat: int
    rolling: int = 3


class PileDraw:
    """One of some hundred sets of built-in objects, or objects of the user's."""

    def __init__(self, mixture: Mixture, env_config: EnvConfig) -> None:
        """Loads what the user chose."""
        self._mixture = mixture
        own = env_config.assets()
        split = env_config.split
        self._own = own is not None
        everything = builtin(split, rigid_rows(LONGEST)) if own is None else chosen(own)
        flat = builtin(split, [CATALOGUE[name] for name in _FLAT]) if own is None else []
        self._any = Candidates(everything, require_graspable if own else require_fit_for_piles)
        self._flat = Candidates(flat, require_fit_for_piles)
        self._sets: dict[int, tuple[Asset, ...]] = {}

    def __call__(self, rng: np.random.RandomState, spec: EpisodeSpec) -> SceneObjects:
        number = int(rng.randint(SETS))
        objects = self._set(number)
        if spec.object is not None and spec.object not in [asset.name for asset in objects]:
            objects = (*objects[:-1], self._any.draw(rng, spec.object))
        return SceneObjects(objects)

    def strata(self) -> Strata:
        """One: a set has objects of many categories."""
        return ((EpisodeSpec(),),)

    def _set(self, number: int) -> tuple[Asset, ...]:
        if number not in self._sets:
            self._sets[number] = self._drawn(np.random.RandomState(number))
        return self._sets[number]

    def _drawn(self, rng: np.random.RandomState) -> tuple[Asset, ...]:
        if self._own:
            return self._drawn_of_own(rng)
        found: list[Asset] = []
        while len(found) < OBJECTS:
            pool = self._flat if len(found) < self._mixture.flat else self._any
            asset = pool.draw(rng, without=[each.name for each in found])
            if not rolls(asset) or sum(map(rolls, found)) < self._mixture.rolling:
                found.append(asset)
        return tuple(found)

    def _drawn_of_own(self, rng: np.random.RandomState) -> tuple[Asset, ...]:
        usable = {name for names in self._any.usable().values() for name in names}
        names = [name for name in self._any.names if name in usable]
        if not names:
            self._any.draw(rng)  # says why
        chosen_names = sorted(rng.permutation(len(names))[:OBJECTS].tolist())
        return tuple(self._any.draw(rng, names[k]) for k in chosen_names)


def pile_of(mixture: Mixture) -> ObjectDrawFactory:
    """A draw of the objects of a pile."""

    def make(env_config: EnvConfig) -> PileDraw:
        return PileDraw(mixture, env_config)

    return make


def require_fit_for_piles(asset: Asset) -> None:
    """Raise `InputError` for what is too long for a pile, or seldom comes to lie where a hand can take it."""
    require_graspable(asset)
    longest = float(asset.label.extents.max())
    if longest > LONGEST:
        raise InputError(
            f"{asset.place}: is {1000 * longest:.0f} mm long; piles take up to "
            f"{1000 * LONGEST:.0f} mm"
        )
    assert asset.grasps is not None
    narrow = asset.grasps.widths < MAX_OPENING
    taken = asset.grasps.clear[narrow].astype(bool).sum(axis=0) >= _GRASPS
    share = sum(
        rest.probability for rest, can in zip(asset.stable_poses, taken, strict=True) if can
    )
    if share < _OFTEN:
        raise InputError(
            f"{asset.place}: mostly falls so that the gripper cannot take it off the table; "
            "piles take objects that it can"
        )
