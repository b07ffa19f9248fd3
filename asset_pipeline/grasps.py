"""Antipodal parallel-jaw grasps of an object, sampled once in its own frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.antipodal import antipodal_pairs, first_in_cells, surface_points
from asset_pipeline.assets import GraspSet, StablePose
from asset_pipeline.geometry import Shape
from asset_pipeline.grasp_choice import clear_of_plane, diverse
from asset_pipeline.grasp_fit import COARSE_CELL, Candidates, ObjectCloud, fit_pair
from asset_pipeline.gripper import ParallelJaw

ENOUGH = 4000  # candidates to choose from


def sample_grasps(
    surface: trimesh.Trimesh,
    collision: Sequence[Shape],
    stable_poses: Sequence[StablePose],
    *,
    center_of_mass: Float[np.ndarray, "3"] | None = None,
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
      surface: What is seen, in the object frame [m], normals outwards.
      collision: What is touched, in the object frame.
      stable_poses: For `GraspSet.clear`, in this order.
      center_of_mass: `(3,)` [m]; near it is better. None takes the surface's centroid.
      gripper: The hand; None takes the Franka hand's geometry.
      seed: Of the sampling; the same seed gives the same grasps.
      count: The most grasps to return.

    Returns:
      The grasps; none for what is too wide for the hand.
    """
    gripper = gripper or ParallelJaw()
    rng = np.random.default_rng(seed)
    points, normals, spacing = surface_points(surface, rng)
    touched = trimesh.util.concatenate([s.surface() for s in collision])
    center = surface.centroid if center_of_mass is None else center_of_mass
    obstacles = np.concatenate([points, surface_points(touched, rng)[0]])
    cloud = ObjectCloud(
        points=points,
        normals=normals,
        spacing=spacing,
        obstacles=obstacles,
        coarse=obstacles[first_in_cells(obstacles / COARSE_CELL)],
        center_of_mass=np.asarray(center, float),
    )
    found: list[Candidates] = []
    total = 0
    for i, j in antipodal_pairs(points, normals, spacing, gripper, rng):
        found.append(fit_pair(cloud, i, j, gripper))
        total += len(found[-1])
        if total >= ENOUGH:
            break
    candidates = Candidates.joined(found)
    clear = clear_of_plane(candidates.poses, candidates.widths, stable_poses, gripper)
    chosen = diverse(candidates, clear, count)
    return GraspSet(candidates.poses[chosen], candidates.widths[chosen], clear[chosen])
