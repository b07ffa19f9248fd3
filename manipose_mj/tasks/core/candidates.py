"""The objects that episodes are drawn from: built-in ones of a split, or those of the user."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import CATALOGUE, Category, Split
from manipose_mj.errors import InputError, unknown_name

log = logging.getLogger(__name__)

_DRAWS = 400  # of one object, before there is none that can be used
Check = Callable[[Asset], object]  # raises InputError where an object cannot be used


@dataclass(frozen=True)
class Candidate:
    """Attributes: name: of the asset; category: of it; load: reads it, and builds it at the first use."""

    name: str
    category: str
    load: Callable[[], Asset]


class Candidates:
    """Objects to draw from, each category as likely as any other, and within it each object.

    What was refused once is not looked at again; that changes no draw.
    """

    def __init__(self, candidates: Iterable[Candidate], check: Check) -> None:
        """Loads nothing.

        Args:
          candidates: To draw from.
          check: Raises `InputError` for an object that the task cannot use.
        """
        self._check = check
        self._refusals: dict[str, InputError | None] = {}
        self._by_name = {candidate.name: candidate for candidate in candidates}
        groups: dict[str, list[Candidate]] = {}
        for candidate in self._by_name.values():
            groups.setdefault(candidate.category, []).append(candidate)
        self._groups = tuple(tuple(group) for group in groups.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Of all, whether they can be used or not."""
        return tuple(self._by_name)

    def draw(
        self, rng: np.random.RandomState, name: str | None = None, *, without: Sequence[str] = ()
    ) -> Asset:
        """An object that can be used.

        Args:
          rng: Draws, unless a name is given.
          name: Of the object it shall be; None: any.
          without: Names that it must not have.

        Raises:
          InputError: There is no such object, or none that can be used; it says why.
        """
        if name is not None:
            if name not in self._by_name:
                raise unknown_name("object", name, self._by_name)
            return self._usable(self._by_name[name])
        if not self._groups:
            raise InputError("there are no objects to draw from")
        refusal: InputError | None = None
        refused: set[str] = set()  # in this draw: what others found out shall not end it sooner
        for _ in range(_DRAWS):
            group = self._groups[rng.randint(len(self._groups))]
            candidate = group[rng.randint(len(group))]
            if candidate.name in without:
                continue
            try:
                return self._usable(candidate)
            except InputError as error:
                refusal = error
                refused.add(candidate.name)
                if len(refused) == len(self._by_name):
                    break
        said = refusal or f"there are no objects besides {', '.join(without)}"
        raise InputError(str(said)) from None

    def usable(self) -> dict[str, tuple[str, ...]]:
        """The names of those that can be used, by category; loads all."""
        found: dict[str, list[str]] = {}
        for group in self._groups:
            for candidate in group:
                try:
                    self._usable(candidate)
                except InputError:
                    continue
                found.setdefault(candidate.category, []).append(candidate.name)
        return {category: tuple(names) for category, names in found.items()}

    def _usable(self, candidate: Candidate) -> Asset:
        known = candidate.name in self._refusals
        refusal = self._refusals.get(candidate.name)
        if refusal is not None:
            raise InputError(str(refusal))  # one raised again and again would keep every traceback
        asset = candidate.load()
        if not known:
            try:
                self._check(asset)
                self._refusals[candidate.name] = None
            except InputError as error:
                log.info("not drawn: %s", error)
                self._refusals[candidate.name] = error
                raise
        return asset


def builtin(split: Split, rows: Iterable[Category]) -> list[Candidate]:
    """The built-in objects of some categories in a split."""
    return [
        Candidate(row.instance(index), row.name, partial(catalogue.load, row.name, index))
        for row in rows
        for index in range(row.instances)
        if row.split(index) == split
    ]


def chosen(assets: Iterable[Asset]) -> list[Candidate]:
    """The objects that a user named."""
    return [Candidate(asset.name, asset.category, partial(_itself, asset)) for asset in assets]


def _itself(asset: Asset) -> Asset:
    return asset


def rigid_rows(longest: float = np.inf) -> tuple[Category, ...]:
    """The rigid categories of which some objects are shorter than `longest` [m]."""
    return tuple(
        row
        for row in CATALOGUE.values()
        if row.object_type != "articulated" and row.size[0] < longest
    )
