"""Evenly spread points of a surface, and of a union of convex shapes as fingers would touch it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import trimesh
from jaxtyping import Float, Int

from manipose_mj.assets.geometry import Shape

MIN_SPACING = 0.003  # between points [m]
MAX_POINTS = 8000
# Deeper than this in another shape a point is not on the union's surface [m]; shapes that share a
# face touch there to within rounding.
_INSIDE = -0.0003


@dataclass(frozen=True)
class SurfacePoints:
    """Points `(n, 3)` [m] and outward normals `(n, 3)`, about `spacing` [m] apart."""

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    spacing: float

    def thinned(self, count: int, rng: np.random.Generator) -> SurfacePoints:
        """A random choice of at most `count` of them."""
        if len(self.points) <= count:
            return self
        chosen = np.sort(rng.choice(len(self.points), count, replace=False))
        spacing = self.spacing * float(np.sqrt(len(self.points) / count))
        return SurfacePoints(self.points[chosen], self.normals[chosen], spacing)


def surface_points(mesh: trimesh.Trimesh, rng: np.random.Generator) -> SurfacePoints:
    """Area-weighted random points, thinned to one for each cell of a grid and side of a wall.

    Args:
      mesh: The surface, normals outwards [m].
      rng: Draws the points.
    """
    spacing = max(MIN_SPACING, float(np.sqrt(mesh.area / MAX_POINTS)))
    count = int(4 * mesh.area / spacing**2) + 100
    corners, face_normals = np.asarray(mesh.triangles), np.asarray(mesh.face_normals)
    areas = np.asarray(mesh.area_faces)
    faces = rng.choice(len(areas), size=count, p=areas / areas.sum())
    u, v = rng.random((2, count, 1))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    a, b, c = corners[faces].transpose(1, 0, 2)
    points = a + u * (b - a) + v * (c - a)
    normals = face_normals[faces]
    # Both sides of a thin wall may fall into one cell; their rounded normals tell them apart.
    first = first_in_cells(np.hstack([points / spacing, normals + 0.5]))
    return SurfacePoints(points[first], normals[first], spacing)


def union_points(shapes: Sequence[Shape], rng: np.random.Generator) -> SurfacePoints:
    """Points of the outer surface of a union of convex shapes.

    Args:
      shapes: Convex, in one frame.
      rng: Draws the points.
    """
    meshes = [s.surface() for s in shapes]
    cloud = surface_points(cast(trimesh.Trimesh, trimesh.util.concatenate(meshes)), rng)
    if len(meshes) == 1:
        return cloud
    outside = np.ones(len(cloud.points), bool)
    for mesh in meshes:
        near = (cloud.points > mesh.bounds[0]).all(axis=1) & (cloud.points < mesh.bounds[1]).all(
            axis=1
        )
        index = np.flatnonzero(near & outside)
        normals = np.asarray(mesh.face_normals)
        levels = np.einsum("fi,fi->f", normals, np.asarray(mesh.triangles)[:, 0])
        depth = (cloud.points[index] @ normals.T - levels).max(axis=1, initial=-np.inf)
        outside[index[depth < _INSIDE]] = False
    return SurfacePoints(cloud.points[outside], cloud.normals[outside], cloud.spacing)


def first_in_cells(values: Float[np.ndarray, "n d"]) -> Int[np.ndarray, "k"]:
    """Indices, ascending, of the first row in each cell of the unit grid."""
    cells = np.floor(values).astype(np.int64)
    cells -= cells.min(axis=0, initial=0)
    key = np.zeros(len(cells), np.int64)
    for column in cells.T:
        key = key * (column.max(initial=0) + 1) + column
    return np.sort(np.unique(key, return_index=True)[1])
