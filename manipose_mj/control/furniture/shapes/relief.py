"""What stands out of the front of furniture as handles do: bumps of its relief, wherever nobody has looked for one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

_CELL = 0.004  # side of a cell of the relief [m]
_PIXEL = 1.5  # cells between pixels, at most
_WIDEST = 0.052  # what is wider than this both ways is no handle, but part of the front [m]
_LONGEST = 0.75  # [m]
_STANDING = (0.008, 0.09)  # how far cells of handles stand out of what is beside them [m]
_LEAST_OUT = 0.011  # the same of a handle, in the median: noise of far pixels stands out less [m]
_AHEAD, _BEHIND = 0.15, 0.03  # what is looked at before and behind the front [m]
_FEWEST = (5, 12)  # cells, and points, of a bump
# How far beside a bump the front has to show, at least [m], and of what it stands out by: it casts a shadow.
_BESIDE, _SHADOW = 0.02, 1.2
_FRONT_SHOWS = 0.4  # share of what is beside each of its long sides that does
# How far around a place is looked at [m], and which share of that has to show.
_AROUND, _SHOWN = 0.03, 0.7


@dataclass(frozen=True)
class Bump:
    """Attributes: middle: object frame, X where it is highest [m]; size: across and upright [m]; base: how far out what it
    stands on is, along X [m]."""

    middle: Float[np.ndarray, "3"]
    size: Float[np.ndarray, "2"]
    base: float

    def beside(self, place: Float[np.ndarray, "3"]) -> float:
        """How far a place is from it, along the front; 0 within it [m]."""
        off = np.abs(place - self.middle)[1:] - self.size / 2
        return float(np.linalg.norm(np.maximum(off, 0.0)))


@dataclass(frozen=True)
class Relief:
    """Attributes: bumps; shown: cells in which the front shows; low: where the first of them starts, Y and Z [m]."""

    bumps: tuple[Bump, ...]
    shown: Bool[np.ndarray, "w h"]
    low: Float[np.ndarray, "2"]

    def shows(self, place: Float[np.ndarray, "3"]) -> bool:
        """Whether cameras see what is around a place, object frame [m]."""
        start = ((place[1:] - self.low - _AROUND) / _CELL).astype(int)
        stop = start + round(2 * _AROUND / _CELL)
        if (start < 0).any() or (stop > self.shown.shape).any():
            return False
        return bool(self.shown[start[0] : stop[0], start[1] : stop[1]].mean() > _SHOWN)


def relief(points: Float[np.ndarray, "n 3"], front: float) -> Relief:
    """What stands out of a front, or of a frame on it, and is as narrow as handles are.

    The relief is what white top-hat makes of the height of the front (Serra, Image Analysis and Mathematical Morphology,
    1982): whatever is narrower than the widest handle.

    Args:
      points: Of the furniture, object frame, X out of the front and Z up, its parts shut [m].
      front: Along X [m].
    """
    near = (points[:, 0] > front - _BEHIND) & (points[:, 0] < front + _AHEAD)
    if near.sum() < _FEWEST[1]:
        return Relief((), np.zeros((0, 0), bool), np.zeros(2))
    seen = points[near]
    low = seen[:, 1:].min(axis=0)
    cells = tuple(((seen[:, 1:] - low) / _CELL).astype(int).T)
    shape = tuple(int(each.max()) + 1 for each in cells)
    height, counts = np.full(shape, -np.inf), np.zeros(shape, int)
    np.maximum.at(height, cells, seen[:, 0])
    np.add.at(counts, cells, 1)
    # Pixels may be further apart than cells.
    shown = ndimage.binary_dilation(counts > 0, np.ones((3, 3)))
    height = ndimage.median_filter(_filled(height), 3)
    base = ndimage.grey_opening(height, round(_WIDEST / _CELL))
    out = height - base
    names, count = ndimage.label((out > _STANDING[0]) & shown, structure=np.ones((3, 3)))
    found = []
    for name, box in zip(range(1, count + 1), ndimage.find_objects(names), strict=True):
        own = names[box] == name
        size = np.array(own.shape) * _CELL
        stands = float(np.median(out[box][own]))
        if own.sum() < _FEWEST[0] or counts[box][own].sum() < _FEWEST[1]:
            continue
        if size.min() > _WIDEST or size.max() > _LONGEST or not _LEAST_OUT < stands < _STANDING[1]:
            continue
        ground = float(np.median(base[box][own]))
        flush = shown & (np.abs(height - ground) < _STANDING[0])
        if not _on_a_front(flush, box, size, max(_BESIDE, _SHADOW * stands)):
            continue
        start = low + np.array([each.start for each in box]) * _CELL
        middle = np.array([float(height[box][own].max()), *(start + size / 2)])
        found.append(Bump(middle, size, ground))
    return Relief(tuple(found), shown, low)


def _filled(height: Float[np.ndarray, "w h"]) -> Float[np.ndarray, "w h"]:
    """A relief without gaps: cells between pixels are as high as the nearest, wider gaps as low as anything near them, for
    they are shadows of what stands out."""
    away, nearest = ndimage.distance_transform_edt(~np.isfinite(height), return_indices=True)
    close = height[tuple(nearest)]
    lowest = ndimage.minimum_filter(np.where(away < _PIXEL, close, np.inf), round(_WIDEST / _CELL))
    return np.where((away < _PIXEL) | ~np.isfinite(lowest), close, lowest)


def _on_a_front(
    flush: Bool[np.ndarray, "w h"],
    box: tuple[slice, slice],
    size: Float[np.ndarray, "2"],
    beside: float,
) -> bool:
    """Whether the front shows within so far [m] of both long sides of what stands out: at the edge of a board it does not."""
    margin = round(beside / _CELL)
    short = int(np.argmin(size))
    sides = []
    for start, stop in (
        (box[short].start - margin, box[short].start),
        (box[short].stop, box[short].stop + margin),
    ):
        strip = [box[0], box[1]]
        strip[short] = slice(max(start, 0), max(stop, 0))
        seen = flush[tuple(strip)]
        sides.append(seen.any(axis=short).mean() if seen.size else 0.0)
    return min(sides) > _FRONT_SHOWS
