"""Surface points in opposing pairs: where two pads could press against each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asset_pipeline.gripper import ParallelJaw
from asset_pipeline.touch_points import SurfacePoints

SEEDS = 2000
FRICTION = 0.5  # of the cones; below the real one, so that small errors of pose do no harm
SLACK = 0.01  # in the cosine, against the best partner of a point: about 8 degrees
MIN_WIDTH = 0.002
WALL = 0.01  # walls further apart than this are grasped each by itself [m]


def antipodal_pairs(
    cloud: SurfacePoints, gripper: ParallelJaw, rng: np.random.Generator
) -> Iterator[tuple[int, int]]:
    """Pairs of points that lie within the hand's reach across the object.

    Both normals lie within the friction cones about the closing direction, which is their mean and
    joins the points to within the spacing of the cloud. A point may be in several pairs: a mug's
    outside pairs with its inside and with its far side.

    Args:
      cloud: The object's surface.
      gripper: Its opening bounds the distance.
      rng: Picks the first point of each pair.
    """
    points, normals = cloud.points.astype(np.float32), cloud.normals.astype(np.float32)
    cone = np.cos(np.arctan(FRICTION))
    widest = gripper.max_opening - gripper.min_clearance
    for i in rng.permutation(len(points))[:SEEDS].tolist():
        facing = np.sqrt(np.maximum(0.5 - 0.5 * np.einsum("ni,i->n", normals, normals[i]), 0.0))
        opposed = np.flatnonzero(facing > cone)  # cosine of either normal to their mean
        closing = (normals[opposed] - normals[i]) / (2 * facing[opposed, None])
        offset = points[opposed] - points[i]
        along = np.einsum("ni,ni->n", offset, closing)
        aside = np.linalg.norm(offset - along[:, None] * closing, axis=1)
        facing = facing[opposed]
        fits = (aside < cloud.spacing) & (along > MIN_WIDTH) & (along < widest)
        # Across a cylinder every chord has parallel normals to some degree: keep the diameter.
        fits &= facing > np.max(facing, where=fits, initial=0.0) - SLACK
        options = np.flatnonzero(fits)
        wall = np.floor(along[options] / WALL).astype(int)
        for w in np.unique(wall):  # of each wall behind the point, the partner that opposes it best
            same = options[wall == w]
            best = same[np.argmax(facing[same] - aside[same] / WALL)]
            yield i, int(opposed[best])
