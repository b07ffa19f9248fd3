"""A module that registers a task as it is imported, as packages of other people do."""

from __future__ import annotations

from manipose_mj import register_task
from manipose_mj.tasks import EnvConfig
from tests.conformance.own_tasks import Diverging


@register_task("example", "spawned")
def spawned(env_config: EnvConfig) -> Diverging:
    """Break the simulation, in whatever process."""
    return Diverging(env_config)
