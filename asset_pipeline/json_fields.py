"""Reading JSON that people may have edited: every complaint names the file and the field."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.errors import InputError


def rounded(values: Any) -> Any:
    return np.round(np.asarray(values, float), 9).tolist()


def write_json(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def write_columns(path: Path, head: dict[str, Any], columns: dict[str, list[Any]]) -> None:
    """A JSON object of a few values and some long lists, with one entry of a list on a line."""
    lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
    for key, rows in columns.items():
        entries = ",\n".join("  " + json.dumps(row, separators=(",", ":")) for row in rows)
        lines.append(f" {json.dumps(key)}: [\n{entries}\n ]")
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def read_json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: missing; expected an asset folder") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: not valid JSON ({error})") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds a {type(document).__name__}; expected a JSON object")
    return document


def typed(
    path: Path, document: dict[str, Any], key: str, kind: type, name: str | None = None
) -> Any:
    name = name or key
    if key not in document:
        raise InputError(f"{path}: field {name!r} is missing; expected a {kind.__name__}")
    value = document[key]
    if not isinstance(value, kind) or isinstance(value, bool):
        raise InputError(
            f"{path}: field {name!r} is a {type(value).__name__}; expected a {kind.__name__}"
        )
    return value


def positive(path: Path, document: dict[str, Any], key: str, name: str) -> float:
    value = number(path, document, key, name)
    if value <= 0:
        raise InputError(f"{path}: field {name!r} is {value}; expected a positive number")
    return value


def number(path: Path, document: dict[str, Any], key: str, name: str) -> float:
    value = document.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"{path}: field {name!r} is {value!r}; expected a finite number")
    return float(value)


def array(
    path: Path, document: dict[str, Any], key: str, shape: tuple[int, ...], name: str
) -> np.ndarray:
    try:
        value = np.asarray(document.get(key), dtype=float)
    except (TypeError, ValueError):
        value = np.empty(0)
    if value.shape != shape or not np.isfinite(value).all():
        size = " x ".join(map(str, shape))
        raise InputError(f"{path}: field {name!r} is not {size} finite numbers")
    return value


def unit_quaternion(path: Path, document: dict[str, Any], name: str) -> np.ndarray:
    value = array(path, document, "quaternion", (4,), name)
    if abs(np.linalg.norm(value) - 1) > 1e-3:
        raise InputError(f"{path}: field {name!r} is not a unit wxyz quaternion")
    return value
