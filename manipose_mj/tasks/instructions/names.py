"""Words for objects, drawers and doors, places and attitudes; as seen from the robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.tasks.articulated.part_choice import kind_of, rows_of

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")
_UPRIGHT = 0.9  # cosine to the vertical, from which on an axis points up
_UP = np.array([0.0, 0.0, 1.0])


def asset_words(asset: Asset) -> str:
    """Such as `chips can`."""
    return asset.category.replace("_", " ")


def part_words(asset: Asset, part: MovingPart) -> str:
    """Such as `top left drawer`: what tells a part from the others of its kind.

    Args:
      asset: That the part is of.
      part: With a handle.
    """
    return part_words_among(asset.parts, part)


def part_words_among(parts: Sequence[MovingPart], part: MovingPart) -> str:
    """The same among any parts, wherever they are known from."""
    drawer = kind_of(part) == "drawer"
    # Flaps are called doors too.
    alike = [p for p in parts if p.handle is not None and (kind_of(p) == "drawer") is drawer]
    rows = rows_of(alike)
    row = next(i for i, parts in enumerate(rows) if any(p.name == part.name for p in parts))
    beside = sorted(rows[row], key=_from_left)
    column = [p.name for p in beside].index(part.name)
    level, counted_up = _among(row, len(rows), ("bottom", "middle", "top"))
    side, counted_right = _among(column, len(beside), ("left", "middle", "right"))
    words = [level, side, "drawer" if drawer else "door", counted_up, counted_right]
    return " ".join(word for word in words if word)


def _among(index: int, count: int, names: tuple[str, str, str]) -> tuple[str, str]:
    """What tells one of a row, before the noun and behind it: the ends and the very middle have names, others are counted."""
    if count == 1:
        return "", ""
    if index in (0, count - 1):
        return names[0] if index == 0 else names[2], ""
    if 2 * index == count - 1:
        return names[1], ""
    return ORDINALS[index], f"from the {names[0]}"


def _from_left(part: MovingPart) -> float:
    """How far to the right a part is for somebody in front of it [m]."""
    assert part.handle is not None
    forwards = -part.handle.rotation[:, 1]
    return float(part.handle.origin @ np.cross(forwards, _UP))


def place_words(place: Float[np.ndarray, "3"]) -> str:
    """Where a point is, from the robot's base [m]."""
    return f"{level_words(place[:2])} and {100 * place[2]:.0f} cm up"


def level_words(place: Float[np.ndarray, "2"]) -> str:
    """Where a point of the table is, from the robot's base [m]."""
    side = "left" if place[1] >= 0 else "right"
    return f"{100 * place[0]:.0f} cm ahead, {100 * abs(place[1]):.0f} cm to the {side}"


def direction_words(direction: Float[np.ndarray, "3"]) -> str:
    """Where an axis points, such as `up` or `30 degrees to the left`."""
    if abs(direction[2]) > _UPRIGHT:
        return "up" if direction[2] > 0 else "down"
    angle = round(float(np.degrees(np.arctan2(direction[1], direction[0]))))
    if abs(angle) < 3:
        return "straight ahead"
    if abs(angle) > 177:
        return "back at the robot"
    return f"{abs(angle)} degrees to the {'left' if angle > 0 else 'right'}"


def _has_no_ends(rotations: Float[np.ndarray, "n 3 3"]) -> bool:
    """Whether every axis can be turned about, as a box's can, so that no end of it tells top or front."""
    return bool((np.diagonal(rotations, axis1=1, axis2=2).min(axis=0) < -_UPRIGHT).all())


def attitude_words(asset: Asset, rotation: Float[np.ndarray, "3 3"]) -> str:
    """How an object lies or stands.

    Args:
      asset: The object.
      rotation: `R_world_label`.
    """
    label, x, y = asset.label, rotation[:, 0], rotation[:, 1]
    if label.object_type == "functional":
        return f"its tip pointing {direction_words(x)}"
    if not label.symmetry.axial and _has_no_ends(label.symmetry.rotations):
        longest, second, _ = rotation.T[np.argsort(-label.extents, kind="stable")]
        longest, second = (a if a[2] > -_UPRIGHT else -a for a in (longest, second))
        return f"its longest side pointing {direction_words(longest)}, its second {direction_words(second)}"
    if abs(x[2]) < _UPRIGHT:
        return f"lying, its top pointing {direction_words(x)}"
    stands = "upright" if x[2] > 0 else "upside down"
    if label.symmetry.axial:
        return stands
    return f"{stands}, its front pointing {direction_words(y)}"
