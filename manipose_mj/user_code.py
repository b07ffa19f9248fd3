"""Importing modules that users name, and calling the factories in them."""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

from manipose_mj.errors import InputError, unknown_name


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
    except (Exception, SystemExit) as error:  # whatever a stranger's code raises
        raise InputError(f"{said_by}: cannot import {name} ({reason_of(error)})") from error


def made_by_user(name: str, option: str, keywords: dict[str, Any], methods: tuple[str, ...]) -> Any:
    """What a user's factory makes.

    Args:
      name: `package.module:Factory`; modules of the working folder are found too.
      option: Of the command line that gave it, such as `--policy`.
      keywords: The factory's arguments.
      methods: What it makes has these.

    Raises:
      InputError: There is no such module or factory, it fails, or what it makes lacks a method.
    """
    said_by = f"{option} {name}"
    factory = _factory(name, said_by)
    try:
        made = factory(**keywords)
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # whatever a stranger's code raises
        raise InputError(f"{said_by}: its factory failed ({reason_of(error)})") from error
    for method in methods:
        if not callable(getattr(made, method, None)):
            kind = type(made).__name__
            raise InputError(f"{said_by}: the {kind} that it makes has no method {method}")
    return made


def reason_of(error: BaseException) -> str:
    """An error of a stranger's code in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]


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


def _factory(name: str, said_by: str) -> Callable[..., Any]:
    module_name, _, attribute = name.partition(":")
    if not module_name or not attribute:
        raise InputError(f"{said_by}: expected package.module:Factory or ws://host:port")
    if "/" in module_name or "\\" in module_name or module_name.endswith(".py"):
        word = module_name.removesuffix(".py").replace("\\", "/").strip("./").replace("/", ".")
        raise InputError(
            f"{said_by}: a file's path; expected a module's name, such as {word}:{attribute}"
        )
    search_working_folder()
    found: Any = import_user_module(module_name, said_by)
    for part in attribute.split("."):
        if not hasattr(found, part):
            public = [each for each in dir(found) if not each.startswith("_")]
            raise unknown_name(f"attribute of {module_name}", part, public)
        found = getattr(found, part)
    if not callable(found):
        raise InputError(f"{said_by}: {attribute} cannot be called; expected a class or function")
    return found


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no finite number")
