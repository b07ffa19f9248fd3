"""The label of a vessel with a handle: its body gives X, what is attached to it gives Y."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import mirror, residual, residuals
from asset_pipeline.labelling.symmetry_fit import plane_through_axis
from asset_pipeline.labelling.vessel_shape import VesselShape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.label_quality import LabelQuality, clear, fits
from manipose_mj.poses import SymmetryGroup, rotation_about

PAIRED = 3  # of the parts, the largest, two of which may be each other's mirror images
PERCENTILE = 90.0  # of the parts' residual: a handle's two roots are seldom alike
CLEAR_REACH = 0.03  # the side that breaks the symmetry reaches farther by this share of the length


def vessel_label(cloud: SurfaceCloud, vessel: VesselShape) -> tuple[PoseLabel, LabelQuality]:
    """The frame of a body of revolution with parts attached to it.

    X is the body's axis. A round body fits any plane through it, so the parts alone choose the mirror plane:
    the one through a part's middle or between two parts that maps them onto the surface best. Y is towards the
    part where there is one; where there are several, towards where the bounding box reaches farther from
    the centroid of the surface; where half a turn about X maps the parts onto each other, along the longer length.

    Args:
      cloud: The surface.
      vessel: Its body, and at least one part.
    """
    axis, point = vessel.axis, vessel.point
    parts = np.concatenate(vessel.parts)
    toward = _best_plane(cloud, vessel, parts)
    normal = np.cross(axis, toward)
    plane = _parts_residual(cloud, mirror(normal), point, parts)
    evidence = [fits(plane, 2 * vessel.limit), fits(vessel.roundness, vessel.limit)]
    symmetry = SymmetryGroup.identity()
    turn = rotation_about(axis, np.pi)
    lengths = np.ptp(cloud.points @ np.stack([toward, normal], axis=1), axis=0)
    if _parts_residual(cloud, turn, point, parts) < vessel.limit:
        symmetry = SymmetryGroup.two_planes()
        y = toward if lengths[0] >= lengths[1] else normal
        y = y if y[np.abs(y).argmax()] > 0 else -y
    elif len(vessel.parts) == 1:
        y = toward if toward @ vessel.direction(cloud, 0) > 0 else -toward
        evidence.append(vessel.clearness(cloud))
    else:
        along = cloud.points @ toward
        reach = (along.max() + along.min()) / 2 - along.mean()
        y = toward if reach >= 0 else -toward
        evidence.append(clear(abs(reach), CLEAR_REACH * float(lengths[0])))
    rotation = np.stack([axis, y, np.cross(axis, y)], axis=1)
    origin, extents = cloud.box(rotation)
    measured = {
        "plane": residual(cloud, mirror(rotation[:, 2]), point),
        "half_turn": residual(cloud, turn, origin),
        "parts": plane,
    }
    label = PoseLabel(origin, rotation, "mirror", extents, symmetry)
    return label, LabelQuality(min(evidence), measured)


def _best_plane(
    cloud: SurfaceCloud, vessel: VesselShape, parts: Int[np.ndarray, "k"]
) -> Float[np.ndarray, "3"]:
    """The direction from the axis, in the mirror plane, of the plane that fits the parts best."""
    axis, point = vessel.axis, vessel.point
    middles = [vessel.direction(cloud, k) for k in range(len(vessel.parts))]
    starts = middles + [a + b for a, b in combinations(middles[:PAIRED], 2)]
    best, least = middles[0], np.inf
    for start in starts:
        if np.linalg.norm(start) < 0.1:
            continue
        normal = np.cross(axis, start / np.linalg.norm(start))
        normal = plane_through_axis(cloud, parts, axis, point, normal)
        cost = _parts_residual(cloud, mirror(normal), point, parts)
        if cost < least:
            best, least = np.cross(normal, axis), cost
    return best


def _parts_residual(
    cloud: SurfaceCloud,
    motion: Float[np.ndarray, "3 3"],
    center: Float[np.ndarray, "3"],
    parts: Int[np.ndarray, "k"],
) -> float:
    return float(np.percentile(residuals(cloud, motion, center, parts), PERCENTILE))
