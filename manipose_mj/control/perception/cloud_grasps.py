"""Grasps of an object that was seen, sampled on its observed surface for the poses in which it is to be held.

Grasps that are sampled once per object are for the poses in which it may rest. A pencil that lies on another side
than any of these can be taken from above all the same: here the hand comes from above at the pose estimated and at
the one asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import GraspSet, StablePose
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.antipodal import antipodal_pairs
from manipose_mj.grasp_sampling.approaches import DEPTHS, PairFrames, pair_frames
from manipose_mj.grasp_sampling.grasp_choice import clear_of_plane, diverse
from manipose_mj.grasp_sampling.grasp_fit import Candidates, ObjectCloud, fit_pairs
from manipose_mj.grasp_sampling.gripper_clearance import hand_free

_COUNT = 200  # grasps to return
_ENDS = 3000  # points of the surface among which pairs are looked for
_SEEDS = 800  # of them whose partners are looked for
_BLOCK = 100  # of these at a time
_ENOUGH = 600  # candidates to choose from
_LEVEL = 0.35  # sine of how far from level pads may close that are turned to close level
_LEVEL_PAIRS = 250  # for each pose
# Lengths of the sum of two ups between which a hand can come halfway: 10 to 140 degrees apart.
_HALFWAY = (0.68, 1.99)


def cloud_grasps(
    cloud: ObjectCloud, held_in: Sequence[StablePose], rests: Sequence[StablePose]
) -> GraspSet:
    """Antipodal grasps, best first.

    Args:
      cloud: The observed surface, in the label's frame.
      held_in: The object's poses in which the hand will take it or let go of it.
      rests: For `GraspSet.clear`, in this order.
    """
    gripper = ParallelJaw()
    rng = np.random.default_rng(0)
    candidates, halfway = _candidates(cloud, held_in, rests, gripper, rng)
    poses, widths = candidates.poses, candidates.widths
    clear = clear_of_plane(poses, widths, rests, gripper)
    held = clear_of_plane(poses, widths, held_in, gripper)
    chosen = diverse(candidates, np.column_stack([held, halfway]), _COUNT)
    return GraspSet(poses[chosen], widths[chosen], clear[chosen])


def _candidates(
    cloud: ObjectCloud,
    held_in: Sequence[StablePose],
    rests: Sequence[StablePose],
    gripper: ParallelJaw,
    rng: np.random.Generator,
) -> tuple[Candidates, Bool[np.ndarray, "n"]]:
    """Grasps to choose from: of every side, from above in the poses to be held in, and halfway between them.

    Returns:
      The grasps, and which of them are halfway.
    """
    ups = np.array([pose.rotation[2] for pose in [*held_in, *rests]] or [[0.0, 0.0, 1.0]])
    ends = cloud.touch.thinned(_ENDS, rng)
    order = rng.permutation(len(ends.points))[:_SEEDS]
    blocks = [order[start : start + _BLOCK] for start in range(0, len(order), _BLOCK)]
    pairs = np.concatenate([antipodal_pairs(ends, gripper, block) for block in blocks])
    above = [*ups[: len(held_in)], *_between(ups[: len(held_in)])]
    found = []
    for up in above:
        frames = pair_frames(ends, pairs, np.broadcast_to(up, (len(pairs), 3)))
        found.append(_from_above(cloud, frames, up, gripper))
    enough = sum(map(len, found)) + _ENOUGH
    for start in range(0, len(pairs), _BLOCK):
        some = pairs[start : start + _BLOCK]
        frames = pair_frames(ends, some, ups[np.arange(len(some)) % len(ups)])
        free = hand_free(cloud.coarse, frames, gripper)
        reached = np.flatnonzero(free.any(axis=1))
        found.append(fit_pairs(cloud, frames.take(reached), free[reached], gripper))
        if sum(map(len, found)) >= enough:
            break
    number = np.repeat(np.arange(len(found)), [len(each) for each in found])
    return Candidates.joined(found), (number >= len(held_in)) & (number < len(above))


def _between(ups: Float[np.ndarray, "p 3"]) -> list[Float[np.ndarray, "3"]]:
    """Directions halfway between two ups: a hand that comes along one is as little tilted as it can be in both."""
    found = []
    for one, other in combinations(ups, 2):
        middle = one + other
        length = float(np.linalg.norm(middle))
        if _HALFWAY[0] < length < _HALFWAY[1]:
            found.append(middle / length)
    return found


def _from_above(
    cloud: ObjectCloud, frames: PairFrames, up: Float[np.ndarray, "3"], gripper: ParallelJaw
) -> Candidates:
    """Grasps straight from above, by pads that close level."""
    level = frames.levelled(up, _LEVEL).take(slice(_LEVEL_PAIRS))
    free = hand_free(cloud.coarse, level, gripper)
    free[:, len(DEPTHS) :] = False  # of the approaches the first is the one from above
    reached = np.flatnonzero(free.any(axis=1))
    return fit_pairs(cloud, level.take(reached), free[reached], gripper)
