"""The registered tasks of the family `clutter`, on the built-in catalogue."""

from __future__ import annotations

from asset_pipeline import catalogue
from asset_pipeline.assets import Asset
from manipose_mj.tasks.clutter import ClutterConfig
from manipose_mj.tasks.clutter_occluded import ClutterOccluded, OccludedConfig
from manipose_mj.tasks.clutter_pick import ClutterMulti, ClutterPick
from manipose_mj.tasks.clutter_stacked import ClutterStacked
from manipose_mj.tasks.options import TaskOptions
from manipose_mj.tasks.pile_layout import PileConfig
from manipose_mj.tasks.registry import register_task

# Things of few convex parts that the gripper can hold whichever way they lie.
CLUTTER_OBJECTS = {
    "train": (
        ("box", (10, 16, 28, 46)), ("chips_can", (0, 1)), ("drinkbox", (0, 1)), ("remote", (0, 1)),
        ("candle", (0,)), ("steel_tape", (0,)), ("jar", (0,)), ("sausage", (0, 1)), ("apple", (0,)),
    ),
    "test": (
        ("box", (4, 19, 34)), ("chips_can", (4, 9)), ("drinkbox", (4, 9, 19)), ("remote", (4, 9)),
        ("candle", (4,)), ("steel_tape", (4,)), ("jar", (4,)), ("sausage", (4, 9)), ("apple", (4,)),
    ),
}  # fmt: skip


@register_task("clutter", "pick", tags=("clutter", "rigid", "pose_goal"))
def pick(options: TaskOptions) -> ClutterPick:
    """Take one named object out of a pile and set it down at its goal pose."""
    return ClutterPick(_objects(options), ClutterConfig(), options)


@register_task("clutter", "multi", tags=("clutter", "rigid", "pose_goal", "several_objects"))
def multi(options: TaskOptions) -> ClutterMulti:
    """Bring two or three objects of a pile to their goal poses, in any order that works."""
    return ClutterMulti(_objects(options), ClutterConfig(horizon=180.0, targets=(2, 3)), options)


@register_task("clutter", "stacked", tags=("clutter", "rigid", "pose_goal", "rearrangement"))
def stacked(options: TaskOptions) -> ClutterStacked:
    """Bring an object to its goal pose that lies under others, and drop none off the table."""
    config = ClutterConfig(horizon=150.0, pile=PileConfig(layout="stack", radius=(0.15, 0.18)))
    return ClutterStacked(_objects(options), config, options)


@register_task("clutter", "occluded", tags=("clutter", "rigid", "pose_goal", "rearrangement"))
def occluded(options: TaskOptions) -> ClutterOccluded:
    """Bring an object to its goal pose of which no camera sees more than 40 % at the start."""
    pile = PileConfig(layout="cover", radius=(0.15, 0.18))
    return ClutterOccluded(_objects(options), OccludedConfig(horizon=150.0, pile=pile), options)


def _objects(options: TaskOptions) -> tuple[Asset, ...]:
    """What the user chose, or those of the split."""
    if options.objects is not None:
        return options.objects
    return tuple(
        catalogue.load(category, index)
        for category, indices in CLUTTER_OBJECTS[options.split]
        for index in indices
    )
