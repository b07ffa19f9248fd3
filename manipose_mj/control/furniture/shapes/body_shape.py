"""The body of a piece of furniture: its ends, and level slices of it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.furniture.shapes.boxes import Boxes

_SLICE = 0.05  # height of what the body is cut into [m]
_ALIKE = 0.02  # slices whose sides differ by less are one [m]
_SLICE_LEAST = 25  # points
_CELL, _CELL_LEAST = 0.01, 3  # in which points are counted [m]; points
# In which the front is looked for [m], how many along X there are at least; which share of its width and height a body has at
# its front, of those that are exceeded in so many percent of the places.
_THICK_CELL, _FEWEST_CELLS, _WHOLE, _MOST_OF = 0.02, 6, 0.6, 75

_BIN, _SHARE, _FEWEST = (
    0.005,
    0.3,
    60,
)  # in which points are counted [m], their share of the fullest, and how many there are


def ends_of(
    points: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Low and high corner of points, strays left out; what is far away counts as much as what is near [m].

    Where points are so few that all look like strays, all count.
    """
    cells, counts = np.unique(np.floor(points / _CELL).astype(int), axis=0, return_counts=True)
    middles = (cells[counts >= min(_CELL_LEAST, counts.max())] + 0.5) * _CELL
    low, high = np.percentile(middles, [0.4, 99.6], axis=0)
    return low, high


def front_of(points: Float[np.ndarray, "n 3"]) -> float | None:
    """Where along X a body ends that is as wide and as high there as elsewhere [m]; None where too little of it shows.

    A door or a flap that stands open before it is thin one way.
    """
    cells, counts = np.unique(
        np.floor(points / _THICK_CELL).astype(int), axis=0, return_counts=True
    )
    cells = cells[counts >= _CELL_LEAST]
    places = np.unique(cells[:, 0])
    if len(places) < _FEWEST_CELLS:
        return None
    extents = np.array([np.ptp(cells[cells[:, 0] == x, 1:], axis=0) for x in places])
    whole = (extents > _WHOLE * np.percentile(extents, _MOST_OF, axis=0)).all(axis=1)
    return float((places[whole].max() + 1) * _THICK_CELL) if whole.any() else None


def foremost(facing: Float[np.ndarray, "n"], about: float, mistaken: float) -> float | None:
    """The foremost of the places along X where much faces out of the front [m]; None where nothing does.

    Args:
      facing: Where along X points are that do [m].
      about: Where the front is thought to be [m].
      mistaken: How far it may be from there [m].
    """
    near = facing[np.abs(facing - about) < mistaken]
    counts, edges = np.histogram(near, np.arange(about - mistaken, about + mistaken + _BIN, _BIN))
    counts = np.convolve(counts, np.ones(2), mode="same")
    many = np.flatnonzero(counts > max(_FEWEST, _SHARE * counts.max()))
    if not len(many):
        return None
    place = edges[many[-1]]
    return float(np.median(near[np.abs(near - place) < 2 * _BIN]))


def body_slices(points: Float[np.ndarray, "n 3"], bounds: Float[np.ndarray, "2 3"]) -> Boxes:
    """The body in level slices, each from its front to the back: a plinth stays behind the front.

    One box where nothing of it shows.
    """
    body = (points[:, 0] < bounds[1, 0] + 0.004) & (points[:, 0] > bounds[0, 0] - 0.02)
    points = points[body]
    if not len(points):
        return bounds[None]
    bottom, top = float(points[:, 2].min()), float(bounds[1, 2])
    count = max(int(np.ceil((top - bottom) / _SLICE)), 1)
    edges = np.linspace(bottom, top, count + 1)
    slices: list[np.ndarray] = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        own = points[(points[:, 2] >= low) & (points[:, 2] < high)]
        if len(own) < _SLICE_LEAST:
            continue
        sides = np.percentile(own, [1, 99], axis=0)
        box = np.array([[bounds[0, 0], sides[0, 1], low], [sides[1, 0], sides[1, 1], high]])
        # A side that no camera sees does not make a slice narrow.
        box[0, 1], box[1, 1] = min(box[0, 1], bounds[0, 1]), max(box[1, 1], bounds[1, 1])
        if bounds[1, 0] - box[1, 0] < 0.04:
            box[1, 0] = bounds[1, 0]
        before = slices[-1] if slices else None
        if before is not None and (np.abs(before - box)[:, :2] < _ALIKE).all():
            before[:, :2] = np.stack(
                [np.minimum(before[0, :2], box[0, :2]), np.maximum(before[1, :2], box[1, :2])]
            )
            before[1, 2] = high
        else:
            slices.append(box)
    return np.array(slices) if slices else bounds[None]
