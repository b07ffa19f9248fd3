"""Surface points in opposing pairs: where two pads could press against each other."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float, Int

from asset_pipeline.gripper import ParallelJaw

SPACING = 0.003  # between surface points, where the surface is not too large for it [m]
MAX_POINTS = 8000
SEEDS = 500
FRICTION = 0.5  # of the cones; below the real one, so that small errors of pose do no harm
SLACK = 0.01  # in the cosine, against the best partner of a point: about 8 degrees
MIN_WIDTH = 0.002
WALL = 0.01  # walls further apart than this are grasped each by itself [m]


def surface_points(
    mesh: trimesh.Trimesh, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"], float]:
    """Evenly spread points of a surface, their outward normals, and their spacing [m].

    Area-weighted random points, thinned to one in each cell of a grid and direction of normal, so
    that both sides of a thin wall keep theirs.
    """
    spacing = max(SPACING, float(np.sqrt(mesh.area / MAX_POINTS)))
    count = int(5 * mesh.area / spacing**2) + 100
    corners = np.asarray(mesh.triangles)
    areas = np.asarray(mesh.area_faces)
    faces = rng.choice(len(areas), size=count, p=areas / areas.sum())
    u, v = rng.random((2, count, 1))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    a, b, c = corners[faces].transpose(1, 0, 2)
    points = a + u * (b - a) + v * (c - a)
    normals = np.asarray(mesh.face_normals)[faces]
    first = first_in_cells(np.hstack([points / spacing, normals + 0.5]))
    return points[first], normals[first], spacing


def first_in_cells(values: Float[np.ndarray, "n d"]) -> Int[np.ndarray, "k"]:
    """Indices, ascending, of the first row in each cell of the unit grid."""
    _, first = np.unique(np.floor(values).astype(int), axis=0, return_index=True)
    return np.sort(first)


def antipodal_pairs(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    spacing: float,
    gripper: ParallelJaw,
    rng: np.random.Generator,
) -> Int[np.ndarray, "pairs 2"]:
    """Pairs of points that lie within the hand's reach across the object.

    Both normals lie within the friction cones about the closing direction, which is their mean and
    joins the points to within the spacing of the cloud. A point may be in several pairs: a mug's
    outside pairs with its inside and with its far side.

    Args:
      points: Of the surface [m].
      normals: Outward, unit.
      spacing: Of the points [m].
      gripper: Its opening bounds the distance.
      rng: Picks the first point of each pair.
    """
    seeds = rng.permutation(len(points))[:SEEDS]
    cone = np.cos(np.arctan(FRICTION))
    widest = gripper.max_opening - gripper.min_clearance
    pairs = []
    for i in seeds:
        closing = normals - normals[i]
        length = np.linalg.norm(closing, axis=1)
        closing /= np.maximum(length, 1e-9)[:, None]
        facing = length / 2  # cosine between either normal and the closing direction
        offset = points - points[i]
        along = np.einsum("ni,ni->n", offset, closing)
        aside = np.linalg.norm(offset - along[:, None] * closing, axis=1)
        fits = (facing > cone) & (aside < spacing) & (along > MIN_WIDTH) & (along < widest)
        # Across a cylinder every chord has parallel normals to some degree: keep the diameter.
        fits &= facing > np.max(facing, where=fits, initial=0.0) - SLACK
        options = np.flatnonzero(fits)
        wall = np.floor(along[options] / WALL).astype(int)
        for w in np.unique(wall):  # of each wall behind the point, the partner that opposes it best
            same = options[wall == w]
            pairs.append((i, same[np.argmax(facing[same] - aside[same] / WALL)]))
    return np.array(pairs, int).reshape(-1, 2)
