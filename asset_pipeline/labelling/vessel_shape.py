"""A body of revolution and what is attached to its side: handles, spouts, ears.

A percentile of the residual cannot see a handle: that of a cup is a fiftieth of its surface. What is attached is
found instead as the connected sets of surface that lie outside the body's radial profile.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import maximum_filter1d
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import PROBES, residuals
from asset_pipeline.labelling.symmetry_fit import half_turn_axis
from manipose_mj.assets.label_quality import clear
from manipose_mj.poses import rotation_about

TURNS = 2 * np.pi * np.arange(1, 14) / 14  # of which the body stays in place in more than half
ROUND_LENGTH, ROUND_SHARE = (
    0.002,
    0.012,
)  # out of round by no more, in length [m] or of the diagonal
MAX_ROUNDNESS = 0.6  # of that, which a body's residual leaves at most; a hat's leaves more
ROUNDS = 3  # of fitting the axis to the body and finding the body about the axis
HOPELESS = (
    0.1  # a share of body below which no axis is near; a large handle pulls the first one off
)
BODY_SHARE = 0.6  # of the upright surface, that a body of revolution has at least
HEIGHTS = 64  # slices of the radial profile
REACH_LIMITS = 1.6  # a part reaches out of the profile by so many times what is out of round
MIN_SHARE = 0.0016  # of the surface, that the largest part has at least; the others, OTHERS of it
OTHERS = 0.3
LEVER = 0.5  # of the greatest radius, at which a part's middle is at least: a stem is no handle
NARROW = 0.6  # mean resultant length of a part's directions: below, it is a rim or a saucer
BRIDGE = 3.0  # spacings of the samples that a part's points are apart at most


@dataclass(frozen=True)
class VesselShape:
    """A body of revolution with parts attached to its side.

    Attributes:
      axis: `(3,)`, unit, in the mesh frame.
      point: `(3,)` [m], on the axis.
      parts: For every part, the indices of its points in the cloud; the largest first.
      roundness: The 85th percentile of the body's residual over the turns [m].
      limit: The residual that is still round [m].
    """

    axis: Float[np.ndarray, "3"]
    point: Float[np.ndarray, "3"]
    parts: tuple[Int[np.ndarray, "_"], ...]
    roundness: float
    limit: float

    def direction(self, cloud: SurfaceCloud, part: int) -> Float[np.ndarray, "3"]:
        """From the axis to the middle of a part, unit, square to the axis."""
        away = cloud.points[self.parts[part]].mean(axis=0) - self.point
        away = away - (away @ self.axis) * self.axis
        return away / np.linalg.norm(away)

    def clearness(self, cloud: SurfaceCloud) -> float:
        """From 0 to 1: how far beyond what is just found the largest part is, in share and in size."""
        share = len(self.parts[0]) / len(cloud.points)
        return clear(share - MIN_SHARE, MIN_SHARE)


def vessel_shape(cloud: SurfaceCloud, up: Float[np.ndarray, "3"]) -> VesselShape | None:
    """The body of revolution about an axis near `up`, and its parts; None where there is none.

    Args:
      cloud: The surface.
      up: `(3,)`, unit, to within about 10 degrees.
    """
    limit = max(ROUND_LENGTH + cloud.noise, ROUND_SHARE * cloud.diagonal)
    probes = np.arange(len(cloud.points))[cloud.thinned(PROBES)]
    axis, point = half_turn_axis(cloud, up, cloud.points.mean(axis=0))
    axis = axis if axis @ up > 0 else -axis
    for _ in range(ROUNDS):
        gaps = np.stack([residuals(cloud, rotation_about(axis, t), point) for t in TURNS])
        body = (gaps <= limit).mean(axis=0) > 0.5
        upright = (
            1 - (cloud.normals[probes] @ axis) ** 2
        )  # what lies flat says nothing about a turn
        share = float(upright @ body / upright.sum())
        if share < HOPELESS:
            return None
        axis, point = half_turn_axis(cloud, axis, point, probes[body])
    roundness = float(np.percentile(np.median(gaps[:, body], axis=0), 85))
    if share < BODY_SHARE or roundness > MAX_ROUNDNESS * limit:
        return None
    radius, height = _cylindrical(cloud.points, axis, point)
    outside = _outside(radius, height, probes[body], limit)
    parts = _parts(cloud, radius, outside, axis, point, limit)
    return VesselShape(axis, point, parts, roundness, limit)


def _cylindrical(
    points: np.ndarray, axis: np.ndarray, point: np.ndarray
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Distance from the axis and height along it [m]."""
    offsets = points - point
    height = offsets @ axis
    return np.linalg.norm(offsets - height[:, None] * axis, axis=1), height


def _outside(
    radius: np.ndarray, height: np.ndarray, body: Int[np.ndarray, "b"], limit: float
) -> Float[np.ndarray, "n"]:
    """By how much every point is outside the body's profile, 0 for what is on it or inside [m]."""
    low, high = float(height[body].min()), float(height[body].max())
    edges = np.linspace(low, high, HEIGHTS + 1)
    slices = np.clip(np.digitize(height, edges) - 1, 0, HEIGHTS - 1)
    profile = np.zeros(HEIGHTS)
    np.maximum.at(profile, slices[body], radius[body])
    profile = maximum_filter1d(profile, 3, mode="nearest")
    beyond = radius > np.where((height < low) | (height > high), 0.0, profile[slices])
    near = cKDTree(np.stack([radius[body], height[body]], axis=1))
    distance = near.query(np.stack([radius, height], axis=1))[0]
    return np.where(beyond & (distance > limit), distance, 0.0)


def _parts(
    cloud: SurfaceCloud,
    radius: np.ndarray,
    outside: np.ndarray,
    axis: np.ndarray,
    point: np.ndarray,
    limit: float,
) -> tuple[Int[np.ndarray, "_"], ...]:
    """The connected sets of what is outside that are large enough, far out and attached."""
    found = np.flatnonzero(outside > 0)
    if not len(found):
        return ()
    spacing = float(np.median(cloud.tree.query(cloud.points[:: PROBES // 100], 5)[0][:, 4]))
    members = _components(cloud.points[found], BRIDGE * spacing)
    rest = cKDTree(cloud.points[outside <= 0])
    parts = []
    for k in range(members.max() + 1):
        part = found[members == k]
        away = cloud.points[part] - point
        away = away - np.outer(away @ axis, axis)
        away = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
        attached = rest.query(cloud.points[part])[0].min() < limit + BRIDGE * spacing
        if (
            attached
            and len(part) > OTHERS * MIN_SHARE * len(cloud.points)
            and outside[part].max() > REACH_LIMITS * limit
            and radius[part].mean() > LEVER * radius[outside <= 0].max()
            and np.linalg.norm(away.mean(axis=0)) > NARROW
        ):
            parts.append(part)
    parts.sort(key=len, reverse=True)
    return tuple(parts) if parts and len(parts[0]) > MIN_SHARE * len(cloud.points) else ()


def _components(points: Float[np.ndarray, "n 3"], reach: float) -> Int[np.ndarray, "n"]:
    """Which connected set each point is in; neighbours are within `reach`."""
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    return connected_components(links, directed=False)[1]
