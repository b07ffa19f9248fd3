"""What frames the opening behind a door, and the surface that objects stand on in there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

# Where the frame may be behind the front of a shut door, and how far points of it are from its plane [m].
_BEHIND = (0.008, 0.06)
_PLANE = 0.008
_LEAST = 60  # points that make a frame
_BIN = 0.010  # in which points of a frame are counted [m]
_SIDE_LEAST, _SIDE_SHARE = (
    6,
    0.25,
)  # points of a bin that is a side; of the fullest bin of that side
_STRAY = 5  # of the points of a side's first bins, those before it [%]
_MIDDLE = 0.5  # share of the opening about its middle in which a side is looked for
_FACING, _FLAT = 0.75, 0.8  # cosines of normals to an axis
_STEP, _LEVEL = 0.004, 0.006  # between heights of surfaces, and of points from theirs [m]
_CELL = 0.02  # of a surface, seen from above [m]
_WIDE = 0.4  # share of the cells of the widest surface that a surface has that carries objects
_SAME, _SAME_SHARE = 0.016, 0.5  # heights of one surface [m]; of its points, at its top
_BOARD = 0.02  # thickness of a shelf [m]
_AS_TALL = 0.8  # share of the height of the tallest space


@dataclass(frozen=True)
class Rim:
    """Around an opening, object frame [m]; None where no camera sees it.

    Attributes: mouth: along X, where the frame is; left, right: along Y; roof: along Z.
    """

    mouth: float | None = None
    left: float | None = None
    right: float | None = None
    roof: float | None = None


def seen_rim(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    panel: Float[np.ndarray, "2 3"],
) -> Rim:
    """The frame that a door covers when it is shut: what faces the front a little behind the door's own front.

    Args:
      points: Of the furniture, its door open, object frame [m].
      normals: Of them.
      panel: Of the door, shut: low and high corner [m].
    """
    low, high = panel
    behind = high[0] - points[:, 0]
    near = (normals[:, 0] > _FACING) & (behind > _BEHIND[0]) & (behind < _BEHIND[1])
    near &= ((points > low - 0.01) & (points < high + 0.01))[:, 1:].all(axis=1)
    if near.sum() < _LEAST:
        return Rim()
    counts, edges = np.histogram(behind[near], np.arange(_BEHIND[0], _BEHIND[1] + 0.002, 0.004))
    best = edges[int(np.convolve(counts, np.ones(3), mode="same").argmax())] + 0.002
    on = near & (np.abs(behind - best) < _PLANE)
    if on.sum() < _LEAST:
        return Rim()
    rim = points[on]
    from_middle = np.abs(rim - (low + high) / 2) / ((high - low) / 2)
    abreast, amid = from_middle[:, 2] < _MIDDLE, from_middle[:, 1] < _MIDDLE
    middle = (low + high) / 2
    return Rim(
        mouth=float(high[0] - np.median(behind[on])),
        left=_side(rim[abreast, 1], float(middle[1]), -1.0),
        right=_side(rim[abreast, 1], float(middle[1]), 1.0),
        roof=_side(rim[amid, 2], float(middle[2]), 1.0),
    )


def _side(values: Float[np.ndarray, "n"], middle: float, sign: float) -> float | None:
    """Where the frame begins, from the middle of the opening on to one side [m]."""
    away = sign * (values - middle)
    away = away[away > 0]
    if len(away) < _SIDE_LEAST:
        return None
    counts, edges = np.histogram(away, np.arange(0.0, away.max() + 2 * _BIN, _BIN))
    full = counts >= max(_SIDE_LEAST, _SIDE_SHARE * counts.max())
    if not full.any():
        return None
    begins = edges[int(full.argmax())]
    # Where in its first bins it does.
    first = away[(away >= begins) & (away < begins + 2 * _BIN)]
    return middle + sign * float(np.percentile(first, _STRAY))


@dataclass(frozen=True)
class Compartment:
    """Attributes: floor: what objects stand on; roof: what is above them [m]."""

    floor: float
    roof: float


def tallest_compartment(
    points: Float[np.ndarray, "n 3"],
    inside: Bool[np.ndarray, "n"],
    normals: Float[np.ndarray, "n 3"],
    roof: float,
) -> Compartment | None:
    """The tallest space between wide surfaces, as shelves divide it; of nearly equal ones the lowest.

    A rack is over the floor that shows through it.

    Args:
      points: Object frame [m].
      inside: Which of them may be of such surfaces.
      normals: Of all points.
      roof: Above the uppermost [m].

    Returns:
      The space; None where no surface shows.
    """
    seen = points[inside & (normals[:, 2] > _FLAT) & (points[:, 2] < roof)]
    if len(seen) < _LEAST:
        return None
    heights = np.arange(seen[:, 2].min(), seen[:, 2].max() + _STEP, _STEP)
    rows = [np.abs(seen[:, 2] - height) < _LEVEL for height in heights]
    number = np.array([row.sum() for row in rows])
    cells = np.array([len(np.unique(np.floor(seen[row, :2] / _CELL), axis=0)) for row in rows])
    near = np.abs(heights[:, None] - heights[None]) < _SAME
    fullest = np.where(near, number[None], 0).max(axis=1)
    carries = (cells >= _WIDE * cells.max()) & (number >= _SAME_SHARE * fullest)
    wide = np.flatnonzero(carries)
    # The top of each surface.
    tops = wide[np.append(np.diff(heights[wide]) > _SAME, True)]
    floors = [float(np.median(seen[rows[top], 2])) for top in tops]
    roofs = [*(floor - _BOARD for floor in floors[1:]), roof]
    tall = np.subtract(roofs, floors)
    chosen = int(np.flatnonzero(tall >= _AS_TALL * tall.max())[0])
    return Compartment(floors[chosen], roofs[chosen])
