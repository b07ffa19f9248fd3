"""What two pads touch that close on a pair of points, for every turn and depth of the hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.approaches import COS, DEPTH, DEPTHS, SIN

PAD_DEPTH = 0.001  # points this close to the first touched count as touched [m]
FACING = 0.7  # cosine: a touched point looks at its pad


@dataclass(frozen=True)
class ContactPatch:
    """Of each hand.

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


def pad_reach(gripper: ParallelJaw) -> float:
    """Farthest point of any pad from the line through the pair [m]."""
    return float(np.hypot(gripper.pad_half_width, gripper.pad_half_height + max(DEPTHS)))


def contact_patch(
    local: Float[np.ndarray, "3 m"],
    outward: Float[np.ndarray, "m"],
    spacing: float,
    hands: Int[np.ndarray, "k"],
    gripper: ParallelJaw,
) -> ContactPatch:
    """What pads touch that close on the pair.

    Args:
      local: Points of the surface in the pair's frame [m], those within the pads' reach.
      outward: `(m,)`, of their normals along the closing direction, positive away from the pair.
      spacing: Of the points [m].
      hands: Which of the hands to look at.
      gripper: The hand.
    """
    first, y, other = local
    cos, sin = COS[hands, None], SIN[hands, None]
    x = cos * other - sin * first
    z = cos * first + sin * other + DEPTH[hands, None]
    window = (np.abs(x) < gripper.pad_half_width) & (np.abs(z) < gripper.pad_half_height)
    high = np.where(window & (y > 0), y, -np.inf).max(axis=1, initial=-np.inf)
    low = np.where(window & (y < 0), y, np.inf).min(axis=1, initial=np.inf)
    facing = window & (outward > FACING)
    upper = _patch(x, z, facing & (y > high[:, None] - PAD_DEPTH))
    lower = _patch(x, z, facing & (y < low[:, None] + PAD_DEPTH))
    touched = np.isfinite(high) & np.isfinite(low)
    width, middle = np.zeros(len(hands)), np.zeros(len(hands))
    width[touched] = (high - low)[touched]
    middle[touched] = (high + low)[touched] / 2
    full = 4 * gripper.pad_half_width * gripper.pad_half_height / spacing**2
    return ContactPatch(
        width=width,
        middle=middle,
        cover=np.where(touched, np.minimum(upper[0], lower[0]) / full, 0.0),
        radius=np.minimum(upper[3], lower[3]),
        skew=np.hypot(upper[1] - lower[1], upper[2] - lower[2]),
    )


def _patch(x: np.ndarray, z: np.ndarray, touched: Bool[np.ndarray, "k m"]) -> np.ndarray:
    """`(4, k)`: number, middle and root mean square radius of the touched points."""
    count = touched.sum(axis=1)
    x, z = x * touched, z * touched
    number = np.maximum(count, 1)
    middle_x, middle_z = x.sum(axis=1) / number, z.sum(axis=1) / number
    square = (x * x + z * z).sum(axis=1) / number - middle_x**2 - middle_z**2
    return np.stack([count, middle_x, middle_z, np.sqrt(np.maximum(square, 0.0))])
