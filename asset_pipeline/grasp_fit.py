"""Fit the hand to one antipodal pair: every approach about its line, what the pads touch, what hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from asset_pipeline.antipodal import MIN_WIDTH
from asset_pipeline.gripper import ParallelJaw

APPROACHES = 24
STANDOFF = 0.10  # where the straight approach starts [m]
MARGIN = 0.0015  # kept between the open fingers and the object's points [m]
COARSE_CELL = 0.008  # for the hand's large boxes fewer points do, with a larger margin [m]
COARSE_MARGIN = 0.003
PAD_DEPTH = 0.0015  # points this close to the first touched count as touched [m]
MIN_COVER = 0.25  # least share of a pad that must touch
FACING = 0.7  # cosine: a touched point looks at its pad
LEVER = 0.10  # of the weight about the closing line, at which quality has fallen to 1/e [m]

SLANT = 0.05  # of the touched faces, at which quality has fallen to 1/e: 18 degrees


@dataclass(frozen=True)
class ObjectCloud:
    """The object as points in its own frame.

    Attributes: points and normals `(n, 3)` of the visible surface, spacing [m] apart; obstacles
    `(m, 3)`, these and the points of the collision shapes; coarse `(c, 3)`, every cell's first of the
    obstacles, for the hand's large boxes; center_of_mass `(3,)` [m].
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    spacing: float
    obstacles: Float[np.ndarray, "m 3"]
    coarse: Float[np.ndarray, "c 3"]
    center_of_mass: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Candidates:
    """Grasps with a quality in [0, 1]. Attributes: poses `T_object_tcp`; widths [m]; quality."""

    poses: Float[np.ndarray, "n 4 4"]
    widths: Float[np.ndarray, "n"]
    quality: Float[np.ndarray, "n"]

    def __len__(self) -> int:
        return len(self.widths)

    @classmethod
    def joined(cls, parts: Sequence[Candidates]) -> Candidates:
        """All of `parts`, in order; none gives none."""
        return cls(
            np.concatenate([np.empty((0, 4, 4)), *(p.poses for p in parts)]),
            np.concatenate([np.empty(0), *(p.widths for p in parts)]),
            np.concatenate([np.empty(0), *(p.quality for p in parts)]),
        )


def fit_pair(cloud: ObjectCloud, i: int, j: int, gripper: ParallelJaw) -> Candidates:
    """The grasps that close on points i and j, one for each approach direction that works.

    Kept are those whose pads both find enough surface and whose open hand, on the straight way in
    from the standoff, meets no point of the object.
    """
    closing = cloud.normals[j] - cloud.normals[i]
    length = float(np.linalg.norm(closing))
    closing /= length
    center = (cloud.points[i] + cloud.points[j]) / 2
    half = float((cloud.points[j] - cloud.points[i]) @ closing) / 2
    axes = _approach_axes(closing)

    near = np.abs(np.abs((cloud.points - center) @ closing) - half) < gripper.clearance
    near &= np.linalg.norm(cloud.points - center, axis=1) < half + 0.03
    width, middle, cover = _contact(cloud, center, axes, near, gripper)
    good = (cover > MIN_COVER) & (width > MIN_WIDTH)
    good &= width < gripper.max_opening - gripper.min_clearance
    index = np.flatnonzero(good)
    index = index[_free(cloud, center, axes[index], width[index], middle[index], gripper)]

    poses = np.tile(np.eye(4), (len(index), 1, 1))
    poses[:, :3, :3] = axes[index]
    poses[:, :3, 3] = center + middle[index, None] * closing
    lever = np.linalg.norm(np.cross(cloud.center_of_mass - poses[:, :3, 3], closing), axis=1)
    slant = 1 - length / 2  # one minus the cosine between either normal and the closing direction
    quality = np.minimum(cover[index], 1.0) * np.exp(-lever / LEVER - slant / SLANT)
    return Candidates(poses, width[index], quality)


def _approach_axes(closing: Float[np.ndarray, "3"]) -> Float[np.ndarray, "k 3 3"]:
    """Rotations of the hand with y along `closing`, evenly turned about it."""
    side = np.cross(closing, np.eye(3)[np.argmin(np.abs(closing))])
    side /= np.linalg.norm(side)
    other = np.cross(side, closing)
    angles = np.arange(APPROACHES)[:, None] * (2 * np.pi / APPROACHES)
    x = np.cos(angles) * side - np.sin(angles) * other
    z = np.sin(angles) * side + np.cos(angles) * other
    return np.stack([x, np.broadcast_to(closing, x.shape), z], axis=2)


def _contact(
    cloud: ObjectCloud,
    center: Float[np.ndarray, "3"],
    axes: Float[np.ndarray, "k 3 3"],
    near: Bool[np.ndarray, "n"],
    gripper: ParallelJaw,
) -> tuple[Float[np.ndarray, "k"], Float[np.ndarray, "k"], Float[np.ndarray, "k"]]:
    """Distance between the first points that the pads touch, its middle, and the pads' cover."""
    offset = cloud.points[near] - center
    x, z = (offset @ axes[:, :, 0].T).T, (offset @ axes[:, :, 2].T).T
    y = offset @ axes[0, :, 1]
    outward = (cloud.normals[near] @ axes[0, :, 1]) * np.sign(y)
    window = (np.abs(x) < gripper.pad_half_width) & (np.abs(z) < gripper.pad_half_height)
    high = np.where(window & (y > 0), y, -np.inf).max(axis=1, initial=-np.inf)
    low = np.where(window & (y < 0), y, np.inf).min(axis=1, initial=np.inf)
    full = 4 * gripper.pad_half_width * gripper.pad_half_height / cloud.spacing**2
    facing = window & (outward > FACING)
    upper = (facing & (y > high[:, None] - PAD_DEPTH)).sum(axis=1)
    lower = (facing & (y < low[:, None] + PAD_DEPTH)).sum(axis=1)
    touched = np.isfinite(high) & np.isfinite(low)
    width, middle = np.zeros(len(axes)), np.zeros(len(axes))
    width[touched] = (high - low)[touched]
    middle[touched] = (high + low)[touched] / 2
    return width, middle, np.where(touched, np.minimum(upper, lower) / full, 0.0)


def _free(
    cloud: ObjectCloud,
    center: Float[np.ndarray, "3"],
    axes: Float[np.ndarray, "k 3 3"],
    width: Float[np.ndarray, "k"],
    middle: Float[np.ndarray, "k"],
    gripper: ParallelJaw,
) -> Bool[np.ndarray, "k"]:
    """Whether the open hand on its way in meets no point of the object."""
    boxes = gripper.boxes(gripper.opening(width))
    boxes[..., 1] += middle[:, None, None]
    boxes[..., 0, 2] -= STANDOFF  # the way in
    fingers, hand = np.split(boxes, [2 * len(gripper.finger)], axis=1)
    free = ~_meets(cloud.obstacles - center, axes, fingers, MARGIN)
    free[free] = ~_meets(cloud.coarse - center, axes[free], hand[free], COARSE_MARGIN)
    return free


def _meets(
    points: Float[np.ndarray, "m 3"],
    axes: Float[np.ndarray, "k 3 3"],
    boxes: Float[np.ndarray, "k b 2 3"],
    margin: float,
) -> Bool[np.ndarray, "k"]:
    """Whether any point lies in any box grown by the margin; along y the clearance is the margin."""
    meets = np.zeros(len(axes), bool)
    if len(axes) == 0:
        return meets
    y = points @ axes[0, :, 1]
    for box in boxes.transpose(1, 2, 3, 0):
        (x0, y0, z0), (x1, y1, z1) = box[..., None]
        layer = (y > y0.min()) & (y < y1.max())
        x, z = axes[:, :, 0] @ points[layer].T, axes[:, :, 2] @ points[layer].T
        inside = (x > x0 - margin) & (x < x1 + margin) & (z > z0 - margin) & (z < z1 + margin)
        inside &= (y[layer] > y0) & (y[layer] < y1)
        meets |= inside.any(axis=1)
    return meets
