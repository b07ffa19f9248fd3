"""Boxes along the axes of a frame: low and high corner, `(n, 2, 3)` [m]."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

Boxes = Float[np.ndarray, "_ 2 3"]
_THIN = 0.002  # what is no thicker is left out [m]


def no_boxes() -> Boxes:
    """None at all."""
    return np.zeros((0, 2, 3))


def without(boxes: Boxes, hole: Float[np.ndarray, "2 3"]) -> Boxes:
    """What is left of boxes where there is a hole, in boxes."""
    left = []
    for box in boxes:
        low, high = np.maximum(box[0], hole[0]), np.minimum(box[1], hole[1])
        if (high - low <= 0).any():
            left.append(box)
            continue
        rest = box.copy()
        for axis in range(3):
            below, above = rest.copy(), rest.copy()
            below[1, axis], above[0, axis] = low[axis], high[axis]
            left += [part for part in (below, above) if (part[1] - part[0] > _THIN).all()]
            rest[0, axis], rest[1, axis] = low[axis], high[axis]
    return np.array(left).reshape(-1, 2, 3)


def voxel_boxes(points: Float[np.ndarray, "n 3"], side: float, least: int) -> Boxes:
    """Boxes around all cells of a grid that hold points; neighbours along z, then y, then x are joined.

    Args:
      points: [m].
      side: Of a cell [m].
      least: Points that make a cell count.
    """
    if not len(points):
        return no_boxes()
    cells, counts = np.unique(np.floor(points / side).astype(int), axis=0, return_counts=True)
    cells = cells[counts >= least]
    spans = np.stack([cells, cells + 1], axis=1)
    for axis in (2, 1, 0):
        spans = _joined(spans, axis)
    return spans * side


def _joined(spans: np.ndarray, axis: int) -> np.ndarray:
    """Spans of cells, those joined that go on along an axis."""
    others = [each for each in range(3) if each != axis]
    order = np.lexsort((spans[:, 0, axis], *(spans[:, end, o] for o in others for end in (0, 1))))
    joined: list[np.ndarray] = []
    for span in spans[order]:
        before = joined[-1] if joined else None
        if (
            before is not None
            and before[1, axis] == span[0, axis]
            and (before[:, others] == span[:, others]).all()
        ):
            before[1, axis] = span[1, axis]
        else:
            joined.append(span.copy())
    return np.array(joined).reshape(-1, 2, 3)
