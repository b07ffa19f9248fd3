"""Tasks with a few built-in objects instead of all: what tests build once, they all use."""

from __future__ import annotations

from typing import Any

from dm_control import composer

from manipose_mj import suite
from manipose_mj.tasks.core.config import EnvConfig

_STORED = ("chips_can_000", "mug_000", "mug_001", "box_001")
_FURNITURE = {
    "microwave": ("microwave_000", "microwave_008"),
    "oven": ("oven_007", "oven_018"),
    "": ("cabinet_000", "cabinet_003"),
}
_PILED = (
    "box_010", "box_016", "box_028", "box_046", "chips_can_000", "chips_can_001", "drinkbox_000",
    "drinkbox_001", "remote_000", "candle_000", "steel_tape_000", "sausage_000",
)  # fmt: skip
# What hides one another and can be taken away again.
_HIDDEN = (
    "box_010", "box_016", "box_028", "box_046", "drinkbox_000", "drinkbox_001", "computer_mouse_000",
    "computer_mouse_001", "steel_tape_000", "camera_000",
)  # fmt: skip


def few(task: str) -> tuple[str, ...]:
    """Names of built-in objects for a task of this package, `"domain/name"`."""
    domain, _, name = task.partition("/")
    if domain == "clutter":
        return _HIDDEN if name == "occluded" else _PILED
    if domain == "single_object":
        mugs = ("mug_000", "mug_001")
        if name == "reorient_mug":
            return (*mugs, "mug_002", "mug_003")
        both = (*mugs, "chips_can_000", "chips_can_001", "box_000", "box_001")
        return both if name == "orientation" else (*both, "bowl_000", "bowl_001")
    if name == "store_chips_can_middle_drawer":
        return ("cabinet_000", "chips_can_000")
    pieces = next(names for kind, names in _FURNITURE.items() if kind in name)
    return (*pieces, *_STORED) if name.startswith(("store", "take_out")) else pieces


def load(domain: str, task: str, seed: Any = None, **options: Any) -> composer.Environment:
    """`suite.load` with a few objects, unless `options` names others."""
    return suite.load(domain, task, seed, **{"objects": few(f"{domain}/{task}"), **options})


def config(task: str, **options: Any) -> EnvConfig:
    """`EnvConfig` with a few objects, unless `options` names others."""
    return EnvConfig(task, **{"objects": few(task), **options})
