"""Convex hulls with few vertices that stay close to the full hull."""

from __future__ import annotations

import manifold3d
import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

# Closer than this to the reduced hull, a point adds nothing a contact could notice [m].
CLOSE = 2e-5


def hull_parts(
    points: Float[np.ndarray, "n 3"], max_vertices: int, *, tolerance: float, max_parts: int = 8
) -> list[trimesh.Trimesh]:
    """The hull of the points as few convex parts of few vertices, each close to what it stands for.

    A hull whose reduction strays is cut in two across its longest side, and so on: round things
    need more vertices than one part may have.

    Args:
      points: Not all in one plane [m].
      max_vertices: Of one part; at least 8.
      tolerance: How far outside its part a corner of the full hull may lie [m].
      max_parts: Where to stop in any case; a power of two.

    Raises:
      scipy.spatial.QhullError: The points span no volume.
    """
    part = reduced_hull(points, max_vertices)
    corners = np.asarray(points)[ConvexHull(points).vertices]
    planes = ConvexHull(part.vertices).equations
    strays = float((corners @ planes[:, :3].T + planes[:, 3]).max())
    if strays <= tolerance or max_parts < 2:
        return [part]
    return [
        part
        for half in halves(corners)
        for part in hull_parts(half, max_vertices, tolerance=tolerance, max_parts=max_parts // 2)
    ]


def halves(points: Float[np.ndarray, "n 3"]) -> list[Float[np.ndarray, "m 3"]]:
    """The corners of either half of the points' hull, cut across the middle of its longest side."""
    low, high = points.min(axis=0), points.max(axis=0)
    axis = int(np.argmax(high - low))
    middle = float((low + high)[axis] / 2)
    whole = manifold3d.Manifold.hull_points(np.ascontiguousarray(points))
    cut = whole.split_by_plane(tuple(np.eye(3)[axis]), middle)
    return [np.asarray(half.to_mesh64().vert_properties)[:, :3] for half in cut]


def reduced_hull(points: Float[np.ndarray, "n 3"], max_vertices: int) -> trimesh.Trimesh:
    """The hull of at most `max_vertices` of the points, grown to the volume of all points' hull.

    The vertices are chosen greedily: always the point farthest outside the hull so far. Decimation
    by edge collapse loses several millimetres where this loses a fifth of that. Growing about the
    centre of mass shares what error is left between inside and outside.

    Args:
      points: Not all in one plane [m].
      max_vertices: At least 8.

    Raises:
      scipy.spatial.QhullError: The points span no volume.
    """
    full = ConvexHull(points)
    corners = np.asarray(points)[full.vertices]
    if len(corners) <= max_vertices:
        return trimesh.convex.convex_hull(corners)
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    chosen = list(dict.fromkeys(np.argmax(corners @ directions.T, axis=0).tolist()))
    while len(chosen) < max_vertices:
        try:
            planes = ConvexHull(corners[chosen]).equations
        except QhullError:  # these few still lie in one plane
            gaps = np.linalg.norm(corners[:, None] - corners[chosen], axis=2).min(axis=1)
            chosen.append(int(gaps.argmax()))
            continue
        outside = (corners @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        if outside.max() < CLOSE:
            break
        chosen.append(int(outside.argmax()))
    reduced = trimesh.convex.convex_hull(corners[chosen])
    growth = (full.volume / reduced.volume) ** (1 / 3)
    center = reduced.center_mass
    reduced.vertices = center + growth * (reduced.vertices - center)
    return reduced
