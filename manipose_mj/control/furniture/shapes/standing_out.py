"""What stands out of a front as handles do: the other one of a pair, and those of a column."""

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
# A margin around a handle, and how near the front it shows the front [m], on so many of four sides: a level bar's ends are
# beside little of it.
_AROUND, _FLUSH, _SIDES_OF_BAR = 0.025, 0.008, 2


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
        _run(side * local[:, 1], row & (np.sign(local[:, 1]) == side) & ~own)
        for side in (-1.0, 1.0)
    ]
    twins = [local[on] for on in beside if _alike(local[own], local[on])]
    if not twins:
        return None
    middles = [(twin.min(axis=0) + twin.max(axis=0)) / 2 for twin in twins]
    nearest = min(middles, key=lambda middle: abs(middle[1]))
    return handle.origin + np.array([0.0, nearest[1], 0.0])


def column_of(
    points: Float[np.ndarray, "n 3"], handle: PoseLabel, front: float
) -> list[Float[np.ndarray, "3"]]:
    """Where other handles of the same size stand out of the front above and below one.

    Args:
      points: Of the furniture, object frame, X out of the front and Z up [m].
      handle: Of a shut part, object frame.
      front: Of it, along X [m].
    """
    half = np.abs(handle.rotation) @ handle.extents / 2
    local, ahead = points - handle.origin, points[:, 0] - front
    out = (ahead > _STANDING[0]) & (ahead < _STANDING[1])
    column = out & (np.abs(local[:, 1]) < half[1] + _AS_WIDE)
    beside = out & ~column & (np.abs(local[:, 1]) < half[1] + 2 * _AS_WIDE)
    flush = local[np.abs(ahead) < _FLUSH, 1:]
    own = column & (np.abs(local[:, 2]) < half[2] + _GAP / 2)
    if own.sum() < _FEW:
        return []
    found = []
    for side in (-1.0, 1.0):
        away = side * local[:, 2]
        rest = column & (away > 0) & ~own
        while (on := _run(away, rest)).any():
            rest &= away > away[on].max()
            low, high = local[on].min(axis=0), local[on].max(axis=0)
            plumb = abs(float(np.median(local[on, 1]) - np.median(local[own, 1]))) < _AS_WIDE / 2
            # The edge of a board goes on beside the column.
            goes_on = beside & (local[:, 2] > low[2]) & (local[:, 2] < high[2])
            alike = plumb and goes_on.sum() < _FEW and _as_large(local[own], local[on])
            if alike and _shown_around(flush, low[1:], high[1:]) >= _SIDES_OF_BAR:
                found.append(handle.origin + np.array([0.0, 0.0, (low[2] + high[2]) / 2]))
    return found


def _shown_around(
    flush: Float[np.ndarray, "n 2"], low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]
) -> int:
    """On how many of the four sides of a rectangle the front shows."""
    beside = (flush > low - _AROUND) & (flush < high + _AROUND)
    within = (flush > low) & (flush < high)
    sides = 0
    for axis in range(2):
        strip = beside[:, axis] & within[:, 1 - axis]
        for on in (flush[:, axis] < low[axis], flush[:, axis] > high[axis]):
            sides += int((strip & on).sum()) >= _FEW
    return sides


def _run(away: Float[np.ndarray, "n"], on: Bool[np.ndarray, "n"]) -> Bool[np.ndarray, "n"]:
    """Of these points, the first run without a gap that is more than stray points, by how far away they are [m]."""
    while on.any():
        first = float(away[on].min())
        _, end = run_around(away[on] - first, _GAP)
        run = on & (away <= first + end)
        if run.sum() >= _FEW:
            return run
        on = on & ~run
    return on


def _alike(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "m 3"]) -> bool:
    """Whether two sets of points may show two handles of one kind, side by side."""
    if not _as_large(one, other):
        return False
    level = abs(float(np.median(other[:, 2]) - np.median(one[:, 2])))
    return level < _AS_HIGH / 2


def _as_large(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "m 3"]) -> bool:
    """Whether the second set of points shows as much, as wide and as high as the first."""
    if len(other) < max(_FEW, _AS_MANY * len(one)):
        return False
    differ = np.abs(np.ptp(other, axis=0) - np.ptp(one, axis=0))
    return bool(differ[1] < _AS_WIDE and differ[2] < _AS_HIGH)
