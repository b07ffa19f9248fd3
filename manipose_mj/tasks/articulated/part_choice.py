"""Which drawers or doors of a piece of furniture a task may be about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.errors import InputError, unknown_name

PartKind = Literal["drawer", "door", "flap", "sliding door"]
Level = Literal["top", "middle", "bottom"]
# A drawer comes out as its handle does: the cosine between the two. A sliding door's is 0.
_COMES_OUT = 0.3
_ONE_ROW = 0.03  # handles whose heights differ by less are at one level [m]
# How many rows of a kind there must be for a level to mean something.
_LEAST: dict[Level, int] = {"top": 1, "middle": 3, "bottom": 1}


@dataclass(frozen=True)
class PartChoice:
    """What to look for.

    Attributes:
      kinds: What it may be, the best first: a drawer slides, a door turns about the vertical, a flap
        about a level axis. No task is about a sliding door, which slides along its own front.
      level: Which rows of those, by the height of their handles; None: all.
      any_layout: Whether the middle of one or two rows means something too: the upper one.
    """

    kinds: tuple[PartKind, ...]
    level: Level | None = None
    any_layout: bool = False

    @property
    def least_rows(self) -> int:
        """How many rows of a kind a piece must have."""
        return 1 if self.level is None or self.any_layout else _LEAST[self.level]

    def __str__(self) -> str:
        what = " or ".join(self.kinds)
        return what if self.level is None else f"{self.level} {what}"


def kind_of(part: MovingPart) -> PartKind:
    """Drawer, door or flap, by the part's joint; a sliding door, where it slides across its handle's way out."""
    if part.joint.kind == "slide":
        handle = part.handle
        aside = handle is not None and abs(handle.rotation[:, 1] @ part.joint.axis) < _COMES_OUT
        return "sliding door" if aside else "drawer"
    return "door" if abs(part.joint.axis[2]) > 0.7 else "flap"


def possible_parts(asset: Asset, choice: PartChoice, *, hollow: bool) -> tuple[MovingPart, ...]:
    """The parts of an asset that a task may be about: all of the best kind that it has, at the level asked for.

    Args:
      asset: An articulated one.
      choice: What to look for.
      hollow: Whether they must give access to a cavity.

    Raises:
      InputError: There is none, or none has a handle or a cavity.
    """
    if asset.kind != "articulated":
        raise InputError(f"{asset.place}: is a {asset.kind} asset; expected an articulated one")
    known = ", ".join(f"{p.name} ({kind_of(p)})" for p in asset.parts) or "none"
    handled = [part for part in asset.parts if part.handle is not None]
    for kind in choice.kinds:
        rows = rows_of([part for part in handled if kind_of(part) == kind])
        if len(rows) < choice.least_rows:
            continue
        found = _at_level(rows, choice.level)
        if not hollow:
            return found
        parts = tuple(part for part in found if part.cavity is not None)
        if not parts:
            names = ", ".join(repr(part.name) for part in found)
            raise InputError(
                f"{asset.place}: part {names} opens no cavity; this task needs one to hold things"
            )
        return parts
    raise InputError(f"{asset.place}: has no {choice} with a handle; its parts: {known}")


def named_part(asset: Asset, name: str) -> MovingPart:
    """The part of an asset that has this name.

    Raises:
      InputError: There is none; the nearest names are offered.
    """
    parts = {part.name: part for part in asset.parts}
    if name not in parts:
        raise unknown_name(f"part of {asset.name}", name, parts)
    return parts[name]


def rows_of(parts: list[MovingPart]) -> list[list[MovingPart]]:
    """Parts side by side, with handles of one height, from the lowest row to the highest."""
    rows: list[list[MovingPart]] = []
    for part in sorted(parts, key=_handle_height):
        if rows and _handle_height(part) - _handle_height(rows[-1][0]) < _ONE_ROW:
            rows[-1].append(part)
        else:
            rows.append([part])
    return rows


def _at_level(rows: list[list[MovingPart]], level: Level | None) -> tuple[MovingPart, ...]:
    if level is None:
        return tuple(part for row in rows for part in row)
    return tuple(rows[{"bottom": 0, "middle": len(rows) // 2, "top": -1}[level]])


def _handle_height(part: MovingPart) -> float:
    assert part.handle is not None
    return float(part.handle.origin[2])
