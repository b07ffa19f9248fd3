"""Room for the hand in a cavity: which grasps of what lies there keep clear of its walls and of what else lies there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Cavity, GraspSet
from manipose_mj.assets.franka_hand import FINGER_OFFSET, HAND_BOXES, TCP_OFFSET

# A cosine: grasps must come through the open side, or nearly.
_TOWARDS = 0.85
MAX_WIDTH = 0.0765  # between the pads [m]; they open 80 mm
_OPENING = 0.006  # of each finger beside what it takes [m]
# Of a finger, in the TCP's frame: half its width, its thickness, from where to where along the approach [m].
_FINGER = (0.0105, 0.026, FINGER_OFFSET - TCP_OFFSET, 0.009)
_WALLS = 0.003  # kept from them [m]
_CORNERS = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True)
class Placement:
    """A thing that lies in a cavity: place `(2,)` of its box from the centre, reach `(3,)` [m]."""

    place: Float[np.ndarray, "2"]
    reach: Float[np.ndarray, "3"]


def free_grasps(
    grasps: GraspSet,
    stable: int,
    pose: Float[np.ndarray, "4 4"],
    cavity: Cavity,
    outwards: Float[np.ndarray, "3"],
    others: Sequence[Placement] = (),
) -> int:
    """How many grasps of an object have room for hand and fingers where it lies.

    Args:
      grasps: Of the object.
      stable: Index of the stable pose it lies in.
      pose: `T_cavity_object`.
      cavity: Where.
      outwards: Unit vector through its open side, in its frame.
      others: What lies beside it.
    """
    hands = hands_around(grasps, stable, pose[:3, :3], outwards)
    return count_clear(hands, pose[:3, 3], cavity, outwards, others)


def hands_around(
    grasps: GraspSet,
    stable: int,
    rotation: Float[np.ndarray, "3 3"],
    outwards: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "k b 8 3"]:
    """Corners of the hand and its fingers at the grasps that come through the open side.

    Args:
      grasps: Of an object.
      stable: Index of the stable pose it lies in.
      rotation: `R_cavity_object`.
      outwards: Unit vector through the open side, in the cavity's frame.

    Returns:
      From the object's origin, along the cavity's axes [m].
    """
    turned = rotation @ grasps.poses[:, :3, :3]
    usable = grasps.clear[:, stable].astype(bool) & (grasps.widths < MAX_WIDTH)
    usable &= turned[:, :, 2] @ -outwards > _TOWARDS
    if not usable.any():
        return np.zeros((0, 3, 8, 3))
    hands = _hands(grasps.widths[usable])
    centers = grasps.poses[usable, :3, 3] @ rotation.T
    return np.einsum("kij,kbcj->kbci", turned[usable], hands) + centers[:, None, None]


def count_clear(
    hands: Float[np.ndarray, "k b 8 3"],
    origin: Float[np.ndarray, "3"],
    cavity: Cavity,
    outwards: Float[np.ndarray, "3"],
    others: Sequence[Placement] = (),
) -> int:
    """How many hands of `hands_around` are clear of the walls and of what else lies there.

    Args:
      hands: Their corners.
      origin: Of the object, from the cavity's centre [m].
      cavity: Where.
      outwards: Unit vector through its open side, in its frame.
      others: What lies beside the object.
    """
    if not len(hands):
        return 0
    corners, half = hands + origin, cavity.extents / 2
    # What is beyond the open side may be anywhere; the floor is the grasp's own affair.
    beyond = corners @ outwards > np.abs(outwards) @ half
    room = np.where(np.abs(outwards) > 0.5, np.inf, half - _WALLS)
    within = (np.abs(corners[..., :2]) <= room[:2]).all(axis=-1) & (corners[..., 2] <= room[2])
    clear = (beyond | within).all(axis=(1, 2))
    low, high = corners.min(axis=2), corners.max(axis=2)
    for other in others:
        bottom = np.append(other.place - other.reach[:2], -half[2])
        top = np.append(other.place + other.reach[:2], -half[2] + 2 * other.reach[2])
        clear &= ~((low < top) & (high > bottom)).all(axis=2).any(axis=1)
    return int(clear.sum())


def _hands(widths: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k b 8 3"]:
    """Corners of the hand and of its opening fingers around things of these widths, in the TCP's frame [m]."""
    half, thickness, back, front = _FINGER
    low, high = (np.array(corner) - [0, 0, TCP_OFFSET] for corner in HAND_BOXES[0])
    palm = low + _CORNERS * (high - low)
    boxes = [np.broadcast_to(palm, (len(widths), 8, 3))]
    inner, outer = widths / 2, widths / 2 + thickness + _OPENING
    for side in (-1.0, 1.0):
        near = np.stack([np.full_like(inner, -half), side * inner, np.full_like(inner, back)], 1)
        far = np.stack([np.full_like(inner, half), side * outer, np.full_like(inner, front)], 1)
        boxes.append(near[:, None] + _CORNERS * (far - near)[:, None])
    return np.stack(boxes, axis=1)
