"""Modules with tasks of one's own, which every command and worker process imports.

`MANIPOSE_TASKS=lift_task manipose evaluate example/lift ...`: names of modules, with commas between; the working folder
is searched too. Installed packages name theirs by entry points of the group `manipose_mj.tasks`.
"""

from __future__ import annotations

import importlib
import os
import sys
from importlib.metadata import entry_points

from manipose_mj.errors import InputError

MODULES_VARIABLE = "MANIPOSE_TASKS"
GROUP = "manipose_mj.tasks"


def import_own_tasks() -> None:
    """Import all of them, once.

    Raises:
      InputError: One cannot be imported, or registers a name that is taken.
    """
    named = [name.strip() for name in os.environ.get(MODULES_VARIABLE, "").split(",")]
    if any(named) and os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    for name in filter(None, named):
        _import(name, f"{MODULES_VARIABLE}={name}")
    for entry in entry_points(group=GROUP):
        _import(entry.module, f"entry point {entry.name} of {GROUP}")


def _import(module: str, said_by: str) -> None:
    try:
        importlib.import_module(module)
    except Exception as error:  # whatever a stranger's code raises
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{said_by}: cannot import {module} ({reason[:300]})") from error
