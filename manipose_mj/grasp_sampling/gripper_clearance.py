"""Does the open hand, on its straight way in, meet the object?

Seen along the closing direction, each of the hand's boxes is a rectangle, and its way in a longer one.
A grid of square cells about the pair says of each cell which hands' rectangles cover it, a bit for each
turn and depth. The hands that an object's points meet are the bits of their cells, joined.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Float, UInt64

from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.approaches import COS, DEPTH, DEPTHS, HANDS, SIN, PairFrames

STANDOFF = 0.10  # where the straight approach starts [m]
MARGIN = 0.0015  # kept between the open fingers and the object's points [m]
COARSE_MARGIN = 0.003  # and between the hand's large boxes and fewer points [m]
_CELL = 0.0015  # of the fingers' grids [m]
_COARSE_CELL = 0.004  # of the hand's [m]
_STEP = 0.03  # the hand's grids are as large as the object, to the next multiple of this [m]
_BAND = 0.01  # the hand's boxes reach to a multiple of this along the closing direction [m]
_BLOCK = 64  # pairs whose points are held at a time
assert HANDS <= 64  # one bit each
_BITS = np.uint64(1) << np.arange(HANDS, dtype=np.uint64)


@dataclass(frozen=True)
class _Masks:
    """What the hand covers, in bands along the closing direction.

    Attributes:
      bands: `(b, 2)` [m], from where to where; the fingers' from the pad's face, the hand's from the
        middle. The fingers' overlap.
      covered: `(b, cells)`, of each cell the bits of the hands that cover it.
      size: Cells along one side of the square grid.
      cell: [m].
    """

    bands: Float[np.ndarray, "b 2"]
    covered: UInt64[np.ndarray, "b cells"]
    size: int
    cell: float

    @property
    def radius(self) -> float:
        """Half the side of the grid [m]."""
        return self.size * self.cell / 2

    def index(
        self, first: Float[np.ndarray, "*n"], other: Float[np.ndarray, "*n"]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The cell of each point, and whether it lies in the grid at all."""
        row = np.floor(first / self.cell + self.size / 2).astype(np.int32)
        column = np.floor(other / self.cell + self.size / 2).astype(np.int32)
        inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < self.size)
        return row * self.size + column, inside


def hand_free(
    coarse: Float[np.ndarray, "c 3"], frames: PairFrames, gripper: ParallelJaw
) -> Bool[np.ndarray, "p hands"]:
    """Whether the hand behind the fingers, from the standoff to the grasp, meets no point.

    Args:
      coarse: Points of the object and its outermost corners [m].
      frames: The pairs.
      gripper: The hand.
    """
    size = np.linalg.norm(np.ptp(coarse, axis=0))
    masks = _hand_masks(gripper, int(np.ceil(size / _STEP)))
    points = coarse.T.astype(np.float32)
    free = np.ones((len(frames), HANDS), bool)
    for start in range(0, len(frames), _BLOCK):
        local = frames.local(slice(start, start + _BLOCK), points)
        cell, inside = masks.index(local[0], local[2])
        away = np.abs(local[1]) - COARSE_MARGIN
        met = np.zeros(local.shape[1], np.uint64)
        for (low, high), covered in zip(masks.bands, masks.covered, strict=True):
            pair, point = np.nonzero(inside & (away >= low) & (away < high))
            np.bitwise_or.at(met, pair, covered[cell[pair, point]])
        free[start : start + _BLOCK] = _not_in(met)
    return free


def fingers_free(
    local: Float[np.ndarray, "3 m"],
    faces: Float[np.ndarray, "n 2"],
    gripper: ParallelJaw,
) -> Bool[np.ndarray, "hands"]:
    """Whether the open fingers, of each hand at one pair, meet no point.

    Args:
      local: Points in the pair's frame [m].
      faces: `(n, 2)` [m], where the open pads' faces are along the closing direction, for each of
        some hands; the answer holds for all of these.
      gripper: The hand.
    """
    masks = _finger_masks(gripper)
    cell, inside = masks.index(local[0], local[2])
    # Beyond either pad's face, the nearest and the farthest; negative between them.
    beyond = np.maximum(local[1] - faces[:, 1].min(), faces[:, 0].max() - local[1])
    outside = np.maximum(local[1] - faces[:, 1].max(), faces[:, 0].min() - local[1])
    met = np.uint64(0)
    for (low, high), covered in zip(masks.bands, masks.covered, strict=True):
        near = inside & (beyond > low - MARGIN) & (outside < high + MARGIN)
        met |= np.bitwise_or.reduce(covered[cell[near]])
    return _not_in(met)


def _not_in(met: UInt64[np.ndarray, "*n"] | np.uint64) -> Bool[np.ndarray, "*n hands"]:
    """Of each hand whether its bit is not set."""
    return (np.asarray(met)[..., None] & _BITS) == 0


def finger_reach(gripper: ParallelJaw) -> float:
    """Half the side of the fingers' grids [m]."""
    return _finger_masks(gripper).radius


@cache
def _finger_masks(gripper: ParallelJaw) -> _Masks:
    """The other finger is the half turn of this one: across the closing direction they are alike."""
    front = max(high[2] for _, high in gripper.hand)
    # The way in of what is further back is that of the hand's body, which is wider.
    rectangles = [
        [(max(-low[0], high[0]), min(low[2], front), high[2])] for low, high in gripper.finger
    ]
    spans = np.array([(low[1], high[1]) for low, high in gripper.finger])
    return _masks(spans, rectangles, _CELL, MARGIN, np.inf)


@cache
def _hand_masks(gripper: ParallelJaw, steps: int) -> _Masks:
    tops = [float(np.ceil(high[1] / _BAND - 1e-9) * _BAND) for _, high in gripper.hand]
    ends = sorted(set(tops))
    spans = list(zip([-np.inf, *ends[:-1]], ends, strict=True))
    rectangles = [
        [
            (max(-low[0], high[0]), low[2] - STANDOFF, high[2])
            for (low, high), top in zip(gripper.hand, tops, strict=True)
            if top >= end
        ]
        for _, end in spans
    ]
    return _masks(np.array(spans), rectangles, _COARSE_CELL, COARSE_MARGIN, steps * _STEP)


def _masks(
    bands: Float[np.ndarray, "b 2"],
    rectangles: list[list[tuple[float, float, float]]],
    cell: float,
    margin: float,
    farthest: float,
) -> _Masks:
    """Masks of rectangles (half width, from z, to z) of each band.

    They cover what comes nearer than the margin, wherever in its cell it is along the rectangle's
    axes, up to `farthest` from the pair.
    """
    margin += cell / 2
    corners = np.array([r for band in rectangles for r in band])
    reach = np.hypot(corners[:, 0], np.abs(corners[:, 1:]).max(axis=1)).max()
    size = 2 * int(np.ceil(min(reach + max(DEPTHS) + 2 * margin, farthest) / cell))
    at = (np.arange(size) + 0.5 - size / 2) * cell
    first, other = np.repeat(at, size)[:, None], np.tile(at, size)[:, None]
    x = COS * other - SIN * first
    z = COS * first + SIN * other + DEPTH
    covered = np.zeros((len(bands), size**2), np.uint64)
    for bits, band in zip(covered, rectangles, strict=True):
        for width, low, high in band:
            inside = (np.abs(x) < width + margin) & (z > low - margin) & (z < high + margin)
            bits |= np.where(inside, _BITS, np.uint64(0)).sum(axis=1, dtype=np.uint64)
    return _Masks(bands, covered, size, cell)
