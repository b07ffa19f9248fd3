"""What stands around robot, furniture and objects, from the points that have no mask of their own.

Level surfaces become slabs, for things are set down on them: their height is measured over all of their
points. What is left, such as walls, becomes boxes around occupied cells.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from manipose_mj.control.furniture.shapes.boxes import Boxes, voxel_boxes

_REACH = np.array([[-0.9, -1.3, -0.25], [1.4, 1.3, 1.3]])  # of what matters, world frame [m]
_FOOT = 0.18  # around the robot's base: points there may be the robot's [m]
_BIN = 0.004  # of heights [m]
_LEVEL = 0.010  # how far points of a surface are from its height [m]
_CELL = 0.03  # of a surface, seen from above [m]
_GAP = 2  # cells by which a hole in a surface is closed
_LEAST_AREA = 0.02  # of a surface [m2]
_FILL = 0.6  # share of the cells of a rectangle, from which on it is one surface
_SLAB = 0.016  # thickness [m]
_VOXEL, _VOXEL_LEAST = 0.02, 6  # of what is no surface [m]; points
_CLEAR = 0.015  # what is that near to a surface is its noise [m]


def surrounding_boxes(points: Float[np.ndarray, "n 3"]) -> Boxes:
    """Boxes to keep clear of, world frame.

    Args:
      points: That are neither the robot's, nor of furniture or of an object, world frame [m].
    """
    near = ((points > _REACH[0]) & (points < _REACH[1])).all(axis=1)
    near &= (np.abs(points[:, :2]).max(axis=1) > _FOOT) | (points[:, 2] < 0.02)
    left = points[near]
    slabs: list[np.ndarray] = []
    for height in _heights(left):
        level = np.abs(left[:, 2] - height) < _LEVEL
        found = _rectangles(left[level])
        for low, high in found:
            slabs.append(np.array([[*low, height - _SLAB], [*high, height]]))
        left = left[~_on(left, found, height)]
    rest = voxel_boxes(left, _VOXEL, _VOXEL_LEAST)
    return np.concatenate([np.array(slabs).reshape(-1, 2, 3), rest]) if slabs else rest


def _heights(points: Float[np.ndarray, "n 3"]) -> list[float]:
    """Of level surfaces, the largest first: where many points are at one height."""
    if not len(points):
        return []
    bins = np.floor(points[:, 2] / _BIN).astype(int)
    first = int(bins.min())
    # Points a square metre: seen from nearby a surface has more, but only its area matters.
    cells = np.unique(np.column_stack([np.floor(points[:, :2] / _CELL).astype(int), bins]), axis=0)
    area = np.bincount(cells[:, 2] - first) * _CELL**2
    smooth = np.convolve(area, np.ones(3), mode="same")
    heights = []
    while smooth.max() > _LEAST_AREA:
        peak = int(smooth.argmax())
        height = (peak + first + 0.5) * _BIN
        near = np.abs(points[:, 2] - height) < 2 * _BIN
        heights.append(float(np.median(points[near, 2])))
        reach = round(2 * _LEVEL / _BIN)
        smooth[max(peak - reach, 0) : peak + reach + 1] = 0.0
    return heights


def _rectangles(points: Float[np.ndarray, "n 3"]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Level rectangles that points of one height fill, low and high corner `(2,)` each [m]."""
    if not len(points):
        return []
    cells = np.floor(points[:, :2] / _CELL).astype(int)
    low = cells.min(axis=0) - _GAP - 1
    grid: Bool[np.ndarray, "x y"] = np.zeros(cells.max(axis=0) - low + _GAP + 2, bool)
    grid[tuple((cells - low).T)] = True
    grid = ndimage.binary_closing(grid, iterations=_GAP)
    labels, count = ndimage.label(grid)
    spans = ndimage.find_objects(labels)
    found = []
    for number in range(1, count + 1):
        where = labels == number
        if where.sum() * _CELL**2 < _LEAST_AREA:
            continue
        x, y = spans[number - 1]
        if where[x, y].mean() > _FILL:
            own = points[where[tuple((cells - low).T)], :2]
            found.append((own.min(axis=0), own.max(axis=0)))
        else:
            # Such as a table around something that hides it: strips of it.
            boxes = voxel_boxes(np.argwhere(where) @ np.eye(2, 3) + 0.5, 1.0, 1)
            found += [((b[0, :2] + low) * _CELL, (b[1, :2] + low) * _CELL) for b in boxes]
    return found


def _on(
    points: Float[np.ndarray, "n 3"],
    rectangles: list[tuple[np.ndarray, np.ndarray]],
    height: float,
) -> Bool[np.ndarray, "n"]:
    """Which points are on surfaces at a height."""
    on = np.zeros(len(points), bool)
    near = (points[:, 2] < height + _CLEAR) & (points[:, 2] > height - _SLAB - _CLEAR)
    for low, high in rectangles:
        inside = (points[:, :2] > low - _CELL) & (points[:, :2] < high + _CELL)
        on |= near & inside.all(axis=1)
    return on
