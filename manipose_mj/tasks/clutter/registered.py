"""The registered tasks of the family `clutter`, on the built-in catalogue."""

from __future__ import annotations

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset
from manipose_mj.tasks.clutter.occluded import ClutterOccluded, OccludedConfig
from manipose_mj.tasks.clutter.pick import ClutterMulti, ClutterPick
from manipose_mj.tasks.clutter.pile_layout import PileConfig
from manipose_mj.tasks.clutter.stacked import ClutterStacked
from manipose_mj.tasks.clutter.task import ClutterConfig
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.registry import register_task

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
def pick(env_config: EnvConfig) -> ClutterPick:
    """Take one named object out of a pile and set it down at its goal pose."""
    return ClutterPick(_objects(env_config), ClutterConfig(), env_config)


@register_task("clutter", "multi", tags=("clutter", "rigid", "pose_goal", "several_objects"))
def multi(env_config: EnvConfig) -> ClutterMulti:
    """Bring two or three objects of a pile to their goal poses, in any order that works."""
    return ClutterMulti(
        _objects(env_config), ClutterConfig(horizon=180.0, targets=(2, 3)), env_config
    )


@register_task("clutter", "stacked", tags=("clutter", "rigid", "pose_goal", "rearrangement"))
def stacked(env_config: EnvConfig) -> ClutterStacked:
    """Bring an object to its goal pose that lies under others, and drop none off the table."""
    config = ClutterConfig(horizon=150.0, pile=PileConfig(layout="stack", radius=(0.15, 0.18)))
    return ClutterStacked(_objects(env_config), config, env_config)


@register_task("clutter", "occluded", tags=("clutter", "rigid", "pose_goal", "rearrangement"))
def occluded(env_config: EnvConfig) -> ClutterOccluded:
    """Bring an object to its goal pose of which no camera sees more than 40 % at the start."""
    pile = PileConfig(layout="cover", radius=(0.15, 0.18))
    return ClutterOccluded(
        _objects(env_config), OccludedConfig(horizon=150.0, pile=pile), env_config
    )


def _objects(env_config: EnvConfig) -> tuple[Asset, ...]:
    """What the user chose, or those of the split."""
    chosen = env_config.assets()
    if chosen is not None:
        return chosen
    return tuple(
        catalogue.load(category, index)
        for category, indices in CLUTTER_OBJECTS[env_config.split]
        for index in indices
    )
