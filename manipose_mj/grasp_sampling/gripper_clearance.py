"""Does the open hand, on its straight way in, meet the object?

Seen along the closing direction, each of the hand's boxes is a rectangle, and its way in a longer one.
The object's points at the height of the box are drawn into a picture of square cells about the pair,
and how many of them a hand covers is the product of the picture with the hand's mask: one matrix
product for every turn and depth of every pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.approaches import COS, DEPTH, DEPTHS, HANDS, SIN, PairFrames

STANDOFF = 0.10  # where the straight approach starts [m]
MARGIN = 0.0015  # kept between the open fingers and the object's points [m]
COARSE_MARGIN = 0.003  # and between the hand's large boxes and fewer points [m]
_CELL = 0.0015  # of the fingers' pictures [m]
_COARSE_CELL = 0.004  # of the hand's [m]
_STEP = 0.03  # the hand's pictures are as large as the object, to the next multiple of this [m]
_BAND = 0.01  # the hand's boxes reach to a multiple of this along the closing direction [m]
_BLOCK = 64  # pairs whose pictures are held at a time


@dataclass(frozen=True)
class _Masks:
    """What the hand covers, in bands along the closing direction.

    Attributes:
      bands: `(b, 2)` [m], from where to where; the fingers' from the pad's face, the hand's from the
        middle. The fingers' overlap.
      cells: `(b, cells, hands)`, one where covered.
      size: Cells along one side of the square picture.
      cell: [m].
    """

    bands: Float[np.ndarray, "b 2"]
    cells: Float[np.ndarray, "b cells hands"]
    size: int
    cell: float

    @property
    def radius(self) -> float:
        """Half the side of the picture [m]."""
        return self.size * self.cell / 2

    def index(
        self, first: Float[np.ndarray, "*n"], other: Float[np.ndarray, "*n"]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The cell of each point, and whether it lies in the picture at all."""
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
        count = min(_BLOCK, len(frames) - start)
        local = frames.local(slice(start, start + count), points)
        cell, inside = masks.index(local[0], local[2])
        cell += np.arange(count, dtype=np.int32)[:, None] * masks.size**2
        away = np.abs(local[1]) - COARSE_MARGIN
        met = np.zeros((count, HANDS), np.float32)
        for (low, high), mask in zip(masks.bands, masks.cells, strict=True):
            picture = np.zeros((count, masks.size**2), np.float32)
            picture.ravel()[cell[inside & (away >= low) & (away < high)]] = 1
            met += picture @ mask
        free[start : start + count] = met < 0.5
    return free


def finger_cells(
    local: Float[np.ndarray, "3 m"],
    faces: Float[np.ndarray, "n 2"],
    gripper: ParallelJaw,
) -> Float[np.ndarray, "b cells"]:
    """The pictures of the points at the height of the fingers of one pair, one for each band.

    Args:
      local: Points in the pair's frame [m].
      faces: `(n, 2)` [m], where the open pads' faces are along the closing direction, for each of
        the hands; the pictures hold for all of them.
      gripper: The hand.
    """
    masks = _finger_masks(gripper)
    cell, inside = masks.index(local[0], local[2])
    # Beyond either pad's face, the nearest and the farthest; negative between them.
    beyond = np.maximum(local[1] - faces[:, 1].min(), faces[:, 0].max() - local[1])
    outside = np.maximum(local[1] - faces[:, 1].max(), faces[:, 0].min() - local[1])
    pictures = np.zeros((len(masks.bands), masks.size**2), np.float32)
    for picture, (low, high) in zip(pictures, masks.bands, strict=True):
        picture[cell[inside & (beyond > low - MARGIN) & (outside < high + MARGIN)]] = 1
    return pictures


def fingers_free(
    pictures: Float[np.ndarray, "p b cells"], gripper: ParallelJaw
) -> Bool[np.ndarray, "p hands"]:
    """Whether the open fingers meet no point of these pictures."""
    met = np.zeros((len(pictures), HANDS), np.float32)
    for band, mask in enumerate(_finger_masks(gripper).cells):
        met += pictures[:, band] @ mask
    return met < 0.5


def finger_reach(gripper: ParallelJaw) -> float:
    """Half the side of the fingers' pictures [m]."""
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
    cells = np.zeros((len(bands), size**2, HANDS), np.float32)
    for mask, band in zip(cells, rectangles, strict=True):
        for width, low, high in band:
            covered = (np.abs(x) < width + margin) & (z > low - margin) & (z < high + margin)
            mask[covered] = 1
    return _Masks(bands, cells, size, cell)
