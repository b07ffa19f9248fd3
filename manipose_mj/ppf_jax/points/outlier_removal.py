"""Points of a bare cloud that lie alone and so belong to no surface."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

_NEIGHBOURS = 6
_DENSE = 0.3  # share of the points that are taken to lie on a surface, even among many outliers
_FARTHER = 3.0  # than on these, a point that lies alone has its neighbours
_LEAST = 0.4  # share of the points below which the rule is not believed


def not_alone(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Which points have neighbours about as near as the denser part of the cloud has.

    Of noisy views of the catalogue 2 % go, most of them background; of outliers spread over the
    object's surroundings nine in ten, where they are a third of the cloud.

    Args:
      points: At least one [m]; all are kept where most would go.
    """
    count = min(_NEIGHBOURS + 1, len(points))
    reach = cKDTree(points).query(points, k=[count])[0][:, 0]
    kept = reach <= _FARTHER * np.quantile(reach, _DENSE)
    return kept if kept.mean() >= _LEAST else np.ones(len(points), bool)
