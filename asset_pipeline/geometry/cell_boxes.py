"""Boxes that fill what a surface encloses or, where it is open, the sheet that it is.

Made for drawn furniture and appliances: soups of flat faces along the axes, with hollow walls, open
fronts and rounded corners. Cells of a grid that the surface passes through, or that no way from outside
leads to, are covered by few large boxes; each face of a box then moves to where the surface lies, so
that flat walls come out exact and curved ones to within a cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy import ndimage

from asset_pipeline.geometry.box_fit import FIT, box_between
from asset_pipeline.geometry.surface_points import surface_points
from manipose_mj.assets.geometry import Shape

# Of a box's columns, this share lies below its face: the rest is where another wall meets it.
FACE_QUANTILE = 0.6


@dataclass(frozen=True)
class Grid:
    """Cells along the axes. Attributes: low, corner of the first cell [m]; pitch [m]; filled."""

    low: Float[np.ndarray, "3"]
    pitch: float
    filled: Bool[np.ndarray, "x y z"]

    def centres(self, index: np.ndarray) -> np.ndarray:
        """Of the cells with these indices, `(n, 3)` [m]."""
        return self.low + (index + 0.5) * self.pitch


def cell_boxes(mesh: trimesh.Trimesh, pitch: float, limit: int) -> tuple[Shape, ...]:
    """Boxes along the axes that stand for a surface.

    Args:
      mesh: Any triangle soup in the body frame [m].
      pitch: Of the grid [m].
      limit: Boxes at most; the smallest are left out.
    """
    points = surface_points(mesh, 0.5 * pitch)
    grid, cells = occupied(points, pitch)
    extremes = _extremes(points, cells, grid)
    shapes = []
    for low, high in _cover(grid.filled, limit):
        ends = _faces(grid, extremes, low, high)
        if (ends[1] - ends[0]).min() > -1e-9:
            shapes.append(box_between(*ends))
    return tuple(shapes)


def occupied(points: Float[np.ndarray, "n 3"], pitch: float) -> tuple[Grid, np.ndarray]:
    """The grid around points of a surface, and the cell `(n, 3)` of each.

    A cell is filled if a point lies in it or if it cannot be reached from outside.
    """
    # Half a cell off the lowest point: walls of drawings lie on round numbers.
    low = points.min(axis=0) - 1.5 * pitch
    cells = np.floor((points - low) / pitch).astype(int)
    filled = np.zeros(tuple(cells.max(axis=0) + 2), bool)
    filled[tuple(cells.T)] = True
    labels, _ = ndimage.label(~filled)
    filled = labels != labels[0, 0, 0]
    return Grid(low, pitch, filled), cells


def _extremes(points: np.ndarray, cells: np.ndarray, grid: Grid) -> np.ndarray:
    """Lowest and highest coordinate of the surface in each cell, `(2, 3, x, y, z)`; NaN elsewhere."""
    shape = grid.filled.shape
    flat = np.asarray(np.ravel_multi_index(tuple(cells.T), shape))
    order = np.argsort(flat, kind="stable")
    starts = np.flatnonzero(np.diff(flat[order], prepend=-1))
    result = np.full((2, 3, grid.filled.size), np.nan, np.float32)
    where = np.asarray(flat)[order][starts]
    for axis in range(3):
        values = points[order, axis]
        result[0, axis, where] = np.minimum.reduceat(values, starts)
        result[1, axis, where] = np.maximum.reduceat(values, starts)
    return result.reshape(2, 3, *shape)


def _cover(filled: np.ndarray, limit: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Boxes of filled cells that cover nearly all of them, largest first as far as greed finds them.

    Boxes may overlap: walls then reach through corners.
    """
    left = filled.copy()
    counts = _Counts(filled)
    found = []
    waiting = np.argwhere(left)
    while len(waiting) and len(found) < limit:
        best = None
        # A few seeds spread over what is left; of their boxes, the one that covers most of it.
        for seed in waiting[:: max(len(waiting) // 12, 1)]:
            for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0), (1, 0, 2), (0, 2, 1)):
                low, high = _grown(counts, tuple(seed.tolist()), order)
                gain = int(left[_slices(low, high)].sum())
                if best is None or gain > best[0]:
                    best = gain, low, high
        assert best is not None
        _, low, high = best
        left[_slices(low, high)] = False
        found.append((np.array(low), np.array(high)))
        waiting = waiting[left[tuple(waiting.T)]]
    return found


def _grown(
    filled: _Counts, seed: tuple[int, ...], order: tuple[int, ...]
) -> tuple[list[int], list[int]]:
    """The box grown from a cell along one axis after the other, as far as all is filled."""
    low, high = list(seed), [i + 1 for i in seed]
    for axis in order:
        for end, step, room in (
            (low, -1, low[axis]),
            (high, 1, filled.shape[axis] - high[axis]),
        ):
            start = end[axis]
            inside, outside = (
                0,
                room + 1,
            )  # the largest step known to be filled, and one that is not
            while outside - inside > 1:
                middle = (inside + outside) // 2
                end[axis] = start + step * middle
                if filled.all(low, high):
                    inside = middle
                else:
                    outside = middle
            end[axis] = start + step * inside
    return low, high


def _faces(
    grid: Grid, extremes: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The box's corners, each face moved from the cells' border to where the surface is."""
    ends = np.stack([grid.low + low * grid.pitch, grid.low + high * grid.pitch])
    for axis in range(3):
        for side in (0, 1):
            layer = [slice(a, b) for a, b in zip(low, high, strict=True)]
            layer[axis] = (
                slice(high[axis] - 1, high[axis]) if side else slice(low[axis], low[axis] + 1)
            )
            beyond = list(layer)
            step = 1 if side else -1
            beyond[axis] = slice(layer[axis].start + step, layer[axis].stop + step)
            own = extremes[side, axis][tuple(layer)].ravel()
            open_ = ~grid.filled[tuple(beyond)].ravel() & np.isfinite(own)
            if open_.mean() > 1 - FACE_QUANTILE:  # else the face is inside, against other boxes
                share = FACE_QUANTILE if side else 1 - FACE_QUANTILE
                ends[side, axis] = np.quantile(own[open_], share)
    flat = ends[1] - ends[0] < FIT.thinnest
    middle = ends.mean(axis=0)
    ends[0, flat], ends[1, flat] = middle[flat], middle[flat]
    return ends[0], ends[1]


class _Counts:
    """How many cells of a box are filled, by sums over all boxes from the corner (plain integers: the
    search asks a million times for eight of them)."""

    def __init__(self, filled: Bool[np.ndarray, "x y z"]) -> None:
        self.shape: tuple[int, ...] = filled.shape
        shape = [n + 1 for n in filled.shape]
        sums = np.zeros(shape, np.int64)
        sums[1:, 1:, 1:] = filled.astype(np.int64).cumsum(0).cumsum(1).cumsum(2)
        self._row = shape[2]
        self._layer = shape[1] * shape[2]
        self._sums = sums.ravel().tolist()

    def all(self, low: list[int], high: list[int]) -> bool:
        """Whether every cell is."""
        (a, b, c), (d, e, f), s = low, high, self._sums
        ab, db = a * self._layer + b * self._row, d * self._layer + b * self._row
        ae, de = a * self._layer + e * self._row, d * self._layer + e * self._row
        count = s[de + f] - s[ae + f] - s[db + f] - s[de + c] + s[ab + f] + s[ae + c] + s[db + c]
        return count - s[ab + c] == (d - a) * (e - b) * (f - c)


def _slices(low: list[int], high: list[int]) -> tuple[slice, ...]:
    return tuple(slice(a, b) for a, b in zip(low, high, strict=True))
