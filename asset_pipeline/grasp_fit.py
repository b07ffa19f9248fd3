"""Fit the hand to one antipodal pair: every approach about its line, what the pads touch, what hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from asset_pipeline.antipodal import FRICTION, MIN_WIDTH
from asset_pipeline.geometry import MassProperties
from asset_pipeline.gripper import ParallelJaw
from asset_pipeline.touch_points import SurfacePoints

APPROACHES = 24
DEPTHS = (0.0, 0.005)  # of the pair beyond the pads' centre, towards the tips [m]
STANDOFF = 0.10  # where the straight approach starts [m]
MARGIN = 0.0015  # kept between the open fingers and the object's points [m]
COARSE_CELL = 0.010  # for the hand's large boxes fewer points do, with a larger margin [m]
COARSE_MARGIN = 0.003
PAD_DEPTH = 0.001  # points this close to the first touched count as touched [m]
MIN_COVER = 0.25  # least share of a pad that must touch
FACING = 0.7  # cosine: a touched point looks at its pad
SLANT = 0.05  # of the touched faces, at which quality has fallen to 1/e: 18 degrees
SKEW = 0.006  # between the middles of what the pads touch, at which it has fallen to 1/e [m]
JERK = 20.0  # twice gravity, which a carried object may feel [m/s^2]
TORSION = 0.005  # of the pads' contact, as an arm of the friction force [m]


@dataclass(frozen=True)
class ObjectCloud:
    """The object as points in its own frame.

    Attributes:
      touch: The surface that fingers touch.
      obstacles: `(m, 3)` [m], all that the open fingers must not meet.
      coarse: `(c, 3)` [m], fewer of them and the outermost corners, for the hand's large boxes.
      mass_properties: What hangs in the hand.
    """

    touch: SurfacePoints
    obstacles: Float[np.ndarray, "m 3"]
    coarse: Float[np.ndarray, "c 3"]
    mass_properties: MassProperties


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


@dataclass(frozen=True)
class _Contact:
    """Of each approach.

    Attributes:
      width: Between the first points that the pads touch [m]; 0 where one touches nothing.
      middle: Of these along the closing direction, from the pair's centre [m].
      cover: Share of the pad that touches, the lesser of the two.
      radius: Of what touches, root mean square, the lesser of the two [m].
      skew: Between the middles of what the two pads touch, across the closing direction [m].
    """

    width: Float[np.ndarray, "k"]
    middle: Float[np.ndarray, "k"]
    cover: Float[np.ndarray, "k"]
    radius: Float[np.ndarray, "k"]
    skew: Float[np.ndarray, "k"]


def fit_pair(
    cloud: ObjectCloud, i: int, j: int, gripper: ParallelJaw, up: Float[np.ndarray, "3"]
) -> Candidates:
    """The grasps that close on points i and j, for each approach direction and depth that works.

    Kept are those whose pads both find enough surface and whose open hand, on the straight way in
    from the standoff, meets no point of the object.

    Args:
      cloud: The object.
      i: A point of `cloud.touch`.
      j: The one opposite.
      gripper: The hand.
      up: Of the object at rest; one of the approaches comes as straight from above as it can.
    """
    touch = cloud.touch
    closing = touch.normals[j] - touch.normals[i]
    length = float(np.linalg.norm(closing))
    closing /= length
    center = (touch.points[i] + touch.points[j]) / 2
    half = float((touch.points[j] - touch.points[i]) @ closing) / 2
    axes = np.repeat(_approach_axes(closing, up), len(DEPTHS), axis=0)
    depth = np.tile(DEPTHS, APPROACHES)

    contact = _contact(touch, center, half, axes, depth, gripper)
    good = (contact.cover > MIN_COVER) & (contact.width > MIN_WIDTH)
    good &= contact.width < gripper.max_opening - gripper.min_clearance
    index = np.flatnonzero(good)
    origins = (
        center + contact.middle[index, None] * closing - depth[index, None] * axes[index][:, :, 2]
    )
    free = _free(cloud, origins, axes[index], contact.width[index], gripper)
    index, origins = index[free], origins[free]

    poses = np.tile(np.eye(4), (len(index), 1, 1))
    poses[:, :3, :3] = axes[index]
    poses[:, :3, 3] = origins
    weight = cloud.mass_properties
    lever = np.linalg.norm(np.cross(weight.center_of_mass - center, closing))
    slant = 1 - length / 2  # one minus the cosine between either normal and the closing direction
    # Friction of both pads about the closing line, against the weight's torque.
    capacity = 2 * FRICTION * gripper.grip_force * (contact.radius[index] + TORSION)
    load = weight.mass * JERK * lever / capacity
    tight = (gripper.opening(contact.width[index]) - contact.width[index]) / (2 * gripper.clearance)
    quality = np.minimum(contact.cover[index], 1.0) * (0.5 + 0.5 * tight)
    quality *= np.exp(-slant / SLANT - contact.skew[index] / SKEW) / (1 + load**4)
    return Candidates(poses, contact.width[index], quality)


def _approach_axes(
    closing: Float[np.ndarray, "3"], up: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "k 3 3"]:
    """Rotations of the hand with y along `closing`, evenly turned about it, the first from above."""
    first = -up if abs(up @ closing) < 0.95 else np.eye(3)[np.argmin(np.abs(closing))]
    first = first - (first @ closing) * closing
    first /= np.linalg.norm(first)
    other = np.cross(closing, first)
    angles = np.arange(APPROACHES)[:, None] * (2 * np.pi / APPROACHES)
    z = np.cos(angles) * first + np.sin(angles) * other
    return np.stack([np.cross(closing, z), np.broadcast_to(closing, z.shape), z], axis=2)


def _contact(
    touch: SurfacePoints,
    center: Float[np.ndarray, "3"],
    half: float,
    axes: Float[np.ndarray, "k 3 3"],
    depth: Float[np.ndarray, "k"],
    gripper: ParallelJaw,
) -> _Contact:
    """What pads touch that close along the common y of `axes` on a pair `2 half` apart."""
    reach = np.hypot(gripper.pad_half_width, gripper.pad_half_height + max(DEPTHS))
    y, radius = _about_line(touch.points, center, axes[0, :, 1])
    near = (np.abs(np.abs(y) - half) < gripper.clearance) & (radius < reach)
    offset = touch.points[near] - center
    x, z = _along(axes[:, :, 0], offset), _along(axes[:, :, 2], offset) + depth[:, None]
    y = y[near]
    outward = _along(axes[:1, :, 1], touch.normals[near])[0] * np.sign(y)
    window = (np.abs(x) < gripper.pad_half_width) & (np.abs(z) < gripper.pad_half_height)
    high = np.where(window & (y > 0), y, -np.inf).max(axis=1, initial=-np.inf)
    low = np.where(window & (y < 0), y, np.inf).min(axis=1, initial=np.inf)
    facing = window & (outward > FACING)
    upper = _patch(x, z, facing & (y > high[:, None] - PAD_DEPTH))
    lower = _patch(x, z, facing & (y < low[:, None] + PAD_DEPTH))
    touched = np.isfinite(high) & np.isfinite(low)
    width, middle = np.zeros(len(axes)), np.zeros(len(axes))
    width[touched] = (high - low)[touched]
    middle[touched] = (high + low)[touched] / 2
    full = 4 * gripper.pad_half_width * gripper.pad_half_height / touch.spacing**2
    return _Contact(
        width=width,
        middle=middle,
        cover=np.where(touched, np.minimum(upper[0], lower[0]) / full, 0.0),
        radius=np.minimum(upper[3], lower[3]),
        skew=np.hypot(upper[1] - lower[1], upper[2] - lower[2]),
    )


def _patch(x: np.ndarray, z: np.ndarray, touched: Bool[np.ndarray, "k m"]) -> np.ndarray:
    """`(4, k)`: number, middle and root mean square radius of the touched points."""
    count = touched.sum(axis=1)
    share = touched / np.maximum(count, 1)[:, None]
    middle_x, middle_z = (share * x).sum(axis=1), (share * z).sum(axis=1)
    square = (share * (x**2 + z**2)).sum(axis=1) - middle_x**2 - middle_z**2
    return np.stack([count, middle_x, middle_z, np.sqrt(np.maximum(square, 0.0))])


def _free(
    cloud: ObjectCloud,
    origins: Float[np.ndarray, "k 3"],
    axes: Float[np.ndarray, "k 3 3"],
    width: Float[np.ndarray, "k"],
    gripper: ParallelJaw,
) -> Bool[np.ndarray, "k"]:
    """Whether the open hand on its way in meets no point of the object."""
    if len(width) == 0:
        return np.zeros(0, bool)
    boxes = gripper.boxes(gripper.opening(width))
    fingers, hand = np.split(boxes, [2 * len(gripper.finger)], axis=1)
    hand[..., 0, 1] -= COARSE_MARGIN
    hand[..., 1, 1] += COARSE_MARGIN
    # The way in; the fingers' is that of the hand's body, which is wider, further back.
    front = hand[..., 1, 2].max()
    fingers[..., 0, 2] = np.minimum(fingers[..., 0, 2], front)
    hand[..., 0, 2] -= STANDOFF
    _, radius = _about_line(cloud.obstacles, origins[0], axes[0, :, 1])
    reach = np.hypot(*np.abs(fingers[..., [0, 2]]).max(axis=(0, 1, 2))) + max(DEPTHS) + 2 * MARGIN
    near = cloud.obstacles[radius < reach]
    free = ~_meets(near, origins, axes, fingers, MARGIN)
    free[free] = ~_meets(cloud.coarse, origins[free], axes[free], hand[free], COARSE_MARGIN)
    return free


def _along(axes: Float[np.ndarray, "k 3"], vectors: Float[np.ndarray, "n 3"]) -> np.ndarray:
    """`(k, n)` products, written out: threads of a BLAS cost more than they save on so few."""
    a, v = axes.astype(np.float32)[:, :, None], vectors.astype(np.float32)
    return a[:, 0] * v[:, 0] + a[:, 1] * v[:, 1] + a[:, 2] * v[:, 2]


def _about_line(
    points: Float[np.ndarray, "n 3"], center: Float[np.ndarray, "3"], axis: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Where points are along a line and how far from it [m]."""
    offset = points - center
    along = _along(axis[None], offset)[0]
    square = np.einsum("ni,ni->n", offset, offset) - along**2
    return along, np.sqrt(np.maximum(square, 0.0))


def _meets(
    points: Float[np.ndarray, "m 3"],
    origins: Float[np.ndarray, "k 3"],
    axes: Float[np.ndarray, "k 3 3"],
    boxes: Float[np.ndarray, "k b 2 3"],
    margin: float,
) -> Bool[np.ndarray, "k"]:
    """Whether any point lies in any box grown by the margin; along y the clearance is the margin.

    The hands share one closing direction.
    """
    meets = np.zeros(len(axes), bool)
    if len(axes) == 0:
        return meets
    y = _along(axes[:1, :, 1], points)[0]
    shift = np.einsum("ki,kij->kj", origins, axes)
    fronts = boxes[:, :, 1, 2].max(axis=0)
    boxes = boxes + shift[:, None, None]
    low, high = boxes[:, :, 0, 1].min(axis=0), boxes[:, :, 1, 1].max(axis=0)
    layer = ((y[:, None] > low) & (y[:, None] < high)).any(axis=1)
    points, y = points[layer], y[layer]
    x, z = _along(axes[:, :, 0], points), _along(axes[:, :, 2], points)
    # The origins lie within `DEPTHS` of each other, so this is the distance from any hand's y axis.
    radius = np.hypot(x[0] - shift[0, 0], z[0] - shift[0, 2]) + max(DEPTHS) + margin
    for box, front in zip(boxes.transpose(1, 0, 2, 3), fronts, strict=True):
        left = np.flatnonzero(~meets)  # of the hands, those that no box before this one stopped
        if len(left) == 0:
            break
        (x0, y0, z0), (x1, y1, z1) = box[left].transpose(1, 2, 0)[..., None]
        near = np.flatnonzero((y > y0.min()) & (y < y1.max()) & (radius > -front))
        inside = z[np.ix_(left, near)] < z1 + margin
        near = near[inside.any(axis=0)]  # most points lie in front of the box
        grid = np.ix_(left, near)
        inside = (np.abs(x[grid] - (x0 + x1) / 2) < (x1 - x0) / 2 + margin) & (y[near] > y0)
        inside &= (y[near] < y1) & (z[grid] > z0 - margin) & (z[grid] < z1 + margin)
        meets[left] = inside.any(axis=1)
    return meets
