"""Clouds made worse by a known share: points that belong to nothing, parts that nobody sees."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError

_SPREAD = 1.5  # outliers fill a ball of this many times the object's own radius
_LEAST = 3  # points are always left


def with_outliers(
    points: Float[np.ndarray, "n 3"], share: float, rng: np.random.Generator
) -> Float[np.ndarray, "n 3"]:
    """The same number of points, a share of them anywhere in a ball around the object.

    Args:
      points: [m].
      share: From 0 to 1, of all points.
      rng: Draws which, and where to.

    Raises:
      InputError: The share is none.
    """
    count = round(_checked(share) * len(points))
    middle = np.median(points, axis=0)
    radius = _SPREAD * np.quantile(np.linalg.norm(points - middle, axis=1), 0.95)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    worse = points.copy()
    rows = rng.permutation(len(points))[:count]
    worse[rows] = middle + radius * np.cbrt(rng.random((count, 1))) * directions
    return worse


def partly_hidden(
    points: Float[np.ndarray, "n 3"], share: float, rng: np.random.Generator
) -> Float[np.ndarray, "m 3"]:
    """What is left when a straight edge in front of the object covers a share of its points.

    Args:
      points: [m], camera frame (OpenCV's).
      share: From 0 to 1, of all points.
      rng: Draws the edge's direction in the image.

    Raises:
      InputError: The share is none.
    """
    angle = rng.uniform(0, 2 * np.pi)
    pixels = points[:, :2] / points[:, 2:]
    along = pixels @ np.array([np.cos(angle), np.sin(angle)])
    left = max(len(points) - round(_checked(share) * len(points)), min(_LEAST, len(points)))
    kept = np.sort(np.argsort(along, kind="stable")[:left])
    return points[kept]


def _checked(share: float) -> float:
    if not 0 <= share <= 1:
        raise InputError(f"share {share:g}; expected one from 0 to 1")
    return share
