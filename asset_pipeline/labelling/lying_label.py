"""The label of a body of revolution whose axis is not upright: a rod or a dumbbell that lies on the table."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from asset_pipeline.labelling.axial_label import MAX_LEAN, projected_frame
from asset_pipeline.labelling.mirror_label import CLEAR_REACH, positive
from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import STRICT, axial_residual, holds, residual
from asset_pipeline.labelling.symmetry_fit import half_turn_axis
from manipose_mj.assets.label import ObjectType, PoseLabel
from manipose_mj.assets.label_quality import LabelQuality, clear, fits
from manipose_mj.poses import SymmetryGroup

# Beside the noise, a turn leaves at most this share of the radius: less than a hexagonal or a square bar.
ROUND_SHARE = 0.03
EVEN = 0.15  # variances across an axis of revolution differ by a smaller share


def lying_label(
    cloud: SurfaceCloud,
    up: Float[np.ndarray, "3"],
    starts: Iterable[Float[np.ndarray, "3"]],
    *,
    object_type: ObjectType,
) -> tuple[PoseLabel, LabelQuality] | None:
    """The frame of a surface of revolution whose axis is not upright, or None where it is not one.

    X is the axis. Where the ends differ it points to where the bounding box reaches farther from the centroid of
    the surface: to the tip of a cone. Where they are alike its first large component in the mesh frame is
    positive. Y and the origin are as of `axial_label`.

    A thin bar needs more than the strict tolerance, which is as large as its corners.

    Args:
      cloud: The surface.
      up: `(3,)`, unit, in the mesh frame.
      starts: `(3,)` each, unit, in the mesh frame: where the axis is sought beside the principal axes of the
        points, which say nothing of a body that is about as long as it is wide.
      object_type: What the label says.
    """
    middle = cloud.points.mean(axis=0)
    covariance = np.cov(cloud.points.T)
    for start in (*np.linalg.eigh(covariance)[1].T, *starts):
        if not _even(covariance, start):
            continue
        axis, point = half_turn_axis(cloud, start, middle)
        if abs(axis @ up) < np.cos(MAX_LEAN):
            rotation, origin, extents = _frame(cloud, axis, point)
            around = axial_residual(cloud, rotation[:, 0], origin, STRICT.percentile)
            limit = ROUND_SHARE * float(extents[1:].max()) / 2 + cloud.noise
            limit = min(STRICT.limit(cloud), limit)
            if around <= limit:
                break
    else:
        return None
    turned = rotation @ np.diag([-1.0, 1.0, -1.0]) @ rotation.T
    alike = holds(cloud, turned, origin, STRICT)
    evidence = [fits(around, STRICT.limit(cloud))]
    if alike:
        sign = float(positive(rotation[:, 0]) @ rotation[:, 0])
    else:
        sign = float((origin - middle) @ rotation[:, 0])
        evidence.append(clear(abs(sign), CLEAR_REACH * float(extents[0])))
    if sign < 0:
        rotation, origin, extents = _frame(cloud, -rotation[:, 0], origin)
    residuals = {
        "axis": axial_residual(cloud, rotation[:, 0], origin),
        "flip": residual(cloud, turned, origin),
    }
    symmetry = SymmetryGroup.about_x(ends_alike=alike)
    label = PoseLabel(origin, rotation, object_type, extents, symmetry)
    return label, LabelQuality(min(evidence), residuals)


def _even(covariance: Float[np.ndarray, "3 3"], axis: Float[np.ndarray, "3"]) -> bool:
    """Whether the points spread alike in all directions across an axis."""
    across = projected_frame(axis)[:, 1:]
    low, high = np.linalg.eigvalsh(across.T @ covariance @ across)
    return bool(high - low < EVEN * high)


def _frame(
    cloud: SurfaceCloud, axis: Float[np.ndarray, "3"], point: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Axes as columns, origin, on the axis and midway along, and extents."""
    rotation = projected_frame(axis)
    local = (cloud.points - point) @ rotation
    low, high = local.min(axis=0), local.max(axis=0)
    return rotation, point + (low[0] + high[0]) / 2 * axis, high - low
