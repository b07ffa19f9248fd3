"""Room for the hand in a cavity: which grasps of what lies there keep clear of its walls and of what else lies there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Cavity, GraspSet
from manipose_mj.assets.franka_hand import FINGER_OFFSET, HAND_BOXES, TCP_OFFSET
from manipose_mj.mjcf.panda.reachability import is_reachable

# Cosines to the way through the open side: grasps must come so, or nearly; what is held from above only is tilted.
STRAIGHT, TILTED = 0.85, 0.5
MAX_WIDTH = 0.0765  # between the pads [m]; they open 80 mm
_OPENING = 0.006  # of each finger beside what it takes [m]
# Of a finger, in the TCP's frame: half its width, its thickness, from where to where along the approach [m].
_FINGER = (0.0105, 0.026, FINGER_OFFSET - TCP_OFFSET, 0.009)
# The flange and the last link, in the hand's frame: half their widths, from where to where along the approach [m].
_FLANGE = (0.045, -0.072, 0.018)
_WALLS = 0.003  # kept from them [m]
_PANEL = 0.04  # that a drawer's front stands higher than its cavity [m]
_FRONT = (
    0.022  # thickness of a front, by which a shut drawer is deeper in what it is pulled out of [m]
)
_STANDOFF = 0.06  # from which an object is approached, straight [m]
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
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
    drawn: Float[np.ndarray, "2"] | None = None,
    cavity_world: Float[np.ndarray, "4 4"] | None = None,
    towards: float = STRAIGHT,
) -> int:
    """How many grasps of an object have room for hand and fingers where it lies.

    Args:
      grasps: Of the object.
      stable: Index of the stable pose it lies in.
      pose: `T_cavity_object`.
      cavity: Where.
      outwards: Unit vector through its open side, in its frame.
      others: What lies beside it.
      drawn: How far a drawer is pulled out, in its frame [m]; None: it is none.
      cavity_world: `T_world_cavity`; the arm has to reach the grasps then. None: it may stand anywhere.
      towards: As of `hands_around`.
    """
    if cavity_world is not None:
        grasps = replace(grasps, clear=grasps.clear & _reached(cavity_world @ pose @ grasps.poses))
    hands = hands_around(grasps, stable, pose[:3, :3], outwards, towards)
    return count_clear(hands, pose[:3, 3], cavity, outwards, others, drawn)


def hands_around(
    grasps: GraspSet,
    stable: int,
    rotation: Float[np.ndarray, "3 3"],
    outwards: Float[np.ndarray, "3"],
    towards: float = STRAIGHT,
) -> Float[np.ndarray, "k b 8 3"]:
    """Corners of the hand and its fingers at the grasps that come through the open side.

    Args:
      grasps: Of an object.
      stable: Index of the stable pose it lies in.
      rotation: `R_cavity_object`.
      outwards: Unit vector through the open side, in the cavity's frame.
      towards: Cosine between approach and the way in from which on a grasp comes through it.

    Returns:
      From the object's origin, along the cavity's axes [m].
    """
    turned = rotation @ grasps.poses[:, :3, :3]
    usable = grasps.clear[:, stable].astype(bool) & (grasps.widths < MAX_WIDTH)
    usable &= turned[:, :, 2] @ -outwards > towards
    if not usable.any():
        return np.zeros((0, 4, 8, 3))
    hands = _hands(grasps.widths[usable])
    centers = grasps.poses[usable, :3, 3] @ rotation.T
    return np.einsum("kij,kbcj->kbci", turned[usable], hands) + centers[:, None, None]


def count_clear(
    hands: Float[np.ndarray, "k b 8 3"],
    origin: Float[np.ndarray, "3"],
    cavity: Cavity,
    outwards: Float[np.ndarray, "3"],
    others: Sequence[Placement] = (),
    drawn: Float[np.ndarray, "2"] | None = None,
) -> int:
    """How many hands of `hands_around` are clear of the walls and of what else lies there.

    Args:
      hands: Their corners.
      origin: Of the object, from the cavity's centre [m].
      cavity: Where.
      outwards: Unit vector through its open side, in its frame.
      others: What lies beside the object.
      drawn: How far a drawer is pulled out, in its frame [m]; None: it is none.
    """
    if not len(hands):
        return 0
    corners, half = hands + origin, cavity.extents / 2
    # What is beyond the open side may be anywhere; the floor is the grasp's own affair.
    beyond = corners @ outwards > np.abs(outwards) @ half
    room = np.where(np.abs(outwards) > 0.5, np.inf, half - _WALLS)
    if drawn is not None:
        beyond &= _between_front_and_body(corners, half, drawn)
        room[2] = half[2]
    within = (np.abs(corners[..., :2]) <= room[:2]).all(axis=-1) & (corners[..., 2] <= room[2])
    clear = (beyond | within).all(axis=(1, 2))
    low, high = corners.min(axis=2), corners.max(axis=2)
    for other in others:
        bottom = np.append(other.place - other.reach[:2], -half[2])
        top = np.append(other.place + other.reach[:2], -half[2] + 2 * other.reach[2])
        clear &= ~((low < top) & (high > bottom)).all(axis=2).any(axis=1)
    return int(clear.sum())


def _reached(tcp_poses: Float[np.ndarray, "n 4 4"]) -> Bool[np.ndarray, "n 1"]:
    """Whether the arm alone comes straight to each pose `T_world_tcp`, either way round."""
    ways = np.stack([tcp_poses, tcp_poses @ _HALF_TURN], axis=1)
    back = ways.copy()
    back[..., :3, 3] -= _STANDOFF * back[..., :3, 2]
    found = is_reachable(ways) & is_reachable(back)
    return np.any(found, axis=1, keepdims=True)


def _between_front_and_body(
    corners: Float[np.ndarray, "k b 8 3"],
    half: Float[np.ndarray, "3"],
    drawn: Float[np.ndarray, "2"],
) -> Bool[np.ndarray, "k b 8"]:
    """Which corners above a drawer are clear of its front, and of what it is pulled out of."""
    length = float(np.linalg.norm(drawn))
    from_front = half[:2] @ np.abs(drawn) / length - corners[..., :2] @ (drawn / length)
    over_front = corners[..., 2] > half[2] + _PANEL
    return ((from_front > _WALLS) | over_front) & (from_front < length - _FRONT)


def _hands(widths: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k b 8 3"]:
    """Corners of the hand and of its opening fingers around things of these widths, in the TCP's frame [m]."""
    half, thickness, back, front = _FINGER
    low, high = (np.array(corner) - [0, 0, TCP_OFFSET] for corner in HAND_BOXES[0])
    palm = low + _CORNERS * (high - low)
    wide, top, bottom = _FLANGE
    flange = np.array([-wide, -wide, top]) + _CORNERS * [2 * wide, 2 * wide, bottom - top]
    flange = flange - [0, 0, TCP_OFFSET]
    boxes = [np.broadcast_to(palm, (len(widths), 8, 3))]
    inner, outer = widths / 2, widths / 2 + thickness + _OPENING
    for side in (-1.0, 1.0):
        near = np.stack([np.full_like(inner, -half), side * inner, np.full_like(inner, back)], 1)
        far = np.stack([np.full_like(inner, half), side * outer, np.full_like(inner, front)], 1)
        boxes.append(near[:, None] + _CORNERS * (far - near)[:, None])
    boxes.append(np.broadcast_to(flange, (len(widths), 8, 3)))
    return np.stack(boxes, axis=1)
