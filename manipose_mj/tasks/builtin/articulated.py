"""The registered tasks of the family `articulated`, on the built-in catalogue."""

from __future__ import annotations

from asset_pipeline import catalogue
from manipose_mj.errors import InputError
from manipose_mj.tasks.options import TaskOptions
from manipose_mj.tasks.registry import register_task
from manipose_mj.tasks.store import Store


@register_task("articulated", "store_chips_can_middle_drawer", tags=("articulated", "store"))
def store_chips_can_middle_drawer(options: TaskOptions) -> Store:
    """Store the red chips can in the middle drawer: open it, lay the can inside, shut it."""
    objects = (catalogue.load("chips_can", 0),) if options.objects is None else options.objects
    if len(objects) != 1:
        raise InputError(f"store_chips_can_middle_drawer takes one object; got {len(objects)}")
    return Store(objects[0], catalogue.load("cabinet", 0), options=options)
