"""The rotations that a cloud cannot tell apart: the symmetry of an object of which nothing is known but what is seen."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations, product

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from manipose_mj.assets.label import ObjectType
from manipose_mj.poses import SymmetryGroup

_OFF = (
    0.0015  # how much further rotated points may lie from the surface than they did, on average [m]
)
_THROUGH = 0.0005  # how far in front of what cameras measured they may lie on average [m]
_FAR = 0.02  # [m]


def estimated_symmetry(
    object_type: ObjectType,
    points: Float[np.ndarray, "n 3"],
    surface: Float[np.ndarray, "m 3"],
    center: Float[np.ndarray, "3"],
    looked_through: Callable[[Float[np.ndarray, "n 3"]], float],
) -> SymmetryGroup:
    """The turns about the label's axes that bring what is seen onto the surface, and nowhere that is seen to be empty.

    Args:
      object_type: What is `axial` has its axis, and perhaps two ends alike.
      points: Seen, label frame [m].
      surface: Of the completed shape, label frame [m].
      center: Of its bounding box: the origin of an estimate may be off [m].
      looked_through: How far points of the label frame lie in front of what cameras measured, on average [m].
    """
    tree = cKDTree(surface)

    def distance(moved: Float[np.ndarray, "n 3"]) -> float:
        return float(np.minimum(tree.query(moved, distance_upper_bound=_FAR)[0], _FAR).mean())

    axial = object_type == "axial"
    most = distance(points) + _OFF
    found: list[tuple[float, Float[np.ndarray, "3 3"]]] = []
    for turn in _half_turn_about_y() if axial else _turns():
        moved = (points - center) @ turn.T + center
        off = distance(moved)
        if off < most and looked_through(moved) < _THROUGH:
            found.append((off, turn))
    return SymmetryGroup(_closed(found), axial=axial)


def _turns() -> list[Float[np.ndarray, "3 3"]]:
    """The rotations that exchange axes, but for the identity."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(turn) > 0 and not np.array_equal(turn, np.eye(3)):
            found.append(turn)
    return found


def _half_turn_about_y() -> list[Float[np.ndarray, "3 3"]]:
    return [np.diag([-1.0, 1.0, -1.0])]


def _closed(found: list[tuple[float, Float[np.ndarray, "3 3"]]]) -> Float[np.ndarray, "k 3 3"]:
    """A group, from turns with their distances: the worst goes until all products are among them."""
    kept = [np.eye(3), *(turn for _, turn in sorted(found, key=lambda each: each[0]))]

    def within(turn: Float[np.ndarray, "3 3"]) -> bool:
        return any(np.allclose(turn, other) for other in kept)

    while not all(within(one @ other) for one in kept for other in kept):
        missed = [sum(not within(one @ other) for other in kept) for one in kept]
        worst = max(range(1, len(kept)), key=lambda row: (missed[row], row))
        kept.pop(worst)
    return np.stack(kept)
