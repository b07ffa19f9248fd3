"""Modules with tasks of one's own, which every command and worker process imports.

`MANIPOSE_TASKS=lift_task manipose evaluate example/lift ...`: names of modules, with commas between; the working folder
is searched too. Installed packages name theirs by entry points of the group `manipose_mj.tasks`.
"""

from __future__ import annotations

import os
from importlib.metadata import entry_points

from manipose_mj.user_code import import_user_module, search_working_folder

MODULES_VARIABLE = "MANIPOSE_TASKS"
GROUP = "manipose_mj.tasks"


def import_own_tasks() -> None:
    """Import all of them, once.

    Raises:
      InputError: One cannot be imported, or registers a name that is taken.
    """
    named = [name.strip() for name in os.environ.get(MODULES_VARIABLE, "").split(",")]
    if any(named):
        search_working_folder()
    for name in filter(None, named):
        import_user_module(name, f"{MODULES_VARIABLE}={name}")
    for entry in entry_points(group=GROUP):
        import_user_module(entry.module, f"entry point {entry.name} of {GROUP}")
