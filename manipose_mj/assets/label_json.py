"""A pose label, and how sure it is, as `asset.json` holds them."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.json_fields import Fields, rounded
from manipose_mj.assets.label import (
    OBJECT_TYPES,
    PoseLabel,
    symmetry_from_bop,
    symmetry_to_bop,
)
from manipose_mj.assets.label_quality import LabelQuality
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup

TEXTURED = "textured"  # ends the fields of the group that shape and print have


def label_to_json(label: PoseLabel) -> dict[str, Any]:
    """What `asset.json` says of a label, of an object or a handle."""
    return {
        "object_type": label.object_type,
        "origin": rounded(label.origin),
        "rotation": rounded(label.rotation),
        "extents": rounded(label.extents),
        "center": rounded(label.center),
        **symmetry_to_bop(label, label.symmetry),
        **{
            f"{name}_{TEXTURED}": entries
            for name, entries in symmetry_to_bop(label, label.symmetry_textured).items()
        },
    }


def read_label(fields: Fields) -> PoseLabel:
    """The label that a part of a document says.

    Raises:
      InputError: A field is missing or wrong.
    """
    rotation = fields.array("rotation", 3, 3)
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise fields.wrong("rotation", "a right-handed rotation matrix")
    symmetry, printed = _group(fields, rotation, ""), _group(fields, rotation, f"_{TEXTURED}")
    if len(printed.rotations) > len(symmetry.rotations) or printed.axial > symmetry.axial:
        raise fields.wrong(
            f"symmetries_discrete_{TEXTURED}", "rotations that leave the shape unchanged as well"
        )
    same = len(printed.rotations) == len(symmetry.rotations) and printed.axial == symmetry.axial
    return PoseLabel(
        origin=fields.array("origin", 3),
        rotation=rotation,
        object_type=fields.text("object_type", *OBJECT_TYPES),
        extents=fields.lengths("extents"),
        symmetry=symmetry,
        print_symmetry=None if same else printed,
        center=fields.array("center", 3) if "center" in fields.values else np.zeros(3),
    )


def _group(fields: Fields, rotation: Float[np.ndarray, "3 3"], ending: str) -> SymmetryGroup:
    discrete = fields.entries(f"symmetries_discrete{ending}")
    continuous = fields.entries(f"symmetries_continuous{ending}")
    try:
        return symmetry_from_bop(rotation, discrete, continuous)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{fields.path}: field '{fields.name}.symmetries_*{ending}' is wrong: {error}"
        ) from None


def quality_to_json(quality: LabelQuality | None) -> dict[str, Any] | None:
    """What `asset.json` says of how sure a label is."""
    if quality is None:
        return None
    residuals = {name: round(float(value), 9) for name, value in quality.residuals.items()}
    return {"confidence": round(quality.confidence, 6), "residuals": residuals}


def read_quality(fields: Fields | None) -> LabelQuality | None:
    """How sure the label is; None where nothing is said.

    Raises:
      InputError: A field is missing or wrong.
    """
    if fields is None:
        return None
    residuals = fields.fields("residuals")
    return LabelQuality(
        fields.number("confidence", 0, 1), {key: residuals.number(key) for key in residuals.values}
    )
