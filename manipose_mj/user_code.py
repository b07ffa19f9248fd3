"""Importing modules that users name, and the arguments of what is in them."""

from __future__ import annotations

import importlib
import json
import os
import sys
from types import ModuleType
from typing import Any

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


def factory_arguments(text: str | None, option: str) -> dict[str, Any]:
    """The keyword arguments of a factory.

    Args:
      text: A JSON object; None: no arguments.
      option: Of the command line that gave it, which opens the message.

    Raises:
      InputError: It is none, or holds a number that is not finite.
    """
    if text is None:
        return {}
    try:
        arguments = json.loads(text, parse_constant=_refuse)
    except ValueError as error:
        raise InputError(f"{option} {text}: no JSON ({error})") from None
    if not isinstance(arguments, dict):
        raise InputError(f'{option} {text}: expected a JSON object, such as {{"path": "a.pt"}}')
    return arguments


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no finite number")
