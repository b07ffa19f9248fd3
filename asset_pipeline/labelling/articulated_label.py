"""The label of an articulated object as a whole: its box, with X up and Y out of the front."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from manipose_mj.assets.geometry import Body
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup


def articulated_label(bodies: Sequence[Body]) -> PoseLabel:
    """Of bodies in a frame whose z is up and whose front is towards -x, everything shut."""
    surface = trimesh.util.concatenate([body.surface() for body in bodies])
    low, high = surface.bounds
    # X up, Y out of the front, Z to the right of who stands before it.
    rotation = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    return PoseLabel(
        origin=(low + high) / 2,
        rotation=rotation,
        object_type="articulated",
        extents=np.abs(rotation.T @ (high - low)),
        symmetry=SymmetryGroup.identity(),
    )
