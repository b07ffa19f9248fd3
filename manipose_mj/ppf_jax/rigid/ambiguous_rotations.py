"""The frames that a right one is mistaken for: half a turn off, turned about X, a box's axes exchanged.

What is seen of an object often looks much alike in them, so a correction from one never leads to the
right frame: each has to be tried. None is equivalent to the frame itself, nor two to each other.
"""

from __future__ import annotations

from functools import cache
from itertools import permutations

import numpy as np
from jaxtyping import Float

from manipose_mj.poses import rotation_about
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry

_TURNS = 8  # about X
_X, _Y, _Z = np.eye(3)


@cache
def ambiguous_rotations(symmetry: CommonSymmetry) -> Float[np.ndarray, "r 3 3"]:
    """Turns in the label frame, `rotation @ turn`; not the identity.

    An axis of revolution can be upside down, a box can have any axis for any other; everything else
    can be upside down, back to front, or turned about X, and have any axis, either way, for any other
    where there are boxes among it: a camera or a clock is then mistaken for one.

    Args:
      symmetry: What makes frames equivalent.
    """
    members = [np.eye(3), *_members(symmetry)]
    known = list(members)
    chosen = []
    for turn in _candidates(symmetry):
        if not any(np.allclose(turn, other, atol=1e-6) for other in known):
            chosen.append(turn)
            known += [turn @ member for member in members]
    return np.array(chosen, np.float32).reshape(-1, 3, 3)


def _members(symmetry: CommonSymmetry) -> list[Float[np.ndarray, "3 3"]]:
    """What leaves the shape of every object unchanged; of an axis of revolution, the flip."""
    members = []
    if symmetry.unsigned_y:
        members.append(rotation_about(_X, np.pi))
    if symmetry.unsigned_x and (symmetry.unsigned_y or symmetry.axial):
        members += [rotation_about(_Y, np.pi), rotation_about(_Z, np.pi)]
    return members


def _candidates(symmetry: CommonSymmetry) -> list[Float[np.ndarray, "3 3"]]:
    if symmetry.axial:
        return [rotation_about(_Y, np.pi)]
    axes = [np.eye(3)[:, list(order)] for order in permutations(range(3))]
    exchanged = [each * np.linalg.det(each) for each in axes]
    if symmetry.unsigned_x and symmetry.unsigned_y:
        return exchanged
    half_turns = [rotation_about(axis, np.pi) for axis in (_Y, _Z)]
    turns = half_turns + [rotation_about(_X, 2 * np.pi * i / _TURNS) for i in range(1, _TURNS)]
    if not symmetry.boxes:
        return turns
    every_half_turn = [np.eye(3), rotation_about(_X, np.pi), *half_turns]
    return turns + [each @ half for each in exchanged for half in every_half_turn]
