"""Surface points in opposing pairs: where two pads could press against each other."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.touch_points import SurfacePoints

FRICTION = 0.5  # of the cones; below the real one, so that small errors of pose do no harm
SLACK = 0.01  # in the cosine, against the best partner of a point: about 8 degrees
MIN_WIDTH = 0.001  # spoons and forks are little thicker than this [m]
WALL = 0.01  # walls further apart than this are grasped each by itself [m]


def antipodal_pairs(
    cloud: SurfacePoints, gripper: ParallelJaw, seeds: Int[np.ndarray, "s"]
) -> Int[np.ndarray, "p 2"]:
    """Pairs of points that lie within the hand's reach across the object.

    Both normals lie within the friction cones about the closing direction, which is their mean and
    joins the points to within the spacing of the cloud. A point may be in several pairs: a mug's
    outside pairs with its inside and with its far side.

    Args:
      cloud: The object's surface.
      gripper: Its opening bounds the distance.
      seeds: The first point of each pair, as indices into `cloud`.

    Returns:
      Indices into `cloud`: the seed and its partner, by seed and then by distance.
    """
    points, normals = cloud.points.T.astype(np.float32), cloud.normals.T.astype(np.float32)
    cone = np.cos(np.arctan(FRICTION))
    widest = gripper.max_opening - gripper.min_clearance
    first, other = _roughly(points, normals, seeds, cone, widest, cloud.spacing)
    seed = seeds[first]
    alike = (normals[:, seed] * normals[:, other]).sum(axis=0)
    facing = np.sqrt(0.5 - 0.5 * alike)  # cosine of either normal to their mean
    offset = points[:, other] - points[:, seed]
    closing = (normals[:, other] - normals[:, seed]) / (2 * facing)
    along = (offset * closing).sum(axis=0)
    aside = np.sqrt(np.maximum((offset * offset).sum(axis=0) - along**2, 0.0))
    fits = (facing > cone) & (aside < cloud.spacing) & (along > MIN_WIDTH) & (along < widest)
    first, other, facing = first[fits], other[fits], facing[fits]
    along, aside = along[fits], aside[fits]
    # Across a cylinder every chord has parallel normals to some degree: keep the diameter.
    best = np.zeros(len(seeds), np.float32)
    np.maximum.at(best, first, facing)
    kept = np.flatnonzero(facing > best[first] - SLACK)
    # Of each wall behind a point, the partner that opposes it best.
    wall = np.floor(along[kept] / WALL).astype(int)
    order = np.lexsort((aside[kept] / WALL - facing[kept], wall, first[kept]))
    key = np.stack([first[kept], wall])[:, order]
    new = np.r_[True, (np.diff(key) != 0).any(axis=0)][: len(order)]
    index = kept[order[new]]
    return np.stack([seeds[first[index]], other[index]], axis=1)


def _roughly(
    points: Float[np.ndarray, "3 n"],
    normals: Float[np.ndarray, "3 n"],
    seeds: Int[np.ndarray, "s"],
    cone: float,
    widest: float,
    spacing: float,
) -> tuple[Int[np.ndarray, "k"], Int[np.ndarray, "k"]]:
    """Position in `seeds` and index of the partner of all pairs that may fit, and of some more.

    Looser by a hundredth than what follows, so that the rounding of the matrix products is nothing.
    """
    square = (points * points).sum(axis=0)
    here, facing = points[:, seeds].T, normals[:, seeds].T
    alike = facing @ normals
    far = square[seeds, None] + square - 2 * (here @ points)  # squared distance
    along = facing @ points - (facing * here).sum(axis=1)[:, None]
    # The closing direction leans by an angle from the seed's normal whose sine is known.
    lean = np.maximum(0.51 + 0.5 * alike, 0.0)
    fits = (alike < 1.02 - 2 * cone**2) & (far < 1.05 * widest**2)
    fits &= far - along * along < 2.1 * (far * lean + spacing**2)
    first, other = np.nonzero(fits & (along < 0))
    return first, other
