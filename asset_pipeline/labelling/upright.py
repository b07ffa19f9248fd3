"""Which way is up for a mirror-symmetric thing: the tilt, within its plane, that a source leaves open."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from manipose_mj.poses import rotation_about

MAX_LEAN = np.deg2rad(13.0)  # of a source's up from the object's own
STEP, FINE = np.deg2rad(0.5), np.deg2rad(0.1)
LEVEL = np.deg2rad(3.0)  # a surface is level or upright to within
CLEAR_LEVEL = 0.03  # of the surface, more than at the median tilt
LEVEL_AT_REST = (
    0.5  # of what is level at the best tilt, to be so at rest; else one of them is wrong
)
REFINEMENTS = 3
CLEAR_RISE = 0.001  # of the length, by which the centroid rises when it is rolled by a degree
CONTACT = 0.0015  # what is so near the floor stands on it [m]
DOWNWARD = 0.5  # a point stands when its normal is within 60 degrees of down
WIDE_FOOTING = 0.4  # of the length: decides the tilt, where it agrees with what is level
NEAR = np.deg2rad(2.5)  # to within


def upright(
    cloud: SurfaceCloud, up: Float[np.ndarray, "3"], normal: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3"], float]:
    """The object's own up, square to `normal` and within `MAX_LEAN` of `up`.

    Seen along the mirror plane's normal, it is one of the tilts at which the object can rest: the one at
    which most of the surface is level or upright (a camera could also rest on its lens). Where it
    rests at none (a ball of a handle, a tool), or hardly, with far less level than at another tilt (a
    camera on the edge of its base and its lens), what is level decides alone.

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
    levelled = _levelled(cloud, axes[int(level.argmax())], normal)
    clear = float(np.clip((level.max() - np.median(level)) / CLEAR_LEVEL, 0.0, 1.0))
    rests = _rests(cloud, start, normal)
    if not rests:
        return levelled, clear
    axis, rise = max(rests, key=lambda rest: float(_level(cloud, rest[0], normal)[1].mean()))
    firm = float(np.clip(rise / CLEAR_RISE - 1, 0.0, 1.0))
    if levelled @ axis < np.cos(2 * NEAR):
        share = float(_level(cloud, axis, normal)[1].mean() / level.max())
        if clear == 1 and firm < 1 and share < LEVEL_AT_REST:
            return levelled, 1.0
        clear = firm = min(share / LEVEL_AT_REST, 1.0)
    near = np.arange(-NEAR, NEAR + STEP / 2, STEP)
    around = [rotation_about(normal, float(angle)) @ axis for angle in near]
    standing, width = _standing(cloud, around, normal)
    if width > WIDE_FOOTING and standing @ axis > np.cos(NEAR):
        axis = standing
    elif clear == 1 and levelled @ axis > np.cos(NEAR):
        axis = levelled
    return axis, max(clear, firm)


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


def _rests(
    cloud: SurfaceCloud, up: np.ndarray, normal: np.ndarray
) -> list[tuple[Float[np.ndarray, "3"], float]]:
    """The axes on which the object rests, and how stably.

    There the surface's centroid is lower above the floor than a degree to either side, by at least
    `CLEAR_RISE` of the length.
    """
    along = np.cross(normal, up)
    flat = np.stack([cloud.points @ along, cloud.points @ up], axis=1)
    flat = flat - flat.mean(axis=0)
    corners = flat[ConvexHull(flat).vertices]
    degree = round(np.deg2rad(1.0) / FINE)
    angles = np.arange(-MAX_LEAN - degree * FINE, MAX_LEAN + degree * FINE, FINE)
    axes = np.stack([np.sin(angles), np.cos(angles)], axis=1)
    lift = -(corners @ axes.T).min(axis=0)
    found = []
    for k in range(degree, len(angles) - degree):
        if lift[k] == lift[k - degree : k + degree + 1].min():
            rise = (min(lift[k - degree], lift[k + degree]) - lift[k]) / np.ptp(flat[:, 0])
            if rise > CLEAR_RISE:
                found.append((axes[k, 0] * along + axes[k, 1] * up, float(rise)))
    return found


def _standing(
    cloud: SurfaceCloud, axes: list[np.ndarray], normal: np.ndarray
) -> tuple[Float[np.ndarray, "3"], float]:
    """The axis with the widest footing under the centroid, and its width as a share of the length."""
    best, widest = axes[len(axes) // 2], -1.0
    middle = cloud.points.mean(axis=0)
    for axis in axes:
        along = np.cross(normal, axis)
        place, _ = _footing(cloud, axis, along)
        if len(place) < 10:
            continue
        first, last = np.sort(place)[[3, -4]]
        stable = first < middle @ along < last
        score = float(last - first) / float(np.ptp(cloud.points @ along))
        if stable and score > widest:
            best, widest = axis, score
    for _ in range(REFINEMENTS):
        along = np.cross(normal, best)
        place, height = _footing(cloud, best, along)
        if len(place) < 10:
            break
        best = best - np.polyfit(place, height, 1)[0] * along
        best = best / np.linalg.norm(best)
    return best, widest


def _footing(
    cloud: SurfaceCloud, axis: np.ndarray, along: np.ndarray
) -> tuple[Float[np.ndarray, "k"], Float[np.ndarray, "k"]]:
    """Place and height [m] of the points that stand when `axis` is up."""
    height = cloud.points @ axis
    low = height < np.percentile(height, 0.1) + CONTACT
    low &= cloud.normals @ axis < -DOWNWARD
    return cloud.points[low] @ along, height[low]
