"""Normals of a cloud whose depth image is gone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

NEIGHBOURS = 16


def cloud_normals(
    points: Float[np.ndarray, "n 3"], rows: Int[np.ndarray, "m"] | None = None
) -> Float[np.ndarray, "m 3"]:
    """Unit normals towards the camera: of the plane through each point's nearest neighbours.

    Where the depth image is at hand, `depth_normals` knows more: it sees which surface ends.

    Args:
      points: At least three [m], camera frame, the camera at the origin.
      rows: Of the points whose normals are wanted; all by default.
    """
    count = min(NEIGHBOURS, len(points))
    wanted = points if rows is None else points[rows]
    _, nearest = cKDTree(points).query(wanted, k=count)
    near = points[nearest].astype(np.float64)
    near -= near.mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(near.swapaxes(1, 2) @ near)[1][:, :, 0]
    away = np.sum(normals * wanted, axis=1, keepdims=True) > 0
    return np.where(away, -normals, normals).astype(np.float32)
