"""Fields of a labels file: values of the right kind, or one line that says which is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError, unknown_name

# Two axes nearer to each other than this do not fix a frame; axes farther from square are a slip.
SQUARE = np.deg2rad(30.0)


def rotation_of(where: str, entry: dict[str, Any]) -> Float[np.ndarray, "3 3"] | None:
    """The frame that `rotation`, or `x` and `y`, say; None where there is neither.

    Raises:
      InputError: They are wrong, as in every function here; `where` opens the message.
    """
    if "rotation" in entry:
        if "x" in entry or "y" in entry:
            raise InputError(f"{where}: has both 'rotation' and axes; expected one of the two")
        rows = numbers(where, "rotation", entry["rotation"], (3, 3))
        if not np.allclose(rows @ rows.T, np.eye(3), atol=1e-3) or np.linalg.det(rows) < 0:
            raise InputError(
                f"{where}: rotation: is not a right-handed rotation matrix; expected three rows "
                "whose columns are unit X, Y, Z, square to each other"
            )
        u, _, v = np.linalg.svd(rows)  # the nearest exact one
        return u @ v
    x, y = direction(where, "x", entry), direction(where, "y", entry)
    if x is None and y is None:
        return None
    if x is None or y is None:
        raise InputError(f"{where}: {'x' if x is None else 'y'}: missing; a frame needs both axes")
    if abs(x @ y) > np.sin(SQUARE):
        angle = np.degrees(np.arccos(np.clip(x @ y, -1, 1)))
        raise InputError(f"{where}: y: is {angle:.0f} deg from x; expected about 90 deg")
    y = y - (y @ x) * x
    y = y / np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def direction(where: str, key: str, entry: dict[str, Any]) -> Float[np.ndarray, "3"] | None:
    """The unit vector of a field; None where there is none."""
    if key not in entry:
        return None
    vector = numbers(where, key, entry[key], 3)
    length = np.linalg.norm(vector)
    if length < 1e-9:
        raise InputError(f"{where}: {key}: has no length; expected a direction such as [0, 0, 1]")
    return vector / length


def numbers(where: str, key: str, value: Any, shape: int | tuple[int, ...]) -> np.ndarray:
    """A value as finite numbers of this shape."""
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError):
        array = np.empty(0)
    shape = (shape,) if isinstance(shape, int) else shape
    if array.shape != shape or not np.isfinite(array).all() or _has_text(value):
        count = "a finite number" if shape == (1,) else f"{' x '.join(map(str, shape))} numbers"
        shown = value[0] if shape == (1,) else value
        raise InputError(f"{where}: {key}: is {shown!r}; expected {count}{_hint(shown)}")
    return array


def _hint(value: Any) -> str:
    """YAML takes `1e-3` for text."""
    try:
        return (
            f": write {float(value)!r}" if isinstance(value, str) and "e" in value.lower() else ""
        )
    except ValueError:
        return ""


def _has_text(value: Any) -> bool:
    """Whether NumPy has taken text or truth values for numbers."""
    if isinstance(value, list):
        return any(_has_text(each) for each in value)
    return isinstance(value, str | bool)


def mapping(where: str, key: str, value: Any) -> dict[str, Any]:
    """A value that has fields."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: {key}: is {kind_of(value)}; expected fields with values")
    return value


def require_known(where: str, kind: str, entry: dict[str, Any], known: tuple[str, ...]) -> None:
    """Refuse fields that nobody reads."""
    for key in entry:
        if key not in known:
            raise InputError(f"{where}: {unknown_name(kind, str(key), known)}")


def kind_of(value: Any) -> str:
    """What a value is, for a message."""
    names = {list: "a list", str: "text", type(None): "empty", dict: "a mapping"}
    return names.get(type(value), repr(value))
