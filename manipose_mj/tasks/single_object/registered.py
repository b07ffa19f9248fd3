"""The registered tasks of the family `single_object`, on the built-in catalogue."""

from __future__ import annotations

from collections.abc import Sequence

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import CATALOGUE, Split
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.registry import register_task
from manipose_mj.tasks.single_object.orientation import Orientation
from manipose_mj.tasks.single_object.position import IntoShelfConfig, PositionConfig
from manipose_mj.tasks.single_object.reorient import Reorient
from manipose_mj.tasks.single_object.target_pose import TargetPose

# Two instances of each category keep the scene small; an episode draws one of them.
TARGET_POSE_CATEGORIES = ("chips_can", "mug", "box", "bowl")
# A bowl that lies upside down offers the gripper nothing that it could turn it by.
ORIENTATION_CATEGORIES = ("chips_can", "mug", "box")


@register_task("single_object", "target_pose", tags=("rigid", "pose_goal"))
def target_pose(env_config: EnvConfig) -> TargetPose:
    """Set one object down at a 6D goal pose on the table, from any of its stable poses.

    Start and goal are stable poses that one grasp can join, turned freely about the vertical.
    """
    return TargetPose(_objects(env_config, TARGET_POSE_CATEGORIES), env_config)


@register_task("single_object", "target_pose_shelf", tags=("rigid", "pose_goal", "shelf"))
def target_pose_shelf(env_config: EnvConfig) -> TargetPose:
    """Take one object from the table to a 6D goal pose on a shelf's board, under it or by it.

    The shelf's place, distance and angle change from episode to episode. Boards and walls limit
    from where the hand can come: the grasp has to be chosen for the goal.
    """
    return TargetPose(_objects(env_config, TARGET_POSE_CATEGORIES), env_config, IntoShelfConfig())


@register_task("single_object", "position", tags=("rigid", "pose_goal", "shelf"))
def position(env_config: EnvConfig) -> TargetPose:
    """Take one object from a place by, in or under a shelf to a goal pose on the table or a board.

    The shelf's place, distance and angle change from episode to episode. Boards and walls limit
    from where the hand can come and how it can leave with the object.
    """
    return TargetPose(_objects(env_config, TARGET_POSE_CATEGORIES), env_config, PositionConfig())


@register_task("single_object", "orientation", tags=("rigid", "orientation_goal", "regrasp"))
def orientation(env_config: EnvConfig) -> Orientation:
    """Turn one object from any of its stable poses to a goal orientation, anywhere on the table.

    The goal is another stable pose, turned freely about the vertical, and shown as three axes beside
    the table's middle. Success needs the whole rotation of the label, up to the object's symmetry.
    Some pairs of start and goal cannot be done in one grasp: the object has to be set down on the way.
    """
    return Orientation(_objects(env_config, ORIENTATION_CATEGORIES), env_config)


@register_task("single_object", "reorient_mug", tags=("rigid", "orientation_goal", "regrasp"))
def reorient_mug(env_config: EnvConfig) -> Reorient:
    """Set a mug upright that stands upside down or lies on its side or its handle.

    Upright means within 15 degrees of the vertical; where it stands and where the handle points does
    not matter. From upside down no single grasp will do.
    """
    return Reorient(_objects(env_config, ("mug",), count=4), env_config)


def _objects(env_config: EnvConfig, categories: Sequence[str], count: int = 2) -> tuple[Asset, ...]:
    """What the user chose, or the first `count` of each category in the split."""
    chosen = env_config.assets()
    if chosen is not None:
        return chosen
    return tuple(
        catalogue.load(category, index)
        for category in categories
        for index in _first(category, env_config.split, count)
    )


def _first(category: str, split: Split, count: int) -> list[int]:
    row = CATALOGUE[category]
    return [index for index in range(row.instances) if row.split(index) == split][:count]
