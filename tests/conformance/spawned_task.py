"""A module that registers a task as it is imported, as packages of other people do."""

from __future__ import annotations

from own_tasks import Diverging

from manipose_mj import register_task
from manipose_mj.tasks.options import TaskOptions


@register_task("example", "spawned")
def spawned(options: TaskOptions) -> Diverging:
    """Break the simulation, in whatever process."""
    return Diverging(options)
