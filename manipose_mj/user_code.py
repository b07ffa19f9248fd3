"""Importing modules that users name."""

from __future__ import annotations

import importlib
import os
import sys
from types import ModuleType

from manipose_mj.errors import InputError


def search_working_folder() -> None:
    """From now on modules are looked for in the working folder too, as `python -m` does."""
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())


def import_user_module(name: str, said_by: str) -> ModuleType:
    """The module.

    Args:
      name: Of the module.
      said_by: Where the user named it, which opens the message.

    Raises:
      InputError: It cannot be imported, for whatever reason.
    """
    try:
        return importlib.import_module(name)
    except Exception as error:  # whatever a stranger's code raises
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{said_by}: cannot import {name} ({reason[:300]})") from error
