"""The label of an axial object: its axis, and whether its ends are alike."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import (
    ROUND,
    axial_residual,
    measured_symmetry,
    residual,
)
from asset_pipeline.labelling.symmetry_fit import half_turn_axis
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.label_quality import LabelQuality, fits

MAX_LEAN = np.deg2rad(13.0)  # of a source's up from the axis


def axial_label(
    cloud: SurfaceCloud,
    up: Float[np.ndarray, "3"],
) -> tuple[PoseLabel, LabelQuality] | None:
    """The frame of a surface of revolution, or None where it is not one.

    X is the axis about which half a turn maps the surface onto itself best, on the side of `up`; a
    sphere's is `up`. Y is the mesh frame's x axis made square to it (its y axis where x is up). The
    origin is on the axis, which the centre of a solid of revolution's bounding box is, and midway along.

    Args:
      cloud: The surface.
      up: `(3,)`, unit, in the mesh frame.
    """
    rotation, origin, extents = _frame(cloud, up)
    axis, limit = rotation[:, 0], ROUND.limit(cloud)
    around = axial_residual(cloud, axis, origin, ROUND.percentile)
    if around > limit:
        return None
    symmetry = measured_symmetry(cloud, rotation, origin, axial=ROUND)
    turned = rotation @ np.diag([-1.0, 1.0, -1.0]) @ rotation.T
    flip = residual(cloud, turned, origin)
    label = PoseLabel(origin, rotation, "axial", extents, symmetry)
    residuals = {"axis": axial_residual(cloud, axis, origin), "flip": flip}
    quality = LabelQuality(fits(around, limit), residuals)
    return label, quality


def axis_evidence(cloud: SurfaceCloud, up: Float[np.ndarray, "3"]) -> float:
    """Evidence from 0 to 1 that a surface is one of revolution; below one half, `axial_label` finds none.

    Args:
      cloud: The surface.
      up: `(3,)`, unit, in the mesh frame.
    """
    rotation, origin, _ = _frame(cloud, up)
    around = axial_residual(cloud, rotation[:, 0], origin, ROUND.percentile)
    return fits(around, ROUND.limit(cloud))


def _frame(
    cloud: SurfaceCloud, up: Float[np.ndarray, "3"]
) -> tuple[
    Float[np.ndarray, "3 3"],
    Float[np.ndarray, "3"],
    Float[np.ndarray, "3"],
]:
    """Axes as columns, origin and extents of the label that a surface of revolution would have."""
    axis, point = half_turn_axis(cloud, up, cloud.points.mean(axis=0))
    axis = axis if axis @ up > 0 else -axis
    if axis @ up < np.cos(MAX_LEAN):
        axis, point = up, cloud.points.mean(axis=0)
    rotation = projected_frame(axis)
    local = (cloud.points - point) @ rotation
    low, high = local.min(axis=0), local.max(axis=0)
    return rotation, point + (low[0] + high[0]) / 2 * axis, high - low


def projected_frame(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Columns: `axis`, the mesh frame's x (or y) made square to it, and their cross product."""
    helper = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
    y = helper - axis * (axis @ helper)
    y = y / np.linalg.norm(y)
    return np.stack([axis, y, np.cross(axis, y)], axis=1)
