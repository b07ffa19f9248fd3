"""Which drawer or door of a piece of furniture a task is about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.errors import InputError

PartKind = Literal["drawer", "door", "flap"]
Level = Literal["top", "middle", "bottom"]
# How many parts of a kind there must be for a level to mean something.
_LEAST: dict[Level, int] = {"top": 1, "middle": 3, "bottom": 1}


@dataclass(frozen=True)
class PartChoice:
    """What to look for.

    Attributes:
      kinds: What it may be, the best first: a drawer slides, a door turns about the vertical, a flap
        about a level axis.
      level: Which of those, by the height of their handles; None: the one with the largest cavity.
    """

    kinds: tuple[PartKind, ...]
    level: Level | None = None

    def __str__(self) -> str:
        what = " or ".join(self.kinds)
        return what if self.level is None else f"{self.level} {what}"


def kind_of(part: MovingPart) -> PartKind:
    """Drawer, door or flap, by the part's joint."""
    if part.joint.kind == "slide":
        return "drawer"
    return "door" if abs(part.joint.axis[2]) > 0.7 else "flap"


def choose_part(asset: Asset, choice: PartChoice, *, hollow: bool) -> MovingPart:
    """The part of an asset that a task asks for.

    Args:
      asset: An articulated one.
      choice: What to look for.
      hollow: Whether it must give access to a cavity.

    Raises:
      InputError: There is none, or it has no handle or no cavity.
    """
    if asset.kind != "articulated":
        raise InputError(f"{asset.folder}: is a {asset.kind} asset; expected an articulated one")
    known = ", ".join(f"{p.name} ({kind_of(p)})" for p in asset.parts) or "none"
    handled = [part for part in asset.parts if part.handle is not None]
    for kind in choice.kinds:
        found = [part for part in handled if kind_of(part) == kind]
        if len(found) < (1 if choice.level is None else _LEAST[choice.level]):
            continue
        part = _pick(found, choice.level)
        if hollow and part.cavity is None:
            raise InputError(
                f"{asset.folder}: part {part.name!r} opens no cavity; this task needs one to hold things"
            )
        return part
    raise InputError(f"{asset.folder}: has no {choice} with a handle; its parts: {known}")


def _pick(found: list[MovingPart], level: Level | None) -> MovingPart:
    if level is None:
        return max(found, key=_room)
    upward = sorted(found, key=_handle_height)
    return upward[{"bottom": 0, "middle": len(upward) // 2, "top": -1}[level]]


def _room(part: MovingPart) -> float:
    return 0.0 if part.cavity is None else float(np.prod(part.cavity.extents))


def _handle_height(part: MovingPart) -> float:
    assert part.handle is not None
    return float(part.handle.origin[2])
