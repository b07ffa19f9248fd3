"""The free space that a drawer holds or a door shuts, found from collision shapes.

Seen along the way that things go in (into a cupboard from its door's side, into a drawer from above),
each column of cells starts behind the cover that shuts it and ends where the container begins. The
cavity is the box over a rectangle of columns that has the most volume; nothing reaches into it while all
is shut. Behind a door that ends above the floor, it then grows down to the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import ConvexHull

from manipose_mj.assets.asset import Cavity
from manipose_mj.assets.geometry import Shape

PITCH = 0.005  # of the columns [m]
LARGE = 140  # cells along the longest side at most; larger things get larger cells
LEAST = 0.062  # a cavity that takes no ball of 6 cm is none [m]
LEVELS = 24  # candidate depths
HOLE = 0.045  # a floor has no gap as long and as wide as this; racks have narrow ones [m]


def cavity_behind(
    cover: Sequence[Shape],
    container: Sequence[Shape],
    region: Float[np.ndarray, "2 3"],
    inwards: Float[np.ndarray, "3"],
    *,
    moves_with_part: bool,
) -> Cavity | None:
    """The largest box that can be reached straight, or None if it takes no ball of 6 cm.

    Args:
      cover: What shuts the space: the door, or what is above a shut drawer.
      container: What bounds it: the carcass and all else, or the drawer. What has no floor is none.
      region: Lowest and highest corner of where to look [m].
      inwards: `(3,)`, plus or minus one axis: the way that things go in.
      moves_with_part: Of the cavity; a drawer's columns without a floor do not count.
    """
    axis = int(np.abs(inwards).argmax())
    extents = region[1] - region[0]
    if extents.min() < LEAST:
        return None
    pitch = max(PITCH, float(extents.max()) / LARGE)
    counts = np.maximum(np.floor(extents / pitch).astype(int), 1)
    low = region[0] + (extents - counts * pitch) / 2
    solid, lid = (_filled(s, low, pitch, counts) for s in (container, cover))

    def columns(filled: Bool[np.ndarray, "x y z"]) -> Bool[np.ndarray, "v w u"]:
        turned = np.moveaxis(filled, axis, -1)
        return turned if inwards[axis] > 0 else turned[..., ::-1]

    box = _largest(columns(lid), columns(solid), pitch, needs_floor=moves_with_part)
    if box is None:
        return None
    start, stop = box
    if inwards[axis] < 0:
        start[2], stop[2] = counts[axis] - stop[2], counts[axis] - start[2]
    order = [i for i in range(3) if i != axis] + [axis]
    corner, end = np.empty(3), np.empty(3)
    corner[order], end[order] = start, stop
    found = np.stack([low + pitch * corner, low + pitch * end])
    corners = found if axis == 2 else _down_to_floor(found, container, pitch)
    if corners is None or (corners[1] - corners[0]).min() < LEAST:
        return None
    return Cavity((corners[0] + corners[1]) / 2, corners[1] - corners[0], moves_with_part)


def _largest(
    lid: Bool[np.ndarray, "v w u"],
    solid: Bool[np.ndarray, "v w u"],
    pitch: float,
    *,
    needs_floor: bool,
) -> tuple[np.ndarray, np.ndarray] | None:
    depth = lid.shape[2]
    hits = solid.any(axis=2)
    ends = np.where(hits, solid.argmax(axis=2), 0 if needs_floor else depth)
    covered = lid & (np.arange(depth) < ends[..., None])
    starts = np.where(covered.any(axis=2), depth - covered[..., ::-1].argmax(axis=2), 0)
    least = int(np.ceil(LEAST / pitch))
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for start in _levels(starts[ends > 0], 4):
        for stop in _levels(ends[ends > start], LEVELS):
            if stop - start < least:
                continue
            free = (starts <= start) & (ends >= stop)
            if best is not None and free.sum() * (stop - start) <= best[0]:
                continue
            (v0, w0), (v1, w1) = _largest_rectangle(free, least)
            volume = float((v1 - v0) * (w1 - w0) * (stop - start))
            if volume > (best[0] if best else 0):
                best = volume, np.array([v0, w0, start]), np.array([v1, w1, stop])
    return None if best is None else (best[1], best[2])


def _down_to_floor(
    box: Float[np.ndarray, "2 3"], container: Sequence[Shape], pitch: float
) -> Float[np.ndarray, "2 3"] | None:
    """The box behind a door grown down to a floor, or None where there is none.

    Sills and ledges may stand in the way: of the boxes below a part of this one, each on a floor, the
    one with the most volume.
    """
    bottom = min(s.surface().bounds[0, 2] for s in container)
    counts = np.round((box[1] - box[0]) / pitch).astype(int)
    tall, counts[2] = int(counts[2]), max(int((box[0, 2] - bottom) / pitch) + 1, 1)
    low = np.array([*box[0, :2], box[0, 2] - counts[2] * pitch])
    filled = _filled(container, low, pitch, counts)[..., ::-1]  # top layer first
    depth = np.where(filled.any(axis=2), filled.argmax(axis=2), counts[2])
    least = int(np.ceil(LEAST / pitch))
    best: tuple[float, Float[np.ndarray, "2 3"]] | None = None
    for down in range(counts[2]):
        (x0, y0), (x1, y1) = _largest_rectangle(depth >= down, least)
        volume = float((x1 - x0) * (y1 - y0) * (tall + down))
        if volume <= (best[0] if best else 0):
            continue
        holes = depth[x0:x1, y0:y1] > down
        if _largest_rectangle(holes, int(HOLE / pitch)) == ((0, 0), (0, 0)):
            grown = box.copy()
            grown[:, :2] = low[:2] + pitch * np.array([[x0, y0], [x1, y1]])
            grown[0, 2] -= down * pitch
            best = volume, grown
    return None if best is None else best[1]


def _levels(values: Int[np.ndarray, "n"], count: int) -> list[int]:
    """A few of the values, from the highest to the lowest."""
    found = np.unique(values)
    chosen = (
        np.unique(np.linspace(0, len(found) - 1, count).round().astype(int)) if len(found) else []
    )
    return [int(found[i]) for i in chosen][::-1]


def _largest_rectangle(
    free: Bool[np.ndarray, "v w"], least: int
) -> tuple[tuple[int, int], tuple[int, int]]:
    """The largest rectangle of true cells with no side shorter than `least`; empty if there is none.

    Row by row, the largest rectangle under a histogram, by a stack of rising bars.
    """
    best, corners = 0, ((0, 0), (0, 0))
    heights = np.zeros(free.shape[1] + 1, int)
    for row in range(free.shape[0]):
        heights[:-1] = np.where(free[row], heights[:-1] + 1, 0)
        stack: list[tuple[int, int]] = []  # where a bar begins, and its height
        for column, height in enumerate(heights.tolist()):
            begin = column
            while stack and stack[-1][1] >= height:
                begin, tall = stack.pop()
                if tall * (column - begin) > best and tall >= least and column - begin >= least:
                    best = tall * (column - begin)
                    corners = (row + 1 - tall, begin), (row + 1, column)
            stack.append((begin, height))
    return corners


def _filled(
    shapes: Sequence[Shape], low: Float[np.ndarray, "3"], pitch: float, counts: Int[np.ndarray, "3"]
) -> Bool[np.ndarray, "x y z"]:
    """The cells that convex shapes reach into."""
    filled = np.zeros(tuple(counts), bool)
    for shape in shapes:
        surface = shape.surface()
        first = np.clip(np.floor((surface.bounds[0] - low) / pitch).astype(int), 0, counts)
        last = np.clip(np.ceil((surface.bounds[1] - low) / pitch).astype(int), 0, counts)
        if (last <= first).any():
            continue
        axes = [low[i] + pitch * (np.arange(first[i], last[i]) + 0.5) for i in range(3)]
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
        planes = ConvexHull(surface.vertices).equations
        # A cell reaches this far along a normal; 1 % less, so that touching is not reaching in.
        reach = 0.495 * pitch * np.abs(planes[:, :3]).sum(axis=1)
        inside = (centres @ planes[:, :3].T + planes[:, 3] < reach).all(axis=-1)
        filled[tuple(slice(a, b) for a, b in zip(first, last, strict=True))] |= inside
    return filled
