"""The other one of a pair of handles: double doors have them side by side in the middle of the front."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.furniture.shapes.handle_shape import run_around

_STANDING = (0.012, 0.09)  # how far points of handles are before the front [m]
_APART = 0.16  # of the two, at most [m]
_GAP = 0.015  # between handles at least, across [m]
_AS_HIGH = 0.03  # how far both may differ, upright [m]
_AS_WIDE = 0.02  # the same, across [m]
_AS_MANY = 0.4  # of the points of one that the other shows, at least
_FEW = 12  # points of a handle, at least


def twin_of(
    points: Float[np.ndarray, "n 3"], handle: PoseLabel, front: float
) -> Float[np.ndarray, "3"] | None:
    """Where another handle of the same size stands out of the front beside one; None where there is none.

    Args:
      points: Of the furniture, object frame, X out of the front and Z up [m].
      handle: Of a shut door, object frame.
      front: Of it, along X [m].
    """
    half = np.abs(handle.rotation) @ handle.extents / 2
    local = points - handle.origin
    ahead = points[:, 0] - front
    row = (ahead > _STANDING[0]) & (ahead < _STANDING[1])
    row &= (np.abs(local[:, 1]) < _APART + half[1]) & (np.abs(local[:, 2]) < half[2] + _AS_HIGH)
    own = row & (np.abs(local[:, 1]) < half[1] + _GAP / 2)
    if own.sum() < _FEW:
        return None
    beside = [
        _run(local, row & (np.sign(local[:, 1]) == side) & ~own, side) for side in (-1.0, 1.0)
    ]
    twins = [local[on] for on in beside if _alike(local[own], local[on])]
    if not twins:
        return None
    middles = [(twin.min(axis=0) + twin.max(axis=0)) / 2 for twin in twins]
    nearest = min(middles, key=lambda middle: abs(middle[1]))
    return handle.origin + np.array([0.0, nearest[1], 0.0])


def _run(
    local: Float[np.ndarray, "n 3"], on: Bool[np.ndarray, "n"], side: float
) -> Bool[np.ndarray, "n"]:
    """Of these points, the first run across without a gap."""
    if not on.any():
        return on
    away = side * local[:, 1]
    first = float(away[on].min())
    _, end = run_around(away[on] - first, _GAP)
    return on & (away <= first + end)


def _alike(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "m 3"]) -> bool:
    """Whether two sets of points may show two handles of one kind."""
    if len(other) < max(_FEW, _AS_MANY * len(one)):
        return False
    differ = np.abs(np.ptp(other, axis=0) - np.ptp(one, axis=0))
    level = abs(float(np.median(other[:, 2]) - np.median(one[:, 2])))
    return bool(differ[1] < _AS_WIDE and differ[2] < _AS_HIGH and level < _AS_HIGH / 2)
