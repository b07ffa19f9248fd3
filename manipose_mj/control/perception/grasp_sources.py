"""Where the grasps of an estimated object come from."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, GraspSet, StablePose
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.control.perception.cloud_grasps import COUNT, cloud_grasps
from manipose_mj.control.perception.objects.known_shapes import KnownShape
from manipose_mj.control.perception.objects.object_views import ObjectView, seen_points
from manipose_mj.control.perception.observed_surface import observed_surface
from manipose_mj.control.perception.pose_sensing import SensedPose
from manipose_mj.control.perception.source_names import GraspSource
from manipose_mj.grasp_sampling.grasp_choice import clear_of_plane
from manipose_mj.poses import invert, transform

# Rest poses, the most probable, that an object may be set down in where no goal says how.
_COMMON = 3
_FEW = 60  # grasps of a cloud, of 200 that there may be, below which it is not believed


def sensed_grasps(
    source: GraspSource,
    sensed: SensedPose,
    views: Sequence[ObjectView],
    rotations: Sequence[Float[np.ndarray, "3 3"]],
    asset: Callable[[], Asset],
    count: int = COUNT,
) -> GraspSet:
    """Grasps of an object in its label's frame.

    Args:
      source: `"shape"`: sampled on the shape that was fitted to it; `"cloud"`: on that shape, moved to where the
        cloud is; `"annotated"`: the object's own, which nobody sees.
      sensed: Its pose and shape.
      views: That led to them.
      rotations: `R_world_label` that goals ask for.
      asset: The object; called for `"annotated"` alone.
      count: The most of a cloud.
    """
    shape = sensed.shape
    if source == "shape":
        return shape.sampled_grasps()
    if source == "annotated":
        return _annotated(asset(), shape)
    to_label = invert(sensed.pose)
    normals = np.concatenate([view.normals @ view.T_world_camera[:3, :3].T for view in views])
    points = transform(to_label, seen_points(views))
    cloud = observed_surface(points, normals @ to_label[:3, :3].T, shape)
    held_in = [resting(shape, rotation) for rotation in (sensed.pose[:3, :3], *rotations)]
    if not rotations:  # it may be set down on any side
        held_in += shape.rests[:_COMMON]
    grasps = cloud_grasps(cloud, held_in, shape.rests, count)
    if len(grasps) >= _FEW:
        return grasps
    # A cloud that contradicts itself, as of cameras that disagree, leaves a hand no room: believe the shape alone.
    nothing = np.empty((0, 3))
    return cloud_grasps(observed_surface(nothing, nothing, shape), held_in, shape.rests, count)


def resting(shape: KnownShape, rotation: Float[np.ndarray, "3 3"]) -> StablePose:
    """The shape as it lies on a plane when turned so, whether it stays or not.

    Args:
      shape: In its label's frame.
      rotation: `R_world_label`.
    """
    lowest = min(float((hull @ rotation[2]).min()) for hull in shape.hulls)
    return StablePose(rotation, -lowest, 1.0)


def _annotated(asset: Asset, shape: KnownShape) -> GraspSet:
    """An object's own grasps, for the rest poses of the shape that was fitted to it."""
    none = GraspSet(np.empty((0, 4, 4)), np.empty(0), np.empty((0, len(shape.rests)), bool))
    if asset.grasps is None:
        return none
    poses = invert(asset.label.pose) @ asset.grasps.poses
    widths = asset.grasps.widths
    return GraspSet(poses, widths, clear_of_plane(poses, widths, shape.rests, ParallelJaw()))
