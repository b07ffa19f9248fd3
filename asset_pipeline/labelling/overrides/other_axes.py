"""A label's symmetry in the axes that a person gave it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.symmetry_names import SYMMETRIES
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, rotation_angle

# Axes that turn by no more were measured wrongly, and the symmetry about them with them [rad].
CORRECTION = np.deg2rad(15.0)
# How far an origin may lie off a measured axis of revolution: a share of the object's diagonal.
OFF_AXIS = 0.03
_RENAMINGS = SYMMETRIES["cube"].rotations  # the same three lines under other names


def symmetries_along(
    label: PoseLabel, rotation: Float[np.ndarray, "3 3"]
) -> tuple[SymmetryGroup, SymmetryGroup | None]:
    """The label's `symmetry` and `print_symmetry` in other axes: the same rotations of the object.

    Up to 15 deg beside the measured axes, whichever of them is X, Y or Z now, the symmetry goes with the axes.

    Args:
      label: As measured.
      rotation: `(3, 3)`, columns are the new X, Y, Z in the mesh frame.

    Raises:
      InputError: An axis of revolution would be X no longer.
    """
    change = label.rotation.T @ rotation
    axial = bool(label.symmetry.axial)
    tilt = float(np.arccos(np.clip(abs(change[0, 0]), 0, 1)))
    if axial and tilt > CORRECTION:
        raise InputError(
            f"x: is {np.degrees(tilt):.0f} deg from the measured axis of revolution, which has to be X; "
            "give 'symmetry' too"
        )
    settled = _without_correction(change, axial)
    printed = label.print_symmetry
    return (
        _in_axes(label.symmetry, settled),
        None if printed is None else _in_axes(printed, settled),
    )


def require_on_axis(label: PoseLabel, origin: Float[np.ndarray, "3"], where: str) -> None:
    """Refuse another origin off the axis of revolution that the label keeps.

    Args:
      label: As measured.
      origin: `(3,)` [m], in the mesh frame.
      where: Opens the message.

    Raises:
      InputError: It lies farther off than a correction does.
    """
    if not label.symmetry.axial:
        return
    away = float(np.linalg.norm(np.cross(origin - label.origin, label.rotation[:, 0])))
    if away > OFF_AXIS * np.linalg.norm(label.extents):
        raise InputError(
            f"{where}: origin: lies {1000 * away:.0f} mm off the measured axis of revolution; "
            "expected on it, or `symmetry: none`"
        )


def _without_correction(change: Float[np.ndarray, "3 3"], axial: bool) -> Float[np.ndarray, "3 3"]:
    """The part of a change of axes that chooses other axes, and corrects none."""
    angles = rotation_angle(change, _RENAMINGS)
    nearest = int(np.argmin(angles))
    if angles[nearest] <= CORRECTION:
        return _RENAMINGS[nearest]
    if not axial:
        return change
    x = np.array([np.sign(change[0, 0]), 0.0, 0.0])
    y = np.array([0.0, *change[1:, 1]]) / np.linalg.norm(change[1:, 1])
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _in_axes(group: SymmetryGroup, change: Float[np.ndarray, "3 3"]) -> SymmetryGroup:
    """The same rotations in the axes that are the columns of `change`."""
    if group.axial:
        return group  # about X and -X alike
    return SymmetryGroup(change.T @ group.rotations @ change)
