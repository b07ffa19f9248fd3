"""Convex hulls of a bent bar: slices across its length, each the hull of what is connected in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from asset_pipeline.geometry.hull_reduction import reduced_hull
from asset_pipeline.geometry.surface_points import surface_points
from manipose_mj.assets.geometry import Shape

SPACING = 0.0015  # of the points that stand for the surface [m]
APART = 0.004  # two pieces of a slice are one where they come nearer than this [m]
SLAB = 0.012  # thickness of a slice, more for handles with more than MAX_SLABS [m]
MAX_SLABS = 16
VERTICES = 24
# Neighbours become one hull where their cross-sections end within this of each other [m], and the hull
# has no more than this share of volume to spare.
STEP = 0.004
SPARE = 0.06


@dataclass(frozen=True)
class _Piece:
    """Points of one or more slices, and the volumes of the slices' hulls together."""

    points: Float[np.ndarray, "n 3"]
    volume: float


def slab_hulls(mesh: trimesh.Trimesh) -> tuple[Shape, ...]:
    """Convex parts of a handle; the space between its bar and what it is fixed to stays free.

    Args:
      mesh: Any triangle soup in the body frame, long compared to its thickness [m].
    """
    points = surface_points(mesh, SPACING)
    along = int(np.ptp(points, axis=0).argmax())
    low, length = float(points[:, along].min()), float(np.ptp(points[:, along]))
    count = int(np.clip(np.ceil(length / SLAB), 1, MAX_SLABS))
    edges = low + length * np.arange(count + 1) / count
    open_: list[_Piece] = []  # pieces of the slice before, which the next may continue
    done: list[_Piece] = []
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        inside = (points[:, along] >= start - SPACING) & (points[:, along] <= stop + SPACING)
        merged = []
        for slice_points in _connected(points[inside]):
            piece = _Piece(slice_points, _volume(slice_points))
            match = next((o for o in open_ if _continues(o, piece, along)), None)
            if match is not None:
                open_ = [o for o in open_ if o is not match]
                both = np.concatenate([match.points, piece.points])
                piece = _Piece(both, match.volume + piece.volume)
            merged.append(piece)
        done += open_
        open_ = merged
    hulls = []
    for piece in (*done, *open_):
        try:
            hulls.append(reduced_hull(piece.points, VERTICES))
        except QhullError:  # flat: the pieces around it say enough
            continue
    return tuple(Shape("mesh", mesh=hull) for hull in hulls)


def _connected(points: Float[np.ndarray, "n 3"]) -> list[np.ndarray]:
    if not len(points):
        return []
    cells = np.floor((points - points.min(axis=0)) / (APART / 2)).astype(int)
    grid = np.zeros(tuple(cells.max(axis=0) + 1), bool)
    grid[tuple(cells.T)] = True
    labels, count = ndimage.label(grid, np.ones((3, 3, 3)))
    own = labels[tuple(cells.T)]
    return [points[own == k] for k in range(1, count + 1)]


def _continues(before: _Piece, piece: _Piece, along: int) -> bool:
    """Whether both have one cross-section, and together are as convex as their slices are alone."""
    ends = [
        np.delete(np.stack([p.points.min(axis=0), p.points.max(axis=0)]), along, axis=1)
        for p in (before, piece)
    ]
    if np.abs(ends[0] - ends[1]).max() > STEP:
        return False
    whole = _volume(np.concatenate([before.points, piece.points]))
    return 0 < whole <= (1 + SPARE) * (before.volume + piece.volume)


def _volume(points: Float[np.ndarray, "n 3"]) -> float:
    try:
        return float(ConvexHull(points).volume)
    except QhullError:  # flat
        return 0.0
