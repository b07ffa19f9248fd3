"""A pose label, and how sure it is, as `asset.json` holds them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from asset_pipeline.json_fields import array, number, rounded, typed
from asset_pipeline.labelling.label import (
    OBJECT_TYPES,
    PoseLabel,
    symmetry_from_bop,
    symmetry_to_bop,
)
from asset_pipeline.labelling.label_quality import LabelQuality
from manipose_mj.errors import InputError


def label_to_json(label: PoseLabel) -> dict[str, Any]:
    """What `asset.json` says of a label, of an object or a handle."""
    return {
        "object_type": label.object_type,
        "origin": rounded(label.origin),
        "rotation": rounded(label.rotation),
        "extents": rounded(label.extents),
        **symmetry_to_bop(label),
    }


def read_label(path: Path, document: dict[str, Any], name: str) -> PoseLabel:
    """The label that a document says.

    Args:
      path: Of the file, for messages.
      document: The label's part of it.
      name: Of the field, for messages.

    Raises:
      InputError: A field is missing or wrong.
    """
    object_type = typed(path, document, "object_type", str, f"{name}.object_type")
    if object_type not in OBJECT_TYPES:
        raise InputError(
            f"{path}: field '{name}.object_type' is {object_type!r}; "
            f"expected one of {', '.join(OBJECT_TYPES)}"
        )
    rotation = array(path, document, "rotation", (3, 3), f"{name}.rotation")
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise InputError(f"{path}: field '{name}.rotation' is not a right-handed rotation matrix")
    discrete = typed(path, document, "symmetries_discrete", list, f"{name}.symmetries_discrete")
    continuous = typed(
        path, document, "symmetries_continuous", list, f"{name}.symmetries_continuous"
    )
    try:
        symmetry = symmetry_from_bop(rotation, discrete, continuous)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: field '{name}.symmetries_*' is wrong: {error}") from None
    extents = array(path, document, "extents", (3,), f"{name}.extents")
    if (extents <= 0).any():
        raise InputError(f"{path}: field '{name}.extents' is not 3 positive lengths")
    return PoseLabel(
        origin=array(path, document, "origin", (3,), f"{name}.origin"),
        rotation=rotation,
        object_type=object_type,  # pyright: ignore[reportArgumentType]
        extents=extents,
        symmetry=symmetry,
    )


def quality_to_json(quality: LabelQuality | None) -> dict[str, Any] | None:
    """What `asset.json` says of how sure a label is."""
    if quality is None:
        return None
    residuals = {name: round(float(value), 9) for name, value in quality.residuals.items()}
    return {"confidence": round(quality.confidence, 6), "residuals": residuals}


def read_quality(path: Path, document: Any) -> LabelQuality | None:
    """How sure the label is by the field `label_quality`; None where nothing is said.

    Raises:
      InputError: The field is wrong.
    """
    if document is None:
        return None
    if not isinstance(document, dict):
        raise InputError(f"{path}: field 'label_quality' is not an object or null")
    confidence = number(path, document, "confidence", "label_quality.confidence")
    if not 0 <= confidence <= 1:
        raise InputError(
            f"{path}: field 'label_quality.confidence' is {confidence:g}; expected 0 to 1"
        )
    residuals = typed(path, document, "residuals", dict, "label_quality.residuals")
    return LabelQuality(
        confidence,
        {key: number(path, residuals, key, f"label_quality.residuals.{key}") for key in residuals},
    )
