"""The symmetry groups that people name, in labels' files and in captions."""

from __future__ import annotations

import numpy as np

from manipose_mj.poses import SymmetryGroup, rotation_about

_X, _Y = np.eye(3)[:2]
_QUARTER = rotation_about(_X, np.pi / 2)
_HALF_ABOUT_Y = rotation_about(_Y, np.pi)

SYMMETRIES: dict[str, SymmetryGroup] = {
    "none": SymmetryGroup.identity(),
    "axis": SymmetryGroup.about_x(),
    "axis and flip": SymmetryGroup.about_x(ends_alike=True),
    "half turn": SymmetryGroup.two_planes(),
    "half turn about y": SymmetryGroup.generated(_HALF_ABOUT_Y[None]),
    "three half turns": SymmetryGroup.three_planes(),
    "third turns": SymmetryGroup.generated(rotation_about(_X, 2 * np.pi / 3)[None]),
    "sixth turns": SymmetryGroup.generated(rotation_about(_X, np.pi / 3)[None]),
    "quarter turns": SymmetryGroup.generated(_QUARTER[None]),
    "quarter turns and flips": SymmetryGroup.generated(np.stack([_QUARTER, _HALF_ABOUT_Y])),
    "cube": SymmetryGroup.generated(np.stack([_QUARTER, rotation_about(_Y, np.pi / 2)])),
}


def symmetry_name(group: SymmetryGroup) -> str:
    """The group's key in `SYMMETRIES`, or how many turns it has where it is none of them."""
    for name, known in SYMMETRIES.items():
        if _same(group, known):
            return name
    count = f"{len(group.rotations)} rotations"
    return f"axis, {count}" if group.axial else count


def _same(one: SymmetryGroup, other: SymmetryGroup) -> bool:
    if one.axial != other.axial or len(one.rotations) != len(other.rotations):
        return False
    gaps = np.abs(one.rotations[:, None] - other.rotations[None]).max(axis=(2, 3))
    return bool((gaps.min(axis=1) < 1e-3).all())
