"""Which way is up for a mirror-symmetric thing: the tilt, within its plane, that a source leaves open."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from manipose_mj.poses import rotation_about

MAX_LEAN = np.deg2rad(13.0)  # of a source's up from the object's own
STEP = np.deg2rad(0.5)
LEVEL = np.deg2rad(3.0)  # a surface is level or upright to within
CLEAR_LEVEL = 0.03  # of the surface, more than at the median tilt
REFINEMENTS = 3
CONTACT = 0.0015  # what is so near the floor stands on it [m]
DOWNWARD = 0.5  # a point stands when its normal is within 60 degrees of down
CLEAR_FOOTING = 0.3  # of the length between the outermost points that stand


def upright(
    cloud: SurfaceCloud, up: Float[np.ndarray, "3"], normal: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3"], float]:
    """The object's own up, square to `normal` and within `MAX_LEAN` of `up`.

    It is the tilt at which most of the surface is level or upright, seen along the mirror plane's normal:
    bases, lids and walls agree on it. Where no tilt stands out (a hat, a helmet), it is the one at which
    the object rests on the widest footing that has its centroid above it.

    Args:
      cloud: The surface.
      up: `(3,)`, unit, about up.
      normal: `(3,)`, unit, of the mirror plane.

    Returns:
      The direction, and how clear it is, from 0 to 1.
    """
    start = up - (up @ normal) * normal
    start = start / np.linalg.norm(start)
    angles = np.arange(-MAX_LEAN, MAX_LEAN + STEP / 2, STEP)
    axes = [rotation_about(normal, float(angle)) @ start for angle in angles]
    level = np.array([_level(cloud, axis, normal)[1].mean() for axis in axes])
    clear = (level.max() - np.median(level)) / CLEAR_LEVEL
    if clear >= 1:
        return _levelled(cloud, axes[int(level.argmax())], normal), 1.0
    axis, width = _standing(cloud, axes, normal)
    along = cloud.points @ np.cross(normal, axis)
    return axis, float(np.clip(width / np.ptp(along) / CLEAR_FOOTING, 0.0, 1.0))


def _level(
    cloud: SurfaceCloud, axis: np.ndarray, normal: np.ndarray
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """For every point, by how much its surface leans [rad], and a weight: 1 level or upright."""
    height = cloud.normals @ axis
    across = cloud.normals @ np.cross(normal, axis)
    rising, lying = np.abs(across) < np.abs(height), np.sign(height)
    lean = np.where(rising, across * lying, -height * np.sign(across))
    aside = np.abs(cloud.normals @ normal)
    return lean, np.exp(-(lean**2 + aside**2) / LEVEL**2)


def _levelled(cloud: SurfaceCloud, axis: np.ndarray, normal: np.ndarray) -> Float[np.ndarray, "3"]:
    """The axis turned until what is about level or upright is so on average."""
    for _ in range(REFINEMENTS):
        lean, weight = _level(cloud, axis, normal)
        axis = axis + float(lean @ weight / weight.sum()) * np.cross(normal, axis)
        axis = axis / np.linalg.norm(axis)
    return axis


def _standing(
    cloud: SurfaceCloud, axes: list[np.ndarray], normal: np.ndarray
) -> tuple[Float[np.ndarray, "3"], float]:
    """The axis with the widest footing under the centroid (the widest, where none is), and its width."""
    best, widest = axes[len(axes) // 2], -1.0
    middle = cloud.points.mean(axis=0)
    for axis in axes:
        along = np.cross(normal, axis)
        height = cloud.points @ axis
        low = height < np.percentile(height, 0.1) + CONTACT
        low &= cloud.normals @ axis < -DOWNWARD
        if low.sum() < 10:
            continue
        place = cloud.points[low] @ along
        first, last = np.percentile(place, (2, 98))
        width = last - first
        stable = first < middle @ along < last
        slope = np.polyfit(place, height[low], 1)[0]
        score = float(width if stable else 0.1 * width)
        if score > widest:
            best, widest = axis - slope * along, score
    return best / np.linalg.norm(best), widest
