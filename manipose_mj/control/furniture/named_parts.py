"""Parts as an instruction calls them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.furniture.other_kind import as_door, as_drawer
from manipose_mj.control.furniture.part_words import Candidate, meant_part
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.failures import StageFailure

_SURE_PART = 0.15  # confidence of parts that nobody asked for


def named(
    model: FurnitureModel, asked: Mapping[str, str], expected_open: frozenset[str]
) -> FurnitureModel:
    """The parts that words mean called as goals call them; others only where they are sure.

    Args:
      model: With parts of any names.
      asked: Words for parts, by the names that goals have.
      expected_open: Of these names, those of parts that stand open.

    Raises:
      StageFailure: There is none.
    """
    parts = list(model.parts)
    body = (float(model.solid[:, 0, 2].min()), float(model.solid[:, 1, 2].max()))
    for name, words in asked.items():
        free = [i for i, part in enumerate(parts) if part.name not in asked]
        opened = [i for i in free if parts[i].opening > 0]
        # What shall be shut stands open.
        free = opened if name in expected_open and opened else free
        candidates = [_candidate(parts[i]) for i in free]
        index = meant_part(words, candidates, model.category, body)
        if index is None:
            raise StageFailure("perception", f"no camera shows the {words} of the {model.category}")
        chosen = parts[free[index]]
        if "drawer" not in words.split():
            chosen = as_door(chosen, model.category, float(model.solid[:, 0, 0].min()))
        elif chosen.hinged:
            chosen = as_drawer(chosen)
        parts[free[index]] = replace(chosen, part=replace(chosen.part, name=name))
    kept = [part for part in parts if part.name in asked or part.confidence >= _SURE_PART]
    return replace(model, parts=tuple(kept))


def _candidate(part: PartModel) -> Candidate:
    """How words see it: a drawer is wide, with its handle in the middle; a door is high, with its near an edge."""
    low, high = part.panel[:, 1]
    middle = abs(float(handle_of(part).origin[1]) - (low + high) / 2) / max(high - low, 0.01)
    _, width, height = np.maximum(part.panel[1] - part.panel[0], 0.01)
    upright, length = float(height / (height + width)), float(handle_of(part).extents[0])
    return Candidate(part.part, part.confidence, 2 * middle, upright, length)


def handle_of(part: PartModel) -> PoseLabel:
    """Of a part that was found by it."""
    assert part.part.handle is not None
    return part.part.handle
