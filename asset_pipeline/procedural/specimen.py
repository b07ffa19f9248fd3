"""What every generator of the catalogue returns, and the random numbers it draws from."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from manipose_mj.assets.asset import Area, MovingPart
from manipose_mj.assets.geometry import Body
from manipose_mj.assets.label import PoseLabel

_Choice = TypeVar("_Choice")
Colour = tuple[float, float, float, float]


@dataclass(frozen=True)
class Specimen:
    """One object of a category; z is up in its frame.

    Attributes:
      label: The pose label in the object frame.
      bodies: One for a rigid object; the base and its moving parts for an articulated one.
      parts: What `asset.json` says of the moving parts, in the order of `bodies[1:]`.
      areas: Where it is held and where it does its work.
    """

    label: PoseLabel
    bodies: tuple[Body, ...]
    parts: tuple[MovingPart, ...] = ()
    areas: tuple[Area, ...] = ()


def specimen_rng(category: str, index: int) -> np.random.Generator:
    """The generator of instance `index`: the same on every machine and in every process."""
    return np.random.default_rng([zlib.crc32(category.encode()), index])


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A size [m] or share, uniform over a range and rounded to the fourth decimal."""
    return round(float(rng.uniform(low, high)), 4)


def in_turn(index: int, choices: tuple[_Choice, ...]) -> _Choice:
    """The colours of instance `index`, so that neighbours differ; instance 0 has its own."""
    return choices[(index - 1) % len(choices)]


def mixed(index: int) -> int:
    """A number to take turns by where the choices are five: every fifth instance is a test object.

    Taken by the index, all test objects were of one style that no training object has.
    """
    return index + index // 5
