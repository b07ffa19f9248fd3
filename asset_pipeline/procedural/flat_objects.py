"""What flat things that lie on a table have in common: a notebook's and a wallet's label and prints."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.poses import SymmetryGroup

# Of what is alike from above and below: half a turn about Y.
OVER = SymmetryGroup.generated(np.diag([-1.0, 1.0, -1.0])[None])
# Columns X, Y, Z of the label of a plain slab whose longer side lies along y: X is up, Y is y.
LONG_Y = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])


def along_face(face: Float[np.ndarray, "4 4"], at: tuple[float, float]) -> Float[np.ndarray, "4 4"]:
    """The frame of a face moved within it, along its x and y [m]."""
    pose = face.copy()
    pose[:3, 3] += face[:3, :2] @ np.array(at, float)
    return pose
