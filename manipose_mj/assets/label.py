"""The unified pose label of an object, and its symmetry as BOP stores it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.poses import SymmetryGroup, compose, rotation_angle

ObjectType = Literal["axial", "mirror", "functional", "handle", "articulated"]
OBJECT_TYPES: tuple[str, ...] = ("axial", "mirror", "functional", "handle", "articulated")


@dataclass(frozen=True)
class PoseLabel:
    """The label frame in the mesh frame.

    Attributes:
      origin: `(3,)` [m], the label's origin in the mesh frame.
      rotation: `(3, 3)`, columns are the label's X, Y, Z in the mesh frame.
      object_type: Which rule of the conventions fixed the axes.
      extents: `(3,)` [m], lengths of the bounding box along X, Y, Z.
      symmetry: Proper rotations, in the label frame, that leave the shape unchanged.
      print_symmetry: Those of them that leave the print unchanged as well, where it breaks some.
      center: `(3,)` [m], the middle of the bounding box in the label frame: beside the origin for tools.
    """

    origin: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]
    object_type: ObjectType
    extents: Float[np.ndarray, "3"]
    symmetry: SymmetryGroup
    print_symmetry: SymmetryGroup | None = None
    center: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))

    @property
    def symmetry_textured(self) -> SymmetryGroup:
        """The rotations that leave shape and print unchanged."""
        return self.symmetry if self.print_symmetry is None else self.print_symmetry

    @property
    def pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_mesh_label`."""
        return compose(self.rotation, self.origin)

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner of the bounding box in the label frame [m]."""
        return self.center + np.outer([-0.5, 0.5], self.extents)

    def reach(self, rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3"]:
        """Half the lengths that the object takes up along the axes of a frame [m].

        Those of its bounding box; of its cylinder, where its X is an axis of revolution.

        Args:
          rotation: `R_frame_label`.
        """
        half = self.extents / 2
        if not self.symmetry.axial:
            return np.abs(rotation) @ half
        along = np.abs(rotation[:, 0])
        return along * half[0] + np.sqrt(np.clip(1 - along**2, 0, 1)) * half[1:].max()


def symmetry_to_bop(label: PoseLabel, group: SymmetryGroup) -> dict[str, Any]:
    """`symmetries_discrete` and `symmetries_continuous` in the mesh frame, as in BOP's models_info.

    BOP's discrete list leaves the identity out; matrices are row-major 4x4.

    Args:
      label: Whose frame the group is in.
      group: The label's `symmetry` or `symmetry_textured`.
    """
    discrete = []
    for turn in group.rotations[1:]:
        rotation = label.rotation @ turn @ label.rotation.T
        matrix = compose(rotation, label.origin - rotation @ label.origin)
        discrete.append([float(v) for v in matrix.ravel()])
    continuous = []
    if group.axial:
        continuous.append(
            {
                "axis": [float(v) for v in label.rotation[:, 0]],
                "offset": [float(v) for v in label.origin],
            }
        )
    return {"symmetries_discrete": discrete, "symmetries_continuous": continuous}


def symmetry_from_bop(
    rotation: Float[np.ndarray, "3 3"], discrete: list[list[float]], continuous: list[dict]
) -> SymmetryGroup:
    """The group in the label frame, from BOP's mesh-frame lists and the label's rotation.

    Raises:
      ValueError: A continuous axis is not the label's X, or a matrix is not a proper rotation.
    """
    turns = [np.eye(3)]
    for matrix in discrete:
        turn = rotation.T @ np.asarray(matrix, float).reshape(4, 4)[:3, :3] @ rotation
        if abs(np.linalg.det(turn) - 1) > 1e-3 or not np.allclose(
            turn @ turn.T, np.eye(3), atol=1e-3
        ):
            raise ValueError("a discrete symmetry is not a proper rotation")
        if rotation_angle(turn, np.eye(3)) > 1e-6:
            turns.append(turn)
    for entry in continuous:
        if np.linalg.norm(np.cross(entry["axis"], rotation[:, 0])) > 1e-3:
            raise ValueError("a continuous symmetry's axis is not the label's X")
    return SymmetryGroup(np.stack(turns), axial=bool(continuous))
