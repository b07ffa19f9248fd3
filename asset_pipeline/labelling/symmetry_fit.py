"""Mirror planes and half-turn axes of a surface, by registering it to its own moved copy.

The motion keeps its kind while it is fitted: a plane has three unknowns, an axis four, so that nothing
slides (Cicconet et al. 2017 register freely and read the plane off afterwards). Point to plane,
Gauss-Newton, with Tukey's weights: a handle on a cup does not pull its axis.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from manipose_mj.poses import rotation_about

COARSE, FINE = 500, 3_000  # points that are moved
COARSE_STEPS, FINE_STEPS = 8, 12
# Residuals beyond this share of the diagonal have no weight, at first and at last.
WIDE, NARROW = 0.12, 0.02
SLACK = 0.002  # which is never less than the scanner's noise and a little wear [m]
SAME_PLANE = np.deg2rad(4.0)
DAMPING = 1e-4


def mirror_planes(
    cloud: SurfaceCloud, normals: Iterable[Float[np.ndarray, "3"]]
) -> list[tuple[Float[np.ndarray, "3"], float]]:
    """The best planes that the fits from these starting normals end in, best first.

    Args:
      cloud: The surface.
      normals: `(3,)`, unit; the plane starts through the cloud's centroid.

    Returns:
      Unit normal n and offset d of distinct planes `n @ p = d`, by their mean residual.
    """
    middle = cloud.points.mean(axis=0)
    found: list[tuple[float, np.ndarray]] = []
    for normal in normals:
        plane, cost = _fit_plane(cloud, normal, float(normal @ middle), COARSE, COARSE_STEPS, WIDE)
        if all(abs(plane[:3] @ other[:3]) < np.cos(SAME_PLANE) for _, other in found):
            found.append((cost, plane))
            continue
        for index, (other_cost, other) in enumerate(found):
            if abs(plane[:3] @ other[:3]) >= np.cos(SAME_PLANE) and cost < other_cost:
                found[index] = (cost, plane)
                break
    found.sort(key=lambda entry: entry[0])
    return [(plane[:3], float(plane[3])) for _, plane in found]


def refined_plane(
    cloud: SurfaceCloud, normal: Float[np.ndarray, "3"], offset: float
) -> tuple[Float[np.ndarray, "3"], float]:
    """The plane fitted to more points, with what breaks the symmetry left out."""
    plane, _ = _fit_plane(cloud, normal, offset, FINE, FINE_STEPS, NARROW)
    return plane[:3], float(plane[3])


def half_turn_axis(
    cloud: SurfaceCloud,
    axis: Float[np.ndarray, "3"],
    point: Float[np.ndarray, "3"],
    chosen: Int[np.ndarray, "k"] | None = None,
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """The axis near `axis` about which half a turn maps the surface onto itself best, and its point.

    Only the `chosen` points of the surface are turned, where they are given.
    """
    turned = cloud.points if chosen is None else cloud.points[chosen]
    for count, steps, width in ((COARSE, 2 * COARSE_STEPS, WIDE), (FINE, FINE_STEPS, NARROW)):
        points, scale = turned[:: max(1, len(turned) // count)], cloud.diagonal / 2
        for step in range(steps):
            offsets = points - point
            along = offsets @ axis
            moved = point + 2 * along[:, None] * axis - offsets
            gap, normals, weight = _gap(cloud, moved, width * max(1.0, 3 - step))
            across = _across(axis)
            # d moved = 2 (along da + (offsets . da) axis) + 2 dp for a step da of the axis, dp of the point
            turning = 2 * (
                along[:, None] * (normals @ across) + (normals @ axis)[:, None] * (offsets @ across)
            )
            rows = np.concatenate([turning / scale, 2 * normals @ across], axis=1)
            move = _solve(rows, gap, weight)
            axis = axis + across @ move[:2] / scale
            axis = axis / np.linalg.norm(axis)
            point = point + across @ move[2:]
    return axis, point


def plane_through_axis(
    cloud: SurfaceCloud,
    chosen: Int[np.ndarray, "k"],
    axis: Float[np.ndarray, "3"],
    point: Float[np.ndarray, "3"],
    normal: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "3"]:
    """The normal of the plane through an axis that maps some of the points onto the surface best.

    Args:
      cloud: The surface.
      chosen: Which points are reflected.
      axis: `(3,)`, unit; `point`, `(3,)` [m], on it.
      point: See `axis`.
      normal: `(3,)`, unit, square to the axis: where the fit starts.
    """
    offsets = cloud.points[chosen] - point
    for step in range(FINE_STEPS):
        height, along = offsets @ normal, np.cross(axis, normal)
        moved = point + offsets - 2 * height[:, None] * normal
        gap, normals, weight = _gap(cloud, moved, max(WIDE / 2 ** (step / 2), 2 * NARROW))
        rows = -2 * ((offsets @ along) * (normals @ normal) + height * (normals @ along))
        turn = float((weight * rows) @ gap / max(float((weight * rows) @ rows), 1e-12))
        normal = normal + turn * along
        normal = normal / np.linalg.norm(normal)
    return normal


def around(
    axis: Float[np.ndarray, "3"], count: int, start: Float[np.ndarray, "3"] | None = None
) -> list[Float[np.ndarray, "3"]]:
    """Directions square to an axis, evenly over half a turn, the first one `start` made square."""
    first = _across(axis)[:, 0] if start is None else start - (start @ axis) * axis
    first = first / np.linalg.norm(first)
    return [rotation_about(axis, np.pi * k / count) @ first for k in range(count)]


def _fit_plane(
    cloud: SurfaceCloud, normal: np.ndarray, offset: float, count: int, steps: int, width: float
) -> tuple[Float[np.ndarray, "4"], float]:
    points, scale = cloud.points[cloud.thinned(count)], cloud.diagonal / 2
    middle = points.mean(axis=0)
    for step in range(steps + 1):
        height = points @ normal - offset
        moved = points - 2 * height[:, None] * normal
        gap, normals, weight = _gap(cloud, moved, width * max(1.0, 2 - step / 2))
        if step == steps:
            break
        across = _across(normal)
        facing = normals @ normal
        # With the offset of the plane at `middle` kept: d moved = -2 ((p - middle) . dn) n - 2 height dn.
        tilting = -2 * (
            facing[:, None] * ((points - middle) @ across) + height[:, None] * (normals @ across)
        )
        rows = np.concatenate([tilting / scale, 2 * facing[:, None]], axis=1)
        move = _solve(rows, gap, weight)
        at_middle = offset - normal @ middle + move[2]
        normal = normal + across @ move[:2] / scale
        normal = normal / np.linalg.norm(normal)
        offset = float(normal @ middle + at_middle)
    limit = (width * cloud.diagonal + SLACK) ** 2
    return np.append(normal, offset), float(np.minimum(gap**2, limit).mean())


def _gap(
    cloud: SurfaceCloud, moved: Float[np.ndarray, "n 3"], width: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance of moved points from the surface along its normals, the normals, Tukey's weights."""
    distance, nearest = cloud.tree.query(moved)
    normals = cloud.normals[nearest]
    gap = np.einsum("ij,ij->i", cloud.points[nearest] - moved, normals)
    limit = width * cloud.diagonal + SLACK
    weight = np.clip(1 - (distance / (2 * limit)) ** 2, 0, None) ** 2
    weight = weight * np.clip(1 - (gap / limit) ** 2, 0, None) ** 2
    return gap, normals, weight


def _solve(rows: np.ndarray, gap: np.ndarray, weight: np.ndarray) -> np.ndarray:
    weighted = rows * weight[:, None]
    matrix = rows.T @ weighted
    damped = matrix + DAMPING * np.trace(matrix) / len(matrix) * np.eye(len(matrix))
    return np.linalg.solve(damped + 1e-12 * np.eye(len(matrix)), weighted.T @ gap)


def _across(axis: np.ndarray) -> Float[np.ndarray, "3 2"]:
    """Two unit directions square to an axis and to each other."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(axis, helper)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)], axis=1)
