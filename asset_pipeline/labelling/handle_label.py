"""The label of a handle: where its bar is, which way it runs, and which way is out."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import KDTree

from asset_pipeline.geometry.surface_points import surface_points
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, rotation_about

UP = np.array([0.0, 0.0, 1.0])
SPACING = 0.0015  # of the points that stand for the surface [m]
SLICES = 24
APART = 0.005  # more than this between two pieces of a slice parts bar and plate [m]
# A handle longer than this many times its width has a bar; the others are knobs.
BAR = 1.5
# A handle runs along an axis of the frame unless it is at least this far from all of them.
SLANT = np.deg2rad(4.0)
# Turns about Y that stand for all of them: of round knobs.
ROUND = 24
# Two shapes are one if no point is farther from the other's than this, or this share of the length.
ALIKE, ALIKE_SHARE = 0.001, 0.025


def handle_label(mesh: trimesh.Trimesh, outwards: Float[np.ndarray, "3"]) -> PoseLabel:
    """X along the handle, Y outwards, the origin in the middle of its bar.

    A bar's cross-section is the median over slices across X, so that the posts that carry it count for
    nothing; a knob's is its bounding box, and its X is up. Of X's two signs ours is the one with X up;
    for a level bar, the one with Z up; for one on a level face, the one nearer to the frame's y.

    Args:
      mesh: The handle in the object frame [m].
      outwards: `(3,)`, unit: off the face that carries it.
    """
    points = surface_points(mesh, SPACING)
    flat = np.eye(3)[np.abs(outwards).argmin()]
    side = np.cross(outwards, UP if abs(outwards @ UP) < 0.9 else flat)
    side /= np.linalg.norm(side)
    plane = np.stack([np.cross(side, outwards), side], axis=1)  # up (or nearly), sideways
    along = _long_axis(points @ plane)
    x = plane @ along
    z = np.cross(x, outwards)
    if _sign(x, z) < 0:
        x, z = -x, -z
    rotation = np.stack([x, outwards, z], axis=1)
    own = points @ rotation
    low, high = own.min(axis=0), own.max(axis=0)
    extents = high - low
    if extents[0] > BAR * extents[2]:
        low[1:], high[1:] = _cross_section(own)
    centre = (low + high) / 2
    origin = rotation @ centre
    return PoseLabel(
        origin=origin,
        rotation=rotation,
        object_type="handle",
        extents=np.maximum(high - low, 1e-4),
        symmetry=_symmetry(own - centre, float(extents[0])),
    )


def _long_axis(flat: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "2"]:
    """The direction in the face that the handle runs along."""
    extents = np.ptp(flat, axis=0)
    to_box, box = trimesh.bounds.oriented_bounds_2D(flat)
    if max(box) > BAR * min(box):
        own = np.asarray(to_box)[:2, :2].T[:, int(np.argmax(box))]
        if np.arccos(np.clip(np.abs(own).max(), 0, 1)) > SLANT:
            return own
    return np.array([1.0, 0.0]) if extents[0] * 1.1 > extents[1] else np.array([0.0, 1.0])


def _sign(x: Float[np.ndarray, "3"], z: Float[np.ndarray, "3"]) -> float:
    for value in (x @ UP, z @ UP, x[1], x[0]):
        if abs(value) > 0.1:
            return float(np.sign(value))
    return 1.0


def _cross_section(
    points: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Lowest and highest Y and Z of the bar: medians over slices across X."""
    share = (points[:, 0] - points[:, 0].min()) / max(float(np.ptp(points[:, 0])), 1e-9)
    slices = np.minimum((share * SLICES).astype(int), SLICES - 1)
    bounds = []
    for k in np.unique(slices):
        own = points[slices == k, 1:]
        # A plate on the face, behind the bar, is not the bar.
        outermost = np.sort(own[:, 0])[::-1]
        gaps = np.flatnonzero(outermost[:-1] - outermost[1:] > APART)
        if len(gaps):
            own = own[own[:, 0] >= outermost[gaps[0]]]
        bounds.append([own.min(axis=0), own.max(axis=0)])
    low, high = np.median(np.array(bounds), axis=0)
    return low, high


def _symmetry(points: Float[np.ndarray, "n 3"], length: float) -> SymmetryGroup:
    """The most turns about Y that leave the shape as it is; points are about the origin."""
    tree, far = KDTree(points), max(ALIKE, ALIKE_SHARE * length) + SPACING
    for count in (ROUND, 4, 2):
        turns = [
            rotation_about(np.array([0.0, 1.0, 0.0]), 2 * np.pi * k / count) for k in range(count)
        ]
        if all(np.quantile(tree.query(points @ turn)[0], 0.98) <= far for turn in turns[1:]):
            return SymmetryGroup(np.stack(turns))
    return SymmetryGroup.identity()
