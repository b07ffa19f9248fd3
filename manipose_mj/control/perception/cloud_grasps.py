"""Grasps of an object that was seen, sampled on its observed surface for the poses in which it is to be held.

Grasps that are sampled once per object are for the poses in which it may rest. A pencil that lies on another side
than any of these can be taken from above all the same: here the hand comes from above at the pose estimated and at
the one asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.asset import GraspSet, StablePose
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.antipodal import antipodal_pairs
from manipose_mj.grasp_sampling.approaches import COS, DEPTHS, PairFrames, pair_frames
from manipose_mj.grasp_sampling.grasp_choice import clear_of_plane, diverse
from manipose_mj.grasp_sampling.grasp_fit import Candidates, ObjectCloud, fit_pairs
from manipose_mj.grasp_sampling.gripper_clearance import hand_free
from manipose_mj.grasp_sampling.touch_points import SurfacePoints

COUNT, MANY = 200, 1000  # grasps to return; and where these do not do
_ENDS = 3000  # points of the surface among which pairs are looked for
_SEEDS = 800  # of them whose partners are looked for
_BLOCK = 100  # of these at a time
_ENOUGH = 3  # candidates to choose from, for each grasp
_LEVEL = 0.35  # sine of how far from level pads may close that are turned to close level
_LEVEL_PAIRS = 250  # for each pose
# Candidates that are clear of the support in a pose to be held in, below which hands also come tilted
# about the line that they close along; and the cosine to straight from above down to which they do.
_SCARCE, _TILTED = 40, 0.25
_STRAIGHT = np.arange(len(COS)) < len(DEPTHS)  # of the approaches the first is the one from above
# Lengths of the sum of two ups between which a hand can come halfway: 10 to 140 degrees apart.
_HALFWAY = (0.68, 1.99)


def cloud_grasps(
    cloud: ObjectCloud,
    held_in: Sequence[StablePose],
    rests: Sequence[StablePose],
    count: int = COUNT,
) -> GraspSet:
    """Antipodal grasps, best first.

    Args:
      cloud: The observed surface, in the label's frame.
      held_in: The object's poses in which the hand will take it or let go of it.
      rests: For `GraspSet.clear`, in this order.
      count: The most grasps to return.
    """
    gripper = ParallelJaw()
    rng = np.random.default_rng(0)
    candidates, halfway = _candidates(cloud, held_in, rests, gripper, rng, _ENOUGH * count)
    poses, widths = candidates.poses, candidates.widths
    clear = clear_of_plane(poses, widths, rests, gripper)
    held = clear_of_plane(poses, widths, held_in, gripper)
    chosen = diverse(candidates, np.column_stack([held, halfway]), count)
    return GraspSet(poses[chosen], widths[chosen], clear[chosen])


def _candidates(
    cloud: ObjectCloud,
    held_in: Sequence[StablePose],
    rests: Sequence[StablePose],
    gripper: ParallelJaw,
    rng: np.random.Generator,
    more: int,
) -> tuple[Candidates, Bool[np.ndarray, "n"]]:
    """Grasps to choose from: of every side, from above in the poses to be held in, and halfway between them.

    Of every side `more` will do.

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
        found.append(_from_above(cloud, frames, up, gripper, _STRAIGHT))
    enough = sum(map(len, found)) + more
    for start in range(0, len(pairs), _BLOCK):
        some = pairs[start : start + _BLOCK]
        frames = pair_frames(ends, some, ups[np.arange(len(some)) % len(ups)])
        free = hand_free(cloud.coarse, frames, gripper)
        reached = np.flatnonzero(free.any(axis=1))
        found.append(fit_pairs(cloud, frames.take(reached), free[reached], gripper))
        if sum(map(len, found)) >= enough:
            break
    found += _tilted(cloud, ends, pairs, held_in, Candidates.joined(found), gripper)
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


def _tilted(
    cloud: ObjectCloud,
    ends: SurfacePoints,
    pairs: Int[np.ndarray, "p 2"],
    held_in: Sequence[StablePose],
    found: Candidates,
    gripper: ParallelJaw,
) -> list[Candidates]:
    """More grasps for the poses to be held in that hardly any found so far is clear of the support in.

    What is thin and too wide across is taken by few of its parts only: under a board, not straight from above.
    """
    clear = clear_of_plane(found.poses, found.widths, held_in, gripper).sum(axis=0)
    added = []
    for pose, count in zip(held_in, clear, strict=True):
        if count < _SCARCE:
            up = pose.rotation[2]
            frames = pair_frames(ends, pairs, np.broadcast_to(up, (len(pairs), 3)))
            hands = (COS > _TILTED) & ~_STRAIGHT
            added.append(_from_above(cloud, frames, up, gripper, hands))
    return added


def _from_above(
    cloud: ObjectCloud,
    frames: PairFrames,
    up: Float[np.ndarray, "3"],
    gripper: ParallelJaw,
    hands: Bool[np.ndarray, "hands"],
) -> Candidates:
    """Grasps by these of the hands, by pads that close level."""
    level = frames.levelled(up, _LEVEL).take(slice(_LEVEL_PAIRS))
    free = hand_free(cloud.coarse, level, gripper) & hands
    reached = np.flatnonzero(free.any(axis=1))
    return fit_pairs(cloud, level.take(reached), free[reached], gripper)
