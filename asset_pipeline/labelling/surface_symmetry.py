"""How well a scanned surface maps onto itself under a rotation or a reflection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from manipose_mj.poses import SymmetryGroup, rotation_about

PROBES = 3_000
# Of the neighbours of a moved point, the nearest one that faces the same way counts: not a wall's back.
CANDIDATES = 6
# None of these turns maps a regular polygon of fewer than 20 corners onto itself.
GENERIC_TURNS = np.deg2rad([11.3, 23.7, 41.9, 67.1, 97.3, 131.9, 163.7])


@dataclass(frozen=True)
class Tolerance:
    """When a symmetry holds: the percentile of the residual that counts, and its greatest value.

    Attributes: percentile; length [m]; share of the bounding box's diagonal; the larger of both counts.
    """

    percentile: float
    length: float
    share: float

    def limit(self, cloud: SurfaceCloud) -> float:
        """The greatest residual [m] for this surface."""
        return max(self.length + cloud.noise, self.share * cloud.diagonal)


# Vertex noise of 0.5 mm leaves less than 1.3 mm at the 98th percentile; a feature of 3 mm on one
# fiftieth of the surface leaves more than 2.
STRICT = Tolerance(percentile=98.0, length=0.0016, share=0.007)
# For what is said to be axial: an apple is none the less, nor a cup whose inside was scanned in patches.
ROUND = Tolerance(percentile=85.0, length=0.0016, share=0.025)
# For things that are worn, bulged or badly scanned.
WORN = Tolerance(percentile=95.0, length=0.0016, share=0.025)

# Sixth turns leave at most this share of the strict limit: nearly round scans pass more turns than they have.
SIXTH_SHARE = 0.5


def residuals(
    cloud: SurfaceCloud,
    motion: Float[np.ndarray, "3 3"],
    center: Float[np.ndarray, "3"],
    chosen: Int[np.ndarray, "n"] | None = None,
) -> Float[np.ndarray, "n"]:
    """Distance [m] of moved points from the surface: of `chosen`, or of `PROBES` points or a few more.

    `motion` is a rotation or a reflection about `center`, in the mesh frame. The distance is to the
    tangent plane of the nearest point that faces the same way, so that the spacing does not count.
    """
    if chosen is None:
        chosen = np.arange(len(cloud.points))[cloud.thinned(PROBES)]
    moved = (cloud.points[chosen] - center) @ motion.T + center
    facing = cloud.normals[chosen] @ motion.T
    distance, near = cloud.tree.query(moved, CANDIDATES)
    same_side = np.einsum("nki,ni->nk", cloud.normals[near], facing) > 0
    first = same_side.argmax(axis=1)[:, None]
    nearest = np.take_along_axis(near, first, axis=1)[:, 0]
    far = np.take_along_axis(distance, first, axis=1)[:, 0]
    plane = np.abs(np.einsum("ij,ij->i", moved - cloud.points[nearest], cloud.normals[nearest]))
    # Past an edge the tangent plane runs on where the surface does not.
    return np.where(far > 0.02 * cloud.diagonal, far, plane)


def residual(
    cloud: SurfaceCloud,
    motion: Float[np.ndarray, "3 3"],
    center: Float[np.ndarray, "3"],
    percentile: float = 95.0,
) -> float:
    """A percentile of `residuals` [m]."""
    return float(np.percentile(residuals(cloud, motion, center), percentile))


def holds(
    cloud: SurfaceCloud,
    motion: Float[np.ndarray, "3 3"],
    center: Float[np.ndarray, "3"],
    tolerance: Tolerance,
) -> bool:
    """Whether the motion maps the surface onto itself within the tolerance."""
    return residual(cloud, motion, center, tolerance.percentile) <= tolerance.limit(cloud)


def axial_residual(
    cloud: SurfaceCloud,
    axis: Float[np.ndarray, "3"],
    center: Float[np.ndarray, "3"],
    percentile: float = 95.0,
) -> float:
    """The largest residual [m] over the generic turns about an axis through `center`."""
    turns = [rotation_about(axis, angle) for angle in GENERIC_TURNS]
    return max(residual(cloud, turn, center, percentile) for turn in turns)


def mirror(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The reflection across the plane with this unit normal."""
    return np.eye(3) - 2 * np.outer(normal, normal)


def measured_symmetry(
    cloud: SurfaceCloud,
    rotation: Float[np.ndarray, "3 3"],
    origin: Float[np.ndarray, "3"],
    *,
    axial: Tolerance = STRICT,
    turns: Tolerance = STRICT,
) -> SymmetryGroup:
    """The proper rotations, among those a label can have, that map the shape onto itself.

    Tried are every turn about the label's X, the flip, quarter turns and half turns about X, Y and Z, and, where no
    quarter turn holds, sixth turns about X. What holds generates the group.

    Args:
      cloud: The surface.
      rotation: Columns are the label's axes in the mesh frame.
      origin: `(3,)` [m], the label's origin in the mesh frame.
      axial: Tolerance of every turn about X.
      turns: Tolerance of the flip, the half and the quarter turns.
    """

    def held(turn: np.ndarray) -> bool:
        return holds(cloud, rotation @ turn @ rotation.T, origin, turns)

    x, y, z = np.eye(3)
    if axial_residual(cloud, rotation[:, 0], origin, axial.percentile) <= axial.limit(cloud):
        return SymmetryGroup.about_x(ends_alike=held(np.diag([-1.0, 1.0, -1.0])))
    tried = [rotation_about(axis, angle) for angle in (np.pi / 2, np.pi) for axis in (x, y, z)]
    kept = [held(turn) for turn in tried]
    members = [np.round(turn) for turn, holding in zip(tried, kept, strict=True) if holding]
    sixth = rotation_about(x, np.pi / 3)
    if not any(kept[:3]) and _leaves_little(cloud, rotation @ sixth @ rotation.T, origin):
        members.append(sixth)
    return SymmetryGroup.generated(np.stack(members)) if members else SymmetryGroup.identity()


def _leaves_little(
    cloud: SurfaceCloud, motion: Float[np.ndarray, "3 3"], center: Float[np.ndarray, "3"]
) -> bool:
    """Whether the motion leaves as little as those of a drawn shape."""
    limit = SIXTH_SHARE * STRICT.limit(cloud)
    return residual(cloud, motion, center, STRICT.percentile) <= limit


def turns_about_x(
    cloud: SurfaceCloud, rotation: Float[np.ndarray, "3 3"], origin: Float[np.ndarray, "3"]
) -> SymmetryGroup:
    """Of the rotations about the label's X alone, those that map the shape onto itself.

    A tool's two ends are never alike; arguments as in `measured_symmetry`.
    """
    axis = rotation[:, 0]
    if axial_residual(cloud, axis, origin, STRICT.percentile) <= STRICT.limit(cloud):
        return SymmetryGroup.about_x()
    for angle in (np.pi / 2, np.pi):
        if holds(cloud, rotation_about(axis, angle), origin, STRICT):
            turn = np.round(rotation_about(np.array([1.0, 0.0, 0.0]), angle))
            return SymmetryGroup.generated(turn[None])
    return SymmetryGroup.identity()
