"""Reading JSON that people may have edited: every complaint names the file, the field, its value and what is right."""

from __future__ import annotations

import json
import math
import reprlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.errors import InputError


@dataclass(frozen=True)
class Fields:
    """One object of a JSON document. Every method raises `InputError` where a field is missing or wrong.

    Attributes:
      path: Of the file.
      values: The object.
      name: Of the object within the document, such as `"parts[0].joint"`; empty for the document itself.
    """

    path: Path
    values: dict[str, Any]
    name: str = ""

    def wrong(self, key: str, expected: str) -> InputError:
        """The complaint about a field."""
        field = f"{self.name}.{key}" if self.name else key
        if key not in self.values:
            return InputError(f"{self.path}: field {field!r} is missing; expected {expected}")
        value = reprlib.repr(self.values[key])
        return InputError(f"{self.path}: field {field!r} is {value}; expected {expected}")

    def text(self, key: str, *choices: str) -> Any:
        """A text; one of the choices, where there are any."""
        value: Any = self.values.get(key)
        if not isinstance(value, str) or (choices and value not in choices):
            raise self.wrong(key, " or ".join(map(repr, choices)) or "a text")
        return value

    def flag(self, key: str) -> bool:
        """True or false."""
        value: Any = self.values.get(key)
        if not isinstance(value, bool):
            raise self.wrong(key, "true or false")
        return value

    def whole(self, key: str) -> int:
        """A whole number."""
        value: Any = self.values.get(key)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.wrong(key, "a whole number")
        return value

    def number(self, key: str, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number, within these limits."""
        value: Any = self.values.get(key)
        finite = isinstance(value, int | float) and not isinstance(value, bool)
        if not finite or not math.isfinite(value) or not low <= value <= high:
            limits = f" from {low:g} to {high:g}" if math.isfinite(high - low) else ""
            raise self.wrong(key, f"a finite number{limits}")
        return float(value)

    def positive(self, key: str) -> float:
        """A finite number above zero."""
        value = self.number(key)
        if value <= 0:
            raise self.wrong(key, "a positive number")
        return value

    def array(self, key: str, *shape: int) -> np.ndarray:
        """An array of finite numbers of this shape."""
        try:
            value = np.asarray(self.values.get(key), dtype=float)
        except (TypeError, ValueError):
            value = np.empty(0)
        if value.shape != shape or not np.isfinite(value).all():
            raise self.wrong(key, f"{' x '.join(map(str, shape))} finite numbers")
        return value

    def lengths(self, key: str) -> np.ndarray:
        """Three lengths above zero [m]."""
        value = self.array(key, 3)
        if (value <= 0).any():
            raise self.wrong(key, "3 positive lengths")
        return value

    def unit(self, key: str, size: int) -> np.ndarray:
        """A unit vector, or a unit wxyz quaternion for a size of 4, to within a thousandth."""
        value = self.array(key, size)
        if abs(np.linalg.norm(value) - 1) > 1e-3:
            raise self.wrong(key, "a unit wxyz quaternion" if size == 4 else "a unit vector")
        return value

    def entries(self, key: str) -> list[Any]:
        """A list."""
        value: Any = self.values.get(key)
        if not isinstance(value, list):
            raise self.wrong(key, "a list")
        return value

    def fields(self, key: str) -> Fields:
        """An object."""
        value: Any = self.values.get(key)
        if not isinstance(value, dict):
            raise self.wrong(key, "an object")
        return Fields(self.path, value, f"{self.name}.{key}" if self.name else key)

    def optional(self, key: str) -> Fields | None:
        """An object, or None for null and for nothing."""
        if self.values.get(key) is None:
            return None
        return self.fields(key)

    def each(self, key: str) -> list[Fields]:
        """The objects of a list."""
        entries = self.entries(key)
        named = Fields(self.path, {f"{key}[{i}]": v for i, v in enumerate(entries)}, self.name)
        return [named.fields(name) for name in named.values]


def read_json(path: Path) -> Fields:
    """The document of a file.

    Raises:
      InputError: The file is missing, no JSON, or holds no object.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: missing; expected an asset folder") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: not valid JSON ({error})") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds a {type(document).__name__}; expected a JSON object")
    return Fields(path, document)


def rounded(values: Any) -> Any:
    """Numbers to nine decimals, as nested lists."""
    return np.round(np.asarray(values, float), 9).tolist()


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a document, indented by one."""
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def write_columns(path: Path, head: dict[str, Any], columns: dict[str, list[Any]]) -> None:
    """Write a JSON object of a few values and some long lists, one entry of a list on a line."""
    lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
    for key, rows in columns.items():
        entries = ",\n".join("  " + json.dumps(row, separators=(",", ":")) for row in rows)
        lines.append(f" {json.dumps(key)}: [\n{entries}\n ]")
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
