"""Where the symmetry of an object puts what is seen of it as well."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.label import ObjectType
from manipose_mj.poses import SymmetryGroup

_TURNS = 24  # of a cloud about its axis of revolution


def symmetry_turns(
    object_type: ObjectType, symmetry: SymmetryGroup
) -> list[Float[np.ndarray, "3 3"]]:
    """The rotations and reflections of the label frame that complete a cloud, the identity the first.

    What is round is revolved, what has planes is mirrored.
    """
    turns = list(symmetry.rotations)
    if symmetry.axial:
        angles = np.linspace(0, 2 * np.pi, _TURNS, endpoint=False)
        about = [
            np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
            for a in angles
        ]
        turns = [turn @ other for turn in turns for other in about]
    if object_type == "mirror":  # XY is a plane of all of these
        turns += [turn @ np.diag([1.0, 1.0, -1.0]) for turn in turns]
    return turns
