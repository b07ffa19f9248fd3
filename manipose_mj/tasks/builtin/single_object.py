"""The registered tasks of the family `single_object`, on the built-in catalogue."""

from __future__ import annotations

from asset_pipeline import catalogue
from manipose_mj.tasks.options import TaskOptions
from manipose_mj.tasks.registry import register_task
from manipose_mj.tasks.target_pose import TargetPose

# Two instances of each category keep the scene small; an episode draws one of them.
TARGET_POSE_OBJECTS = tuple(
    (category, index) for category in ("chips_can", "mug", "box", "bowl") for index in (0, 1)
)


@register_task("single_object", "target_pose", tags=("rigid", "pose_goal"))
def target_pose(options: TaskOptions) -> TargetPose:
    """Set one object down at a 6D goal pose on the table, from any of its stable poses."""
    objects = options.objects
    if objects is None:
        objects = tuple(catalogue.load(category, index) for category, index in TARGET_POSE_OBJECTS)
    return TargetPose(objects, options=options)
