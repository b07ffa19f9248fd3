"""How far the space behind an opening goes on where cameras look through it: past a side that is a guess, such as the
edge of a door beside whose neighbour nothing divides them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float

# Which points, object frame [m], some camera looks past: what it sees there is behind them.
Past = Callable[[Float[np.ndarray, "n 3"]], Bool[np.ndarray, "n"]]

_STEP = 0.01  # by which a side is moved [m]
_SHELL = 0.02  # of the body, that is never seen through [m]
_SHARE = 0.4  # of the probes, that have to be free
_PROBES = 7  # along either side of a face
_NEAR_MOUTH = 0.6  # share of the depth, from the mouth on, that is probed: less of the rest shows
_INSET = 0.15  # share of a face that is left out along its edges


def widened(
    hole: Float[np.ndarray, "2 3"], body: Float[np.ndarray, "2 3"], past: Past
) -> Float[np.ndarray, "2 3"]:
    """A hole whose sides are where cameras no longer look past them: left, right, above and behind.

    Args:
      hole: Low and high corner, object frame, X out of the mouth [m].
      body: Of the furniture: low and high corner [m]. The hole stays within it.
      past: Which points some camera looks past.
    """
    hole = hole.copy()
    for axis, end in ((1, 0), (1, 1), (2, 1), (0, 0)):
        sign = 2 * end - 1
        limit = body[end, axis] - sign * _SHELL
        while sign * (limit - hole[end, axis]) > _STEP:
            side = hole[end, axis] + sign * _STEP
            if past(_face(hole, axis, side)).mean() < _SHARE:
                break
            hole[end, axis] = side
    return hole


def _face(hole: Float[np.ndarray, "2 3"], axis: int, side: float) -> Float[np.ndarray, "n 3"]:
    """Probes on a side of a hole."""
    low, high = hole.copy()
    low[0] = high[0] - _NEAR_MOUTH * (high[0] - low[0])
    inset = _INSET * (high - low)
    low, high = low + inset, high - inset
    low[axis] = high[axis] = side
    spans = [np.linspace(low[i], high[i], 1 if i == axis else _PROBES) for i in range(3)]
    return np.stack(np.meshgrid(*spans, indexing="ij"), axis=-1).reshape(-1, 3)
