"""The pose label of a scan, from its type, its source's up and its geometry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.labelling.axial_label import axial_label, axis_evidence
from asset_pipeline.labelling.lying_label import lying_label
from asset_pipeline.labelling.mirror_label import mirror_label
from asset_pipeline.labelling.print_symmetry import print_symmetry, surface_colours
from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.tool_label import tool_label
from asset_pipeline.labelling.vessel_label import vessel_label
from asset_pipeline.labelling.vessel_shape import vessel_shape
from manipose_mj.assets.label import ObjectType, PoseLabel
from manipose_mj.assets.label_quality import LabelQuality
from manipose_mj.errors import InputError

# Tolerances in metres are those of scans of things of at least this diagonal [m] ...
LEAST_DIAGONAL = 0.08
# ... and of what is smaller, where it is so noisy, as a share of its diagonal: a scan, and no drawn shape.
NOISY = 0.001


def scan_label(
    mesh: trimesh.Trimesh,
    object_type: ObjectType,
    up: Float[np.ndarray, "3"] | None,
    *,
    category: str = "",
    functional: Float[np.ndarray, "3"] | None = None,
    textured: bool = True,
    texture: Path | None = None,
    type_checked: bool = False,
) -> tuple[PoseLabel, LabelQuality]:
    """The label frame of a scan, by the rules of the conventions, and how sure it is.

    The frame is measured: `axial_label`, `lying_label`, `mirror_label` and `tool_label` say how, and what they
    do where the rules leave something open. What is smaller than 8 cm and not noisy is labelled as if it were enlarged
    to that: its symmetries do not depend on its size.

    Args:
      mesh: In the mesh frame [m].
      object_type: `"axial"`, `"mirror"` or `"functional"`.
      up: `(3,)`, in the mesh frame, to within about 10 degrees; None only for functional objects,
        which do not need it.
      category: What kind of object it is; tells which end of a tool is held, and which slabs keep X
        up. Unknown tools get the rule of `tool_label`.
      functional: `(3,)`, roughly from grip to functional end, in the mesh frame, where it is known.
      textured: Whether the asset has a texture, which may break symmetries of the shape.
      texture: Its image, to measure which; without, it is taken to leave turns about an axis only.
      type_checked: Whether the type is to be checked against the shape, as what a person or a file's name says of
        one object: where it is axial, and the shape has no axis of revolution, that counts against the confidence.

    Raises:
      InputError: Another object type, which scans do not have, or no `up` where it is needed.
    """
    if object_type not in ("axial", "mirror", "functional"):
        raise InputError(
            f"object type {object_type!r} of a scan; expected axial, mirror or functional"
        )
    if up is None and object_type != "functional":
        raise InputError(f"no up axis for an object of type {object_type!r}; only tools need none")
    cloud = SurfaceCloud.of(mesh)
    colours = surface_colours(cloud, mesh, texture) if textured and texture is not None else None
    small = cloud.diagonal < LEAST_DIAGONAL and cloud.noise < NOISY * cloud.diagonal
    factor = LEAST_DIAGONAL / cloud.diagonal if small else 1.0
    if small:
        cloud = cloud.enlarged(factor)
    if up is None or object_type == "functional":
        label, quality = tool_label(cloud, category=category, functional=functional)
    else:
        up = np.asarray(up, float) / np.linalg.norm(up)
        label, quality = _upright_label(cloud, object_type, up, category)
        if type_checked and label.object_type == "axial" and "axis" not in quality.residuals:
            confidence = min(quality.confidence, axis_evidence(cloud, up))
            quality = replace(quality, confidence=confidence)
    if textured:
        label = replace(label, print_symmetry=print_symmetry(cloud, colours, label))
    if small:
        residuals = {name: value / factor for name, value in quality.residuals.items()}
        quality = replace(quality, residuals=residuals)
        label = replace(
            label,
            origin=label.origin / factor,
            extents=label.extents / factor,
            center=label.center / factor,
        )
    return label, quality


def _upright_label(
    cloud: SurfaceCloud, object_type: ObjectType, up: Float[np.ndarray, "3"], category: str
) -> tuple[PoseLabel, LabelQuality]:
    vessel = vessel_shape(cloud, up)
    if vessel is not None and vessel.parts:
        return vessel_label(cloud, vessel)
    if object_type == "axial":
        found = axial_label(cloud, up)
        if found is not None:
            return found
    label, quality = mirror_label(cloud, up, object_type=object_type, category=category)
    if label.symmetry.axial:
        return label, quality
    lying = lying_label(cloud, up, label.rotation.T, object_type=object_type)
    return lying or (label, quality)
