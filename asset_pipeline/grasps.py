"""Antipodal parallel-jaw grasps of an object, sampled once in its own frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from asset_pipeline.antipodal import antipodal_pairs
from asset_pipeline.assets import GraspSet, StablePose
from asset_pipeline.geometry import Body
from asset_pipeline.grasp_choice import clear_of_plane, diverse
from asset_pipeline.grasp_fit import COARSE_CELL, Candidates, ObjectCloud, fit_pair
from asset_pipeline.gripper import ParallelJaw
from asset_pipeline.touch_points import first_in_cells, surface_points, union_points

ENOUGH = 3000  # candidates to choose from
MAX_PAIRS = 800


def sample_grasps(
    body: Body,
    stable_poses: Sequence[StablePose],
    *,
    gripper: ParallelJaw | None = None,
    seed: int = 0,
    count: int = 400,
) -> GraspSet:
    """A diverse set of at most `count` grasps, best first.

    The hand is expected to come straight along z, opened to `gripper.opening(width)`: that is what
    was tested against the object and the support. Every grasp stands for two: half a turn of the
    hand about its approach gives the same contacts with another posture of the arm; whoever plans
    for an arm adds those.

    Args:
      body: The pads close on its collision shapes; the open hand avoids its looks as well.
      stable_poses: For `GraspSet.clear`, in this order.
      gripper: The hand; None takes the Franka hand's geometry.
      seed: Of the sampling; the same seed gives the same grasps.
      count: The most grasps to return.

    Returns:
      The grasps; none for what is too wide for the hand.
    """
    gripper = gripper or ParallelJaw()
    rng = np.random.default_rng(seed)
    touch = union_points(body.collision, rng)
    obstacles = np.concatenate([touch.points, surface_points(body.surface(), rng).points])
    corners = np.concatenate([s.surface().vertices for s in body.collision])
    corners = corners[ConvexHull(corners).vertices]  # sharp ones stick out between the points
    cloud = ObjectCloud(
        touch=touch,
        obstacles=np.concatenate([corners, obstacles]),
        coarse=np.concatenate([corners, obstacles[first_in_cells(obstacles / COARSE_CELL)]]),
        mass_properties=body.mass_properties,
    )
    ups = [p.rotation[2] for p in stable_poses] or [np.array([0.0, 0.0, 1.0])]
    found: list[Candidates] = []
    total = 0
    for number, (i, j) in enumerate(antipodal_pairs(touch, gripper, rng)):
        found.append(fit_pair(cloud, i, j, gripper, ups[number % len(ups)]))
        total += len(found[-1])
        if total >= ENOUGH or number + 1 == MAX_PAIRS:
            break
    candidates = Candidates.joined(found)
    clear = clear_of_plane(candidates.poses, candidates.widths, stable_poses, gripper)
    chosen = diverse(candidates, clear, count)
    return GraspSet(candidates.poses[chosen], candidates.widths[chosen], clear[chosen])
