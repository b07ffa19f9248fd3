"""Draws the furniture of an episode, the part of it in question, and the objects that go with it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.assets.categories import CATALOGUE, Category, Split
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.tasks.articulated.cavity_placement import (
    hand_towards,
    ways_in_hand,
    ways_into,
    ways_stored,
)
from manipose_mj.tasks.articulated.hand_room import STRAIGHT
from manipose_mj.tasks.articulated.part_choice import PartChoice, possible_parts
from manipose_mj.tasks.core.candidates import Candidate, Candidates, builtin, chosen, rigid_rows
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.scene_objects import ObjectDrawFactory, SceneObjects, Strata
from manipose_mj.tasks.scene.resting import require_graspable

log = logging.getLogger(__name__)

_PIECES = 30  # that are looked at for one with a cavity that something fits


@dataclass(frozen=True)
class RequestedFurniture:
    """What a task with furniture is about.

    Attributes:
      categories: Of built-in furniture.
      choice: Of the parts.
      stored: Categories of built-in objects that are stored; None: every rigid one.
      own: Categories of a user's furniture that are preferred; pieces of others serve where none of these has such a
        part. Empty: all alike.
    """

    categories: tuple[str, ...]
    choice: PartChoice
    stored: tuple[str, ...] | None = None
    own: tuple[str, ...] = ()


class FurnitureDraw:
    """A piece of furniture and a part of it."""

    def __init__(
        self, requested: RequestedFurniture, env_config: EnvConfig, *, hollow: bool
    ) -> None:
        """Loads what the user chose; of that, furniture of any layout takes the place of the built-in pieces."""
        own = _own(env_config, rigid=False)
        choice = replace(requested.choice, any_layout=bool(own))
        rows = [CATALOGUE[name] for name in requested.categories]
        pool = own or builtin(env_config.split, rows)
        self._parts = partial(possible_parts, choice=choice, hollow=hollow)
        self._named = Candidates(pool, self._parts)
        preferred = [each for each in own if each.category in requested.own]
        if preferred and Candidates(preferred, self._parts).usable():
            pool = preferred
        elif requested.own and own and self._named.usable():
            log.warning(
                "%s: no %s has a part for it; it draws from all furniture that was chosen",
                env_config.task,
                " or ".join(requested.own),
            )
        self.pieces = Candidates(pool, self._parts)
        self._pool = pool
        self._with_part: dict[str, Candidates] = {}  # by the part's name

    def draw(self, rng: np.random.RandomState, spec: EpisodeSpec) -> tuple[Asset, MovingPart]:
        """Raises InputError where no piece has such a part, or none of the names asked for."""
        if spec.furniture is not None:
            asset = self._named.draw(rng, spec.furniture)
        elif spec.part is not None:
            asset = self._piece_with(rng, spec.part)
        else:
            asset = self.pieces.draw(rng)
        if spec.part is not None:
            return asset, self._part(asset, spec.part)
        possible = self._parts(asset)
        return asset, possible[rng.randint(len(possible))]

    def _piece_with(self, rng: np.random.RandomState, name: str) -> Asset:
        """A piece that has a possible part of a name."""
        check = partial(self._part, name=name)
        candidates = self._with_part.setdefault(name, Candidates(self._pool, check))
        try:
            return candidates.draw(rng)
        except InputError:
            there = {str(spec.part) for group in self.strata() for spec in group}
            if not there or name in there:
                raise
            raise unknown_name("part", name, there) from None

    def _part(self, asset: Asset, name: str) -> MovingPart:
        """The possible part of an asset that has this name."""
        possible = {part.name: part for part in self._parts(asset)}
        if name in possible:
            return possible[name]
        if all(part.name != name for part in asset.parts):
            raise unknown_name(f"part of {asset.name}", name, possible)
        raise InputError(
            f"{asset.place}: this task is about {', '.join(possible)}; part {name!r} is none of them"
        )

    def strata(self) -> Strata:
        """Pieces, each with its parts."""
        names = [name for group in self.pieces.usable().values() for name in group]
        unused = np.random.RandomState(0)  # nothing is drawn where a name is given
        return tuple(
            tuple(
                EpisodeSpec(furniture=name, part=part.name)
                for part in self._parts(self.pieces.draw(unused, name))
            )
            for name in names
        )


class PieceDraw(FurnitureDraw):
    """For tasks that move a part and need nothing else."""

    def __call__(self, rng: np.random.RandomState, spec: EpisodeSpec) -> SceneObjects:
        asset, part = self.draw(rng, spec)
        return SceneObjects((asset,), part.name)


def furniture_alone(requested: RequestedFurniture) -> ObjectDrawFactory:
    """A draw for tasks that move a part and need nothing else; it skips rigid assets, unless there are no others."""

    def make(env_config: EnvConfig) -> PieceDraw:
        assets = env_config.assets() or ()
        if assets and all(asset.kind != "articulated" for asset in assets):
            raise InputError(
                f"{assets[0].place}: is a {assets[0].kind} asset; tasks that open or close take articulated ones"
            )
        return PieceDraw(requested, env_config, hollow=False)

    return make


class CavityDraw:
    """A piece, a part that shuts a cavity, an object for it, and others that fit as well."""

    def __init__(
        self, requested: RequestedFurniture, env_config: EnvConfig, *, taken: bool, fillers: int
    ) -> None:
        self._furniture = FurnitureDraw(requested, env_config, hollow=True)
        self._own = _own(env_config, rigid=True)
        self._stored = requested.stored
        self._split: Split = env_config.split
        self._taken, self._fillers = taken, fillers
        # By folder, part and whether the hand has to come straight: the object in question, and those that may lie
        # beside it.
        self._fitting: dict[tuple[str, str, bool], tuple[Candidates, Candidates]] = {}

    def __call__(self, rng: np.random.RandomState, spec: EpisodeSpec) -> SceneObjects:
        """Objects to which the hand comes straight; tilted, where there are no others among those that are asked for."""
        try:
            return self._drawn(rng, spec, straight=True)
        except InputError:
            return self._drawn(rng, spec, straight=False)

    def _drawn(
        self, rng: np.random.RandomState, spec: EpisodeSpec, *, straight: bool
    ) -> SceneObjects:
        for attempt in range(1, _PIECES + 1):
            asset, part = self._furniture.draw(rng, spec)
            subjects, others = self._candidates(asset, part, straight)
            try:
                objects = [subjects.draw(rng, spec.object)]
            except InputError:
                if spec.furniture is not None or attempt == _PIECES:
                    raise
                continue
            for _ in range(self._fillers):
                names = [each.name for each in objects]
                try:
                    objects.append(others.draw(rng, without=names))
                except InputError:  # scenes of one task have equally many objects
                    objects.append(objects[0])
            return SceneObjects((asset, *objects), part.name)
        raise AssertionError

    def strata(self) -> Strata:
        """Pieces, each with its parts behind which something fits."""
        for straight in (True, False):
            groups = []
            for group in self._furniture.strata():
                fitting = [spec for spec in group if self._fits_something(spec, straight)]
                groups += [tuple(fitting)] if fitting else []
            if groups:
                return tuple(groups)
        return ()

    def _fits_something(self, spec: EpisodeSpec, straight: bool) -> bool:
        try:
            self._drawn(np.random.RandomState(0), spec, straight=straight)
        except InputError:
            return False
        return True

    def _candidates(
        self, asset: Asset, part: MovingPart, straight: bool
    ) -> tuple[Candidates, Candidates]:
        key = str(asset.folder), part.name, straight
        if key not in self._fitting:
            assert part.cavity is not None
            pool = self._own or _shorter_than(
                float(np.linalg.norm(part.cavity.extents)), self._split, self._stored
            )
            own_check = partial(_subject, part=part, taken=self._taken, straight=straight)
            beside = partial(ways_into, part=part)
            self._fitting[key] = Candidates(pool, own_check), Candidates(pool, beside)
        return self._fitting[key]


def with_cavity(requested: RequestedFurniture, *, taken: bool, fillers: int) -> ObjectDrawFactory:
    """A draw for tasks that store objects or take them out.

    Args:
      requested: The furniture, its parts, and what is stored.
      taken: Whether the object is taken out.
      fillers: How many others there are.
    """

    def make(env_config: EnvConfig) -> CavityDraw:
        return CavityDraw(requested, env_config, taken=taken, fillers=fillers)

    return make


def _subject(asset: Asset, *, part: MovingPart, taken: bool, straight: bool) -> None:
    require_graspable(asset)
    if straight and hand_towards(asset, part) != STRAIGHT:
        raise InputError(f"part {part.name!r}: the hand comes to {asset.name} tilted only")
    (ways_in_hand if taken else ways_stored)(asset, part)


def _shorter_than(
    longest: float, split: Split, categories: Sequence[str] | None
) -> list[Candidate]:
    rows: Sequence[Category] = rigid_rows(longest)
    if categories is not None:
        rows = [CATALOGUE[name] for name in categories]
    return builtin(split, rows)


def _own(env_config: EnvConfig, *, rigid: bool) -> list[Candidate]:
    """The user's rigid objects, or their furniture; empty where none of that kind is named."""
    kind = "rigid" if rigid else "articulated"
    return chosen(asset for asset in env_config.assets() or () if asset.kind == kind)
