"""Room for the hand around what lies behind a part: where the part opens to, and how wide it is opened."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, Cavity, MovingPart
from manipose_mj.poses import compose
from manipose_mj.tasks.articulated.hand_room import STRAIGHT, Placement, free_grasps

_PULLED = 0.95  # of its range, a drawer that somebody reaches into
_UP = np.array([0.0, 0.0, 1.0])


def room_at(
    asset: Asset,
    part: MovingPart,
    stable: int,
    pose: Float[np.ndarray, "4 4"],
    others: Sequence[Placement] = (),
    cavity_world: Float[np.ndarray, "4 4"] | None = None,
    towards: float = STRAIGHT,
) -> int:
    """How many grasps have room for the hand, from above, or for what is behind a door from the front.

    Args:
      asset: What lies there.
      part: A drawer, which will be pulled out, or a door.
      stable: Index of the stable pose it lies in.
      pose: `T_cavity_object`.
      others: What lies beside it.
      cavity_world: `T_world_cavity` with the part shut; the arm has to reach the grasps then, with it open.
      towards: As of `hands_around`.
    """
    if asset.grasps is None:
        return 0
    cavity, outwards, drawn = cavity_of(part), _UP, None
    if cavity.moves_with_part:
        low, high = part.joint.range
        drawn = outwards_of(part) * _PULLED * (high - low)
        if cavity_world is not None:
            cavity_world = cavity_world @ compose(np.eye(3), np.append(drawn, 0.0))
    else:
        outwards = np.append(outwards_of(part), 0.0)
    return free_grasps(
        asset.grasps, stable, pose, cavity, outwards, others, drawn, cavity_world, towards
    )


def outwards_of(part: MovingPart) -> Float[np.ndarray, "2"]:
    """The open side of a part's cavity, along x or y of the object frame."""
    assert part.handle is not None
    outwards = part.handle.rotation[:2, 1]
    axis = int(np.argmax(np.abs(outwards)))
    return np.eye(2)[axis] * np.sign(outwards[axis])


def cavity_of(part: MovingPart) -> Cavity:
    """The cavity that a part shuts."""
    assert part.cavity is not None  # the furniture pool has seen to it
    return part.cavity
