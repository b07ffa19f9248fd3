"""The label of a mirror-symmetric object: its planes, its up, and where it faces."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import (
    STRICT,
    WORN,
    Tolerance,
    holds,
    measured_symmetry,
    mirror,
    residual,
)
from asset_pipeline.labelling.symmetry_fit import around, mirror_planes, refined_plane
from asset_pipeline.labelling.upright import MAX_LEAN, upright
from manipose_mj.assets.label import ObjectType, PoseLabel
from manipose_mj.assets.label_quality import LabelQuality, clear, fits
from manipose_mj.poses import SymmetryGroup

STARTS = 12  # normals around up from which planes are sought
REFINED = 4  # of which as many are fitted finely
AS_LONG = 0.03  # lengths that differ by a smaller share are alike
CLEAN = 0.0006  # what a whole thing's plane leaves beside twice the noise, at most [m]
SQUARE = np.deg2rad(3.0)  # two planes are square to each other to within
CLEAR_REACH = 0.03  # the side that breaks the symmetry reaches farther by this share of the length

# The catalogue's bound notebooks and folded wallets have X across their covers, as those with a coil or a tab.
COVERED = ("notebook", "wallet")

Plane = tuple[np.ndarray, float]


def mirror_label(
    cloud: SurfaceCloud,
    up: Float[np.ndarray, "3"],
    *,
    object_type: ObjectType = "mirror",
    category: str = "",
) -> tuple[PoseLabel, LabelQuality]:
    """The frame of an object with upright mirror planes.

    - Three planes: X along the longest side, Y along the second, Z along the shortest; each sign is that with a
      positive first large component in the mesh frame, as far as Z stays right-handed. Which way up the
      scan lay does not count. Notebooks and wallets keep X up, as the catalogue's.
    - Two planes (square to each other): X is where they meet, upwards; Y is along the longer
      horizontal length (of a round lid along its handle, where more of the surface is far out), its sign the one with a positive first large component in the mesh frame.
    - One plane: X is in it, square to what the object stands on (`upright`); Y lies in it, towards the
      side that breaks the symmetry: where the bounding box reaches farther from the centroid of the
      surface.
    - No plane within the tolerance: as with one, the best there is; the residual and the confidence
      tell.

    The tolerance is strict, unless even the best plane leaves more than a whole thing's: real boxes
    bulge and lean, and are boxes to within `WORN`.

    Args:
      cloud: The surface.
      up: `(3,)`, unit, in the mesh frame.
      object_type: What the label says; an axial object that is not of revolution stays axial, its X up.
      category: What kind of object it is.
    """
    first, second, tolerance = _planes(cloud, up)
    residuals = {"plane": residual(cloud, mirror(first[0]), first[0] * first[1])}
    limit = STRICT.limit(cloud) * (1 if tolerance is STRICT else 2)
    evidence = [fits(residuals["plane"], limit)]
    if second is not None:
        residuals["second_plane"] = residual(cloud, mirror(second[0]), second[0] * second[1])
        evidence.append(fits(residuals["second_plane"], limit))
        x = np.cross(first[0], second[0])
        x = x / np.linalg.norm(x) * np.sign(x @ up)
        sides = [n - (n @ x) * x for n in (first[0], second[0])]
        y = positive(_longer(cloud, *sides))
    else:
        normal = first[0]
        x, footing = upright(cloud, up, normal)
        y = np.cross(normal, x)
        along = cloud.points @ y
        reach = (along.max() + along.min()) / 2 - along.mean()
        y = y if reach >= 0 else -y
        evidence.append(footing)
        evidence.append(clear(abs(reach), CLEAR_REACH * np.ptp(along)))
    y = y / np.linalg.norm(y)
    rotation = np.stack([x, y, np.cross(x, y)], axis=1)
    origin, extents = cloud.box(rotation)
    symmetry = measured_symmetry(cloud, rotation, origin, turns=tolerance)
    if object_type == "mirror" and category not in COVERED and _three_planes(symmetry):
        order = by_length(rotation, extents)
        symmetry = SymmetryGroup(order.T @ symmetry.rotations @ order)
        rotation = rotation @ order
        origin, extents = cloud.box(rotation)
    half_turn = rotation @ np.diag([1.0, -1.0, -1.0]) @ rotation.T
    residuals["half_turn"] = residual(cloud, half_turn, origin)
    label = PoseLabel(origin, rotation, object_type, extents, symmetry)
    return label, LabelQuality(min(evidence), residuals)


def by_length(
    rotation: Float[np.ndarray, "3 3"], extents: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 3"]:
    """The axes of a label, in its own frame, put in the order of its lengths: the longest becomes X."""
    order = np.eye(3)[:, np.argsort(-extents, kind="stable")]
    for k in (0, 1):
        axis = rotation @ order[:, k]
        order[:, k] *= np.sign(axis @ positive(axis))
    order[:, 2] = np.cross(order[:, 0], order[:, 1])
    return order


def _three_planes(symmetry: SymmetryGroup) -> bool:
    """Whether the half turns about all three axes are in the group."""
    gaps = symmetry.rotations[:, None] - SymmetryGroup.three_planes().rotations
    return bool((np.abs(gaps).max(axis=(2, 3)).min(axis=0) < 1e-6).all())


def _planes(cloud: SurfaceCloud, up: np.ndarray) -> tuple[Plane, Plane | None, Tolerance]:
    """The best upright plane, a second one square to it where both hold, and by which tolerance.

    Of a square's four planes, those along its sides: with the least rectangle around the shape.
    """
    found = [refined_plane(cloud, *p) for p in mirror_planes(cloud, around(up, STARTS))[:REFINED]]
    found = [p for p in found if abs(p[0] @ up) < np.sin(MAX_LEAN)] or found
    found.sort(key=lambda p: residual(cloud, mirror(p[0]), p[0] * p[1]))
    first = found[0]
    whole = residual(cloud, mirror(first[0]), first[0] * first[1]) < CLEAN + 2 * cloud.noise
    tolerance = STRICT if whole else WORN
    held = [p for p in found if holds(cloud, mirror(p[0]), p[0] * p[1], tolerance)]
    pairs: list[tuple[float, Plane, Plane]] = []
    for a in held:
        across = np.cross(up, a[0])
        across = across / np.linalg.norm(across)
        b = refined_plane(cloud, across, float(across @ cloud.points.mean(axis=0)))
        square = abs(a[0] @ b[0]) < np.sin(SQUARE) and abs(b[0] @ up) < np.sin(MAX_LEAN)
        if square and holds(cloud, mirror(b[0]), b[0] * b[1], tolerance):
            sides = np.ptp(cloud.points @ np.stack([a[0], b[0]], axis=1), axis=0)
            pairs.append((float(sides.prod()), a, b))
    if pairs:
        return *min(pairs, key=lambda pair: pair[0])[1:], tolerance
    return first, None, tolerance


def _longer(cloud: SurfaceCloud, a: np.ndarray, b: np.ndarray) -> Float[np.ndarray, "3"]:
    """Along which the shape is longer; where it is as long both ways, along which it spreads more."""
    first, second = cloud.points @ a, cloud.points @ b
    lengths = float(np.ptp(first)), float(np.ptp(second))
    if abs(lengths[0] - lengths[1]) > AS_LONG * max(lengths):
        return a if lengths[0] > lengths[1] else b
    return a if first.std() >= second.std() else b


def positive(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """The one of +-axis whose first large component is positive."""
    first = axis[np.abs(axis) > 0.3 * np.linalg.norm(axis)][0]
    return axis if first > 0 else -axis
