"""What the fields of a run's `run.json` have to be, as far as a card tells them and seeds depend on them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from manipose_mj.control.perception.source_names import GRASP_SOURCES
from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.method import NEEDED
from manipose_mj.evaluation.cards.text import is_line, is_lines
from manipose_mj.evaluation.injected_errors import InjectedErrors

# Without one of these nobody can repeat a run.
_REPEATED_BY = ("command", "machine", "python version", "mujoco version", "manipose_mj version")


def check_forms(path: Path, run: Mapping[str, Any]) -> None:
    """Nothing, if all is there and of its form.

    Args:
      path: Of the `run.json`, for messages.
      run: Its content.

    Raises:
      InputError: A field is missing or of another form; one line names it.
    """
    for names, lacking in (
        (NEEDED, "does not tell its method"),
        (_REPEATED_BY, "cannot be repeated"),
    ):
        missing = [name for name in names if name not in run]
        if missing:
            raise InputError(f"{path}: lacks {missing[0]!r}, so that it {lacking}; evaluate again")
    for name, value in run.items():
        expected, fits = _FORMS.get(name, _ANY)
        if name.endswith(" version"):
            expected, fits = _LINE
            name, value = "a version", f"{name} {value}"
        if not fits(value):
            raise InputError(f"{path}: {name} is {value!r:.80}; expected {expected}")


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _holds(value: Any, *names: str) -> bool:
    """Whether it is an object with texts of these names."""
    return isinstance(value, dict) and all(isinstance(value.get(name), str) for name in names)


def _is_planner(value: Any) -> bool:
    more = {"rules": (), "llm": ("model",), "replay": ("replay sha256",)}
    return _holds(value, "kind") and value["kind"] in more and _holds(value, *more[value["kind"]])


def _are_errors(value: Any) -> bool:
    """Whether it is null or errors that can be made on purpose."""
    if not isinstance(value, dict):
        return value is None
    return all(_is_error(name, made) for name, made in value.items())


def _is_error(name: str, made: Any) -> bool:
    if name == "cameras":
        return isinstance(made, list) and all(re.fullmatch(r"[\w/]+", str(each)) for each in made)
    if isinstance(made, bool):
        return name == "assume_upright" and made
    known = name in InjectedErrors.__annotations__ and name != "assume_upright"
    return known and isinstance(made, int | float) and 0 <= made < math.inf


# What a field has to be, in words and as a test.
_Form = tuple[str, Callable[[Any], bool]]
_ANY: _Form = ("", lambda value: True)
_LINE: _Form = ("one line of text", is_line)
_FORMS: dict[str, _Form] = {
    "tasks": (
        "a list of names",
        lambda value: isinstance(value, list) and all(isinstance(each, str) for each in value),
    ),
    "episodes": ("a whole number", _whole),
    "resample": ("null or a whole number", lambda value: value is None or _whole(value)),
    "pose": ("a name", lambda value: isinstance(value, str)),
    "policy": (
        "null or an object with name and obs_mode",
        lambda value: value is None or _holds(value, "name", "obs_mode"),
    ),
    "planner": ("an object with the kind rules, llm or replay, and what that needs", _is_planner),
    "estimator": (
        "null or an object with a name",
        lambda value: value is None or _holds(value, "name"),
    ),
    "batch": (
        "null or an object with an engine",
        lambda value: value is None or _holds(value, "engine"),
    ),
    "assets sha256": ("null or a text", lambda value: isinstance(value, str | None)),
    "injected errors": ("null or an object of errors that can be made", _are_errors),
    "estimator metadata": ("null or an object", lambda value: isinstance(value, dict | None)),
    "grasps": (
        f"null or one of {', '.join(GRASP_SOURCES)}",
        lambda value: value is None or value in GRASP_SOURCES,
    ),
    "command": ("a command line", is_lines),
    "machine": _LINE,
}
