"""Which of the parts that were found is meant by words such as `top left drawer`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from manipose_mj.assets.asset import MovingPart
from manipose_mj.control.furniture.fit.door_hinge import WITH_KNOBS
from manipose_mj.tasks.articulated.part_choice import kind_of, rows_of
from manipose_mj.tasks.instructions.names import ORDINALS, part_words_among

_OTHER_KIND = 1.5  # what a wrong kind costs, in places
_LOOKS = 1.0  # and a handle that is where the other kind has it
_SHAPE = 2.0  # and a front that is as high, or as wide, as the other kind's
_UNSURE = 1.0  # what no confidence costs, in places
_LEAST = (0.25, 0.1, 0.0)  # confidence of those that words are first compared with, and then
_FITS = 1.0  # places off, below which words fit
_SHARE = 2.0  # how many places the whole height, or width, counts for
# Of ovens: what it costs to be a knob, to slide, to be below, and to be short beside another bar, in places; handles
# that are no shorter are bars [m].
_KNOB, _SLIDES, _BELOW, _SHORT, _BAR = 1.5, 0.3, 1.0, 1.5, 0.06
_WIDE_BAR = 0.3  # no row of knobs seems to be as wide [m]
_MUCH_SHORTER = 0.35  # share of a wide bar, up to which handles beside it are knobs


@dataclass(frozen=True)
class Candidate:
    """A part that was found. Attributes: part; confidence; beside: how far its handle is from its panel's middle, of
    half its width; upright: the height of its panel, of height and width together; length: of its handle [m]."""

    part: MovingPart
    confidence: float
    beside: float = 0.5
    upright: float = 0.5
    length: float = 0.1


def meant_part(
    words: str,
    candidates: Sequence[Candidate],
    category: str = "",
    body: tuple[float, float] | None = None,
) -> int | None:
    """Index of the part that words mean; None where there is none.

    One that would be called so itself, or else the one that comes nearest: a part may have been missed,
    another may be none.

    Args:
      words: As of `part_words`.
      candidates: Of one piece of furniture.
      category: Of it.
      body: How low and how high it reaches, as the candidates' handles are told [m]. The middle one of a column is nearest
        to its middle, where others were missed.
    """
    bars = _bars_of(candidates) if category in WITH_KNOBS else []
    if bars and len(bars) < len(candidates):
        index = meant_part(words, [candidates[i] for i in bars], category, body)
        return None if index is None else bars[index]
    the_oven_door = category == "oven" and words == "door"
    for least in _LEAST[-1:] if the_oven_door else _LEAST:
        chosen = [i for i, candidate in enumerate(candidates) if candidate.confidence >= least]
        parts = [candidates[i].part for i in chosen]
        costs = [
            (
                _oven_cost([candidates[k] for k in chosen], candidates[i])
                if the_oven_door
                else _cost(words, parts, candidates[i], body)
            )
            + _UNSURE * (1 - candidates[i].confidence)
            for i in chosen
        ]
        if costs and (min(costs) < _FITS or least == _LEAST[-1]):
            return chosen[int(np.argmin(costs))]
    return None


def _bars_of(candidates: Sequence[Candidate]) -> list[int]:
    """Indices of what is no knob, nor a few in a row, where a bar is wide: beside it these are shorter by far. None where no bar is."""
    longest = max((candidate.length for candidate in candidates), default=0.0)
    if longest < _WIDE_BAR:
        return []
    return [i for i, each in enumerate(candidates) if each.length > _MUCH_SHORTER * longest]


def _cost(
    words: str,
    parts: Sequence[MovingPart],
    candidate: Candidate,
    body: tuple[float, float] | None,
) -> float:
    """How far a part is from what words say, in places."""
    part = candidate.part
    noun = "drawer" if "drawer" in words.split() else "door"
    wrong = (kind_of(part) == "drawer") != (noun == "drawer")
    alike = [p for p in parts if (kind_of(p) == "drawer") == (noun == "drawer")] or list(parts)
    if wrong:
        alike = [*alike, part]
    elif part_words_among(alike, part) == words:
        return 0.0
    rows = rows_of(alike)
    row = next(i for i, each in enumerate(rows) if any(p is part for p in each))
    heights = [float(_handle(p)[2]) for p in alike]
    height = float(_handle(part)[2])
    row_cost = _place_cost(
        words, ("bottom", "middle", "top"), row, len(rows), height, heights, body
    )
    beside = sorted(rows[row], key=lambda p: -_from_right(p))
    column = next(i for i, p in enumerate(beside) if p is part)
    across = [_from_left(p) for p in alike]
    column_cost = _place_cost(
        words, ("left", "middle", "right"), column, len(beside), _from_left(part), across
    )
    # What a part is taken for may be wrong; where its handle is, and its shape, say as much.
    looks, shape = candidate.beside, candidate.upright
    if noun == "door":
        looks, shape = 1 - looks, 1 - shape
    return wrong * (_OTHER_KIND + _LOOKS * looks + _SHAPE * shape) + row_cost + column_cost


def _oven_cost(candidates: Sequence[Candidate], candidate: Candidate) -> float:
    """How far a part is from the only door of an oven, in places.

    That has a bar, above what is kept below it; knobs are no handles, nor are a few of them in a row, which seem to be a
    shorter bar. A wide, low front says nothing.
    """
    bars = [float(_handle(each.part)[2]) for each in candidates if each.length >= _BAR]
    longest = max(each.length for each in candidates)
    slides = _SLIDES * (candidate.part.joint.kind == "slide")
    if candidate.length < _BAR:
        return _KNOB + slides
    low, high = min(bars), max(bars)
    above = (float(_handle(candidate.part)[2]) - low) / (high - low) if high > low else 1.0
    return slides + _BELOW * (1 - above) + _SHORT * (1 - candidate.length / longest)


def _place_cost(
    words: str,
    names: tuple[str, str, str],
    index: int,
    count: int,
    place: float,
    places: list[float],
    body: tuple[float, float] | None = None,
) -> float:
    """How far a part's place along one direction is from the one that words name."""
    said = words.split()
    first, middle, last = names
    if f"from the {first}" in words:
        ordinal = next((k for k, name in enumerate(ORDINALS) if name in said), 0)
        return abs(index - ordinal)
    named = [name for name in said if name in (first, last)]
    if not named and middle not in said:
        return 0.0
    low, high = min(places), max(places)
    share = (place - low) / (high - low) if high - low > 0.02 else 0.5
    if named:
        return _SHARE * (share if named[0] == first else 1 - share)
    # The middle of one direction only, where the other has its own word or one place.
    off = _SHARE * abs(index - (count - 1) / 2) / max(count, 1)
    if body is not None and count % 2 == 0:  # one was missed: which of two it is, the body tells
        off += abs(place - sum(body) / 2) / (body[1] - body[0])
    return off


def _handle(part: MovingPart) -> np.ndarray:
    assert part.handle is not None
    return part.handle.origin


def _from_left(part: MovingPart) -> float:
    assert part.handle is not None
    forwards = -part.handle.rotation[:, 1]
    return float(part.handle.origin @ np.cross(forwards, np.array([0.0, 0.0, 1.0])))


def _from_right(part: MovingPart) -> float:
    return -_from_left(part)
