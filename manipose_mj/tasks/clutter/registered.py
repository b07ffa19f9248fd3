"""The registered tasks of the family `clutter`: their piles are made of all objects that are no longer than 20 cm."""

from __future__ import annotations

from manipose_mj.tasks.clutter.object_draw import Mixture, pile_of
from manipose_mj.tasks.clutter.occluded import ClutterOccluded, OccludedConfig
from manipose_mj.tasks.clutter.pick import ClutterMulti, ClutterPick
from manipose_mj.tasks.clutter.pile_layout import PileConfig
from manipose_mj.tasks.clutter.stacked import ClutterStacked
from manipose_mj.tasks.clutter.task import ClutterConfig
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.registry import register_task
from manipose_mj.tasks.core.scene_objects import SceneObjects

_HEAP, _STACK = pile_of(Mixture(flat=4)), pile_of(Mixture(flat=6))
_COVER = pile_of(Mixture(flat=7, rolling=1))


@register_task("clutter", "pick", tags=("clutter", "rigid", "pose_goal"), draws=_HEAP)
def pick(env_config: EnvConfig, objects: SceneObjects) -> ClutterPick:
    """Take one named object out of a pile and set it down at its goal pose."""
    return ClutterPick(objects.assets, ClutterConfig(), env_config)


@register_task(
    "clutter", "multi", tags=("clutter", "rigid", "pose_goal", "several_objects"), draws=_HEAP
)
def multi(env_config: EnvConfig, objects: SceneObjects) -> ClutterMulti:
    """Bring two or three objects of a pile to their goal poses, in any order that works."""
    return ClutterMulti(
        objects.assets, ClutterConfig(horizon=180.0, targets=(2, 3), moved=3), env_config
    )


@register_task(
    "clutter", "stacked", tags=("clutter", "rigid", "pose_goal", "rearrangement"), draws=_STACK
)
def stacked(env_config: EnvConfig, objects: SceneObjects) -> ClutterStacked:
    """Bring an object to its goal pose that lies under others, and drop none off the table."""
    config = ClutterConfig(
        horizon=150.0, pile=PileConfig(layout="stack", radius=(0.15, 0.18)), moved=3
    )
    return ClutterStacked(objects.assets, config, env_config)


@register_task(
    "clutter", "occluded", tags=("clutter", "rigid", "pose_goal", "rearrangement"), draws=_COVER
)
def occluded(env_config: EnvConfig, objects: SceneObjects) -> ClutterOccluded:
    """Bring an object to its goal pose of which no camera sees more than 40 % at the start."""
    pile = PileConfig(layout="cover", radius=(0.15, 0.18))
    return ClutterOccluded(
        objects.assets, OccludedConfig(horizon=150.0, pile=pile, moved=5), env_config
    )
