"""The registered tasks of the family `single_object`: their objects are drawn from all that there are."""

from __future__ import annotations

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.tasks.core.candidates import rigid_rows
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.one_object import one_object
from manipose_mj.tasks.core.registry import register_task
from manipose_mj.tasks.core.scene_objects import SceneObjects
from manipose_mj.tasks.scene.resting import require_graspable
from manipose_mj.tasks.single_object.orientation import (
    Orientation,
    OrientationConfig,
    orientation_pairs,
)
from manipose_mj.tasks.single_object.position import IntoShelfConfig, PositionConfig
from manipose_mj.tasks.single_object.reorient import Reorient, tipped_poses
from manipose_mj.tasks.single_object.target_pose import TargetPose, TargetPoseConfig, pose_pairs


def _graspable(asset: Asset) -> None:
    require_graspable(asset)
    pose_pairs(asset, TargetPoseConfig())


def _turnable(asset: Asset) -> None:
    require_graspable(asset)
    orientation_pairs(asset, OrientationConfig().min_turn)


def _tipping(asset: Asset) -> None:
    require_graspable(asset)
    tipped_poses(asset)


_GRASPABLE = one_object(_graspable, rigid_rows())
_TURNABLE = one_object(_turnable, rigid_rows())
_MUG = one_object(_tipping, (CATALOGUE["mug"],))


@register_task("single_object", "target_pose", tags=("rigid", "pose_goal"), draws=_GRASPABLE)
def target_pose(env_config: EnvConfig, objects: SceneObjects) -> TargetPose:
    """Set one object down at a 6D goal pose on the table, from any of its stable poses.

    Start and goal are stable poses that one grasp can join, turned freely about the vertical.
    """
    return TargetPose(objects.assets, env_config)


@register_task(
    "single_object", "target_pose_shelf", tags=("rigid", "pose_goal", "shelf"), draws=_GRASPABLE
)
def target_pose_shelf(env_config: EnvConfig, objects: SceneObjects) -> TargetPose:
    """Take one object from the table to a 6D goal pose on a shelf's board, under it or by it.

    The shelf's place, distance and angle change from episode to episode. Boards and walls limit
    from where the hand can come: the grasp has to be chosen for the goal.
    """
    return TargetPose(objects.assets, env_config, IntoShelfConfig())


@register_task("single_object", "position", tags=("rigid", "pose_goal", "shelf"), draws=_GRASPABLE)
def position(env_config: EnvConfig, objects: SceneObjects) -> TargetPose:
    """Take one object from a place by, in or under a shelf to a goal pose on the table or a board.

    The shelf's place, distance and angle change from episode to episode. Boards and walls limit
    from where the hand can come and how it can leave with the object.
    """
    return TargetPose(objects.assets, env_config, PositionConfig())


@register_task(
    "single_object", "orientation", tags=("rigid", "orientation_goal", "regrasp"), draws=_TURNABLE
)
def orientation(env_config: EnvConfig, objects: SceneObjects) -> Orientation:
    """Turn one object from any of its stable poses to a goal orientation, anywhere on the table.

    The goal is another stable pose, turned freely about the vertical, and shown as three axes beside
    the table's middle. Success needs the whole rotation of the label, up to the object's symmetry.
    Some pairs of start and goal cannot be done in one grasp: the object has to be set down on the way.
    """
    return Orientation(objects.assets, env_config)


@register_task(
    "single_object", "reorient_mug", tags=("rigid", "orientation_goal", "regrasp"), draws=_MUG
)
def reorient_mug(env_config: EnvConfig, objects: SceneObjects) -> Reorient:
    """Set a mug upright that stands upside down or lies on its side or its handle.

    Upright means within 15 degrees of the vertical; where it stands and where the handle points does
    not matter. From upside down no single grasp will do.
    """
    return Reorient(objects.assets, env_config)
