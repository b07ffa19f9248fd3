"""Antipodal parallel-jaw grasps of an object, sampled once in its own frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import ConvexHull, cKDTree

from manipose_mj.assets.asset import GraspSet, StablePose
from manipose_mj.assets.geometry import Body
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.antipodal import antipodal_pairs
from manipose_mj.grasp_sampling.approaches import DEPTHS, pair_frames
from manipose_mj.grasp_sampling.grasp_choice import clear_of_plane, diverse
from manipose_mj.grasp_sampling.grasp_fit import Candidates, ObjectCloud, fit_pairs
from manipose_mj.grasp_sampling.gripper_clearance import hand_free
from manipose_mj.grasp_sampling.touch_points import (
    SurfacePoints,
    first_in_cells,
    surface_points,
    union_points,
)

COARSE_CELL = 0.010  # for the hand's large boxes one point in each will do [m]
MAX_ENDS = 3000  # points of the surface among which pairs are looked for
MAX_SEEDS = 1000  # of them whose partners are looked for
BLOCK = 100  # of these at a time
LOOKED_AROUND = 2 * BLOCK  # after which those near the grasps found so far have their turn
NEAR = 0.012  # [m]
ENOUGH = 600  # candidates to choose from
FEW = 300  # with so many, nobody looks where none was found yet
# In each of the most probable stable poses so many candidates should be clear of the support; where
# fewer are, so many points are looked at again for pairs that are level to within this sine.
COMMON, MIN_CLEAR, LEVEL_SEEDS, LEVEL = 3, 40, 400, 0.1


def sample_grasps(
    body: Body,
    stable_poses: Sequence[StablePose],
    *,
    gripper: ParallelJaw | None = None,
    seed: int = 0,
    count: int = 200,
) -> GraspSet:
    """A diverse set of at most `count` grasps, best first.

    The hand is expected to come straight along z, opened to `gripper.opening(width)`: that is what
    was tested against the object and the support. Every grasp stands for two: half a turn of the
    hand about its approach gives the same contacts with another posture of the arm; whoever plans
    for an arm adds those.

    Args:
      body: The pads close on its collision shapes; the open hand avoids its visual shapes as well.
      stable_poses: For `GraspSet.clear`, in this order.
      gripper: The hand; None takes the Franka hand's geometry.
      seed: Of the sampling; the same seed gives the same grasps.
      count: The most grasps to return.

    Returns:
      The grasps; none for what is too wide for the hand.
    """
    gripper = gripper or ParallelJaw()
    rng = np.random.default_rng(seed)
    cloud = _object_cloud(body, rng)
    candidates = _candidates(cloud, stable_poses, gripper, rng)
    clear = clear_of_plane(candidates.poses, candidates.widths, stable_poses, gripper)
    chosen = diverse(candidates, clear, count)
    return GraspSet(candidates.poses[chosen], candidates.widths[chosen], clear[chosen])


def _candidates(
    cloud: ObjectCloud,
    stable_poses: Sequence[StablePose],
    gripper: ParallelJaw,
    rng: np.random.Generator,
) -> Candidates:
    """Grasps to choose from: points all over the surface are tried until there are enough.

    On a box nearly every pair will do; on a large bowl only those next to the rim.
    """
    ups = np.array([p.rotation[2] for p in stable_poses] or [[0.0, 0.0, 1.0]])
    ends = cloud.touch.thinned(MAX_ENDS, rng)
    order = rng.permutation(len(ends.points))[:MAX_SEEDS]
    found: list[Candidates] = []
    total, promising = 0, len(order)
    for start in range(0, len(order), BLOCK):
        if start == LOOKED_AROUND:
            near = _near_grasps(ends.points[order[start:]], Candidates.joined(found))
            order[start:] = order[start:][np.argsort(~near, kind="stable")]
            promising = start + np.count_nonzero(near)
        pairs = antipodal_pairs(ends, gripper, order[start : start + BLOCK])
        frames = pair_frames(ends, pairs, ups[np.arange(len(pairs)) % len(ups)])
        free = hand_free(cloud.coarse, frames, gripper)
        reached = np.flatnonzero(free.any(axis=1))
        found.append(fit_pairs(cloud, frames.take(reached), free[reached], gripper))
        total += len(found[-1])
        if total >= (ENOUGH if start + BLOCK < promising else FEW):
            break
    found.append(_from_above(cloud, ends, order, Candidates.joined(found), stable_poses, gripper))
    return Candidates.joined(found)


def _from_above(
    cloud: ObjectCloud,
    ends: SurfacePoints,
    order: Int[np.ndarray, "k"],
    found: Candidates,
    stable_poses: Sequence[StablePose],
    gripper: ParallelJaw,
) -> Candidates:
    """More grasps for the most likely poses in which few are clear of the support.

    What lies as flat as a pencil can only be taken straight from above, by pads that close level.
    """
    poses = list(stable_poses)[:COMMON]
    clear = clear_of_plane(found.poses, found.widths, poses, gripper).sum(axis=0)
    scarce = np.flatnonzero(clear < MIN_CLEAR)
    if not len(scarce):
        return Candidates.joined(())
    pairs = antipodal_pairs(ends, gripper, order[:LEVEL_SEEDS])
    pairs = pair_frames(ends, pairs, np.tile(poses[0].rotation[2], (len(pairs), 1)))
    more = []
    for pose in scarce:
        frames = pairs.levelled(poses[pose].rotation[2], LEVEL).take(slice(BLOCK))
        # Of the approaches the first is the one from above.
        free = hand_free(cloud.coarse, frames, gripper)
        free[:, len(DEPTHS) :] = False
        more.append(fit_pairs(cloud, frames, free, gripper))
    return Candidates.joined(more)


def _near_grasps(points: Float[np.ndarray, "n 3"], found: Candidates) -> Bool[np.ndarray, "n"]:
    """Which points of the surface are next to a grasp that was found."""
    if not len(found):
        return np.ones(len(points), bool)
    distance, _ = cKDTree(found.poses[:, :3, 3]).query(points)
    return distance < np.median(found.widths) / 2 + NEAR


def _object_cloud(body: Body, rng: np.random.Generator) -> ObjectCloud:
    touch = union_points(body.collision, rng)
    seen = surface_points(body.surface(), rng).points
    both = np.concatenate([touch.points, seen])
    first = first_in_cells(both / touch.spacing)
    seen = both[first[first >= len(touch.points)]]  # where they show what fingers do not touch
    corners = np.concatenate([s.surface().vertices for s in body.collision])
    corners = corners[ConvexHull(corners).vertices]  # sharp ones stick out between the points
    obstacles = np.concatenate([touch.points, corners, seen])
    return ObjectCloud(
        touch=touch,
        obstacles=obstacles,
        coarse=np.concatenate([corners, obstacles[first_in_cells(obstacles / COARSE_CELL)]]),
        mass_properties=body.mass_properties,
    )
