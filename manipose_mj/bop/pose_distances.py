"""Distances between an estimated and a true pose of a known shape, as BOP defines them.

Hodan et al., "BOP Challenge 2020 on 6D object localization" (ECCVW 2020), section 2.2: MSSD and MSPD. Hinterstoisser
et al., "Model based training, detection and pose estimation of texture-less 3D objects in heavily cluttered scenes"
(ACCV 2012): ADD, and ADD-S, which BOP calls ADI. Poses are `T_camera_model`; any unit of length.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from manipose_mj.poses import transform

_FEW = 64  # vertices that a symmetry is first looked at with

Poses = Float[np.ndarray, "k 4 4"]
Points = Float[np.ndarray, "n 3"]


def mssd(
    estimate: Float[np.ndarray, "4 4"],
    truth: Float[np.ndarray, "4 4"],
    symmetries: Poses,
    vertices: Points,
) -> float:
    """Maximum symmetry-aware surface distance: of the farthest vertex, the least over the symmetries.

    Args:
      estimate: `T_camera_model`.
      truth: `T_camera_model`.
      symmetries: Maps of the model onto itself, model frame, the identity among them.
      vertices: Of the model.
    """

    def apart(some: Poses, points: Points) -> Float[np.ndarray, "k"]:
        moved = transform(truth @ some, points) - transform(estimate, points)
        return np.linalg.norm(moved, axis=-1).max(axis=-1)

    return _least(apart, symmetries, vertices)


def mspd(
    estimate: Float[np.ndarray, "4 4"],
    truth: Float[np.ndarray, "4 4"],
    symmetries: Poses,
    vertices: Points,
    matrix: Float[np.ndarray, "3 3"],
) -> float:
    """Maximum symmetry-aware projection distance [pixels]; arguments as of `mssd`.

    Args:
      estimate: `T_camera_model`.
      truth: `T_camera_model`.
      symmetries: Maps of the model onto itself.
      vertices: Of the model.
      matrix: The camera's K.
    """

    def apart(some: Poses, points: Points) -> Float[np.ndarray, "k"]:
        moved = _projected(matrix, truth @ some, points) - _projected(matrix, estimate, points)
        return np.nan_to_num(np.linalg.norm(moved, axis=-1), nan=np.inf).max(axis=-1)

    return _least(apart, symmetries, vertices)


def add(
    estimate: Float[np.ndarray, "4 4"], truth: Float[np.ndarray, "4 4"], vertices: Points
) -> float:
    """Average distance of the vertices from where they should be."""
    apart = transform(estimate, vertices) - transform(truth, vertices)
    return float(np.linalg.norm(apart, axis=-1).mean())


def add_s(
    estimate: Float[np.ndarray, "4 4"], truth: Float[np.ndarray, "4 4"], vertices: Points
) -> float:
    """Average distance of the true vertices from the nearest estimated ones, for objects with symmetries."""
    apart, _ = cKDTree(transform(estimate, vertices)).query(transform(truth, vertices))
    return float(apart.mean())


def _projected(
    matrix: Float[np.ndarray, "3 3"], poses: Float[np.ndarray, "*b 4 4"], points: Points
) -> Float[np.ndarray, "*b n 2"]:
    with np.errstate(divide="ignore", invalid="ignore"):
        image = transform(poses, points) @ matrix.T
        return image[..., :2] / image[..., 2:]


def _least(
    apart: Callable[[Poses, Points], Float[np.ndarray, "k"]], symmetries: Poses, vertices: Points
) -> float:
    """The least over the symmetries of a maximum over the vertices.

    A few vertices bound each maximum from below; from the most promising symmetry on, all are looked at, until the
    bound of the next is no better than what was found.
    """
    bounds = apart(symmetries, vertices[:: max(len(vertices) // _FEW, 1)])
    least = np.inf
    for row in np.argsort(bounds, kind="stable"):
        if bounds[row] >= least:
            break
        least = min(least, float(apart(symmetries[row : row + 1], vertices)[0]))
    return float(least)
