"""Normals of a cloud whose depth image is gone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

NEIGHBOURS = 16
_LINE = 1e-12  # points with a spread across them of this share of their spread lie on a line


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
    requested = points if rows is None else points[rows]
    _, nearest = cKDTree(points).query(requested, k=count)
    near = points.astype(np.float64).T.take(nearest, axis=1)
    near -= near.mean(axis=2, keepdims=True)
    normals = _flattest(np.einsum("ink,jnk->ijn", near, near))
    away = np.sum(normals * requested, axis=1, keepdims=True) > 0
    return np.where(away, -normals, normals).astype(np.float32)


def _flattest(spread: Float[np.ndarray, "3 3 m"]) -> Float[np.ndarray, "m 3"]:
    """Unit eigenvectors of the least eigenvalues of symmetric matrices, whose axis comes last.

    In closed form (Smith, Communications of the ACM 4, 1961): LAPACK takes several times as long for
    matrices as small as these. It gets those of points on a line, whose normal is any that fits.
    """
    (a, d, e), (_, b, f), (_, _, c) = spread
    middle = (a + b + c) / 3
    a, b, c = a - middle, b - middle, c - middle
    size = np.sqrt((a**2 + b**2 + c**2 + 2 * (d**2 + e**2 + f**2)) / 6)
    det = a * (b * c - f**2) - d * (d * c - f * e) + e * (d * f - b * e)
    cosine = det / np.maximum(2 * size**3, np.finfo(float).tiny)
    least = 2 * size * np.cos((np.arccos(np.clip(cosine, -1, 1)) + 2 * np.pi) / 3)
    a, b, c = a - least, b - least, c - least
    # The adjugate of a matrix that takes the wanted vector to 0: each column is a multiple of it.
    xy, xz, yz = f * e - d * c, d * f - b * e, d * e - a * f
    adjugate = np.array([[b * c - f**2, xy, xz], [xy, a * c - e**2, yz], [xz, yz, a * b - d**2]])
    each = np.arange(len(size))
    longest = adjugate[:, np.argmax(adjugate[[0, 1, 2], [0, 1, 2]], axis=0), each].T
    length = np.linalg.norm(longest, axis=1)
    vague = length <= _LINE * size**2
    longest[vague] = np.linalg.eigh(np.moveaxis(spread[:, :, vague], 2, 0))[1][:, :, 0]
    return longest / np.where(vague, 1.0, length)[:, None]
