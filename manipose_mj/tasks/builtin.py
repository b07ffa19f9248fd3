"""The registered tasks on the built-in catalogue."""

from __future__ import annotations

from asset_pipeline import catalogue
from asset_pipeline.assets import Asset
from manipose_mj.errors import InputError
from manipose_mj.tasks.observations import SensorConfig
from manipose_mj.tasks.registry import register_task
from manipose_mj.tasks.store import Store, StoreConfig
from manipose_mj.tasks.target_pose import TargetPose, TargetPoseConfig

# Two instances of each category keep the scene small; an episode draws one of them.
TARGET_POSE_OBJECTS = tuple(
    (category, index) for category in ("chips_can", "mug", "box", "bowl") for index in (0, 1)
)


@register_task("single_object", "target_pose", tags=("rigid", "pose_goal"))
def target_pose(
    *, observations: str, sensors: SensorConfig, objects: tuple[Asset, ...] | None
) -> TargetPose:
    """Set one object down at a 6D goal pose on the table, from any of its stable poses."""
    if objects is None:
        objects = tuple(catalogue.load(category, index) for category, index in TARGET_POSE_OBJECTS)
    return TargetPose(objects, TargetPoseConfig(observations=observations, sensors=sensors))


@register_task("articulated", "store_chips_can_middle_drawer", tags=("articulated", "store"))
def store_chips_can_middle_drawer(
    *, observations: str, sensors: SensorConfig, objects: tuple[Asset, ...] | None
) -> Store:
    """Store the red chips can in the middle drawer: open it, lay the can inside, shut it."""
    if objects is None:
        objects = (catalogue.load("chips_can", 0),)
    if len(objects) != 1:
        raise InputError(f"store_chips_can_middle_drawer takes one object; got {len(objects)}")
    config = StoreConfig(observations=observations, sensors=sensors)
    return Store(objects[0], catalogue.load("cabinet", 0), config)
