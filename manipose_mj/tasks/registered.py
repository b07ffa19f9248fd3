"""The registered tasks; importing this registers them, and those of one's own that the environment names."""

from manipose_mj.tasks.articulated import registered as articulated
from manipose_mj.tasks.clutter import registered as clutter
from manipose_mj.tasks.own_modules import import_own_tasks
from manipose_mj.tasks.single_object import registered as single_object

__all__ = ["articulated", "clutter", "single_object"]

import_own_tasks()
