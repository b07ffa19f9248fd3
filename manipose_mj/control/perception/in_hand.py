"""What the hand is thought to hold: where it must be, and whether cameras see that it is not there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.control.furniture.sensing.scene_cloud import Sight, seen_past
from manipose_mj.control.perception.pose_sensing import SensedPose

# By how much fingers close when they lose what they held: [m], and as a share of its width.
_LOST, _LOST_SHARE = 0.004, 0.5
_GONE = 0.5  # share of an object's points that cameras look past, from which on it is not there
_WITHIN = 0.7  # of the way from its middle to its corners: points that are surely within it


@dataclass(frozen=True)
class InHand:
    """Attributes: name: of the object; pose_tcp: `T_tcp_label`; width: of the gripper when it took it [m]."""

    name: str
    pose_tcp: Float[np.ndarray, "4 4"]
    width: float

    def may_be_lost(self, opening: float) -> bool:
        """Whether the fingers have closed further [m]: friction lets nothing jump that they are still around."""
        return opening < self.width - min(_LOST, _LOST_SHARE * self.width)


def is_gone(believed: SensedPose, seen: SensedPose, sights: Callable[[], Sequence[Sight]]) -> bool:
    """Whether cameras look past an object, which none of them shows, where it is believed to be: it is where it was.

    Args:
      believed: By where the hand has gone.
      seen: When it was seen last.
      sights: How far cameras see now; not asked for where both are one.
    """
    if np.allclose(believed.pose, seen.pose):
        return False
    points = [_within(hull) for hull in believed.shape.hulls]
    past = seen_past(sights(), believed.pose)
    return bool(past(np.concatenate(points)).mean() > _GONE)


def _within(hull: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n+1 3"]:
    """Points that are surely within a shape, by its corners."""
    middle = hull.mean(axis=0)
    return np.concatenate([middle[None], middle + _WITHIN * (hull - middle)])
