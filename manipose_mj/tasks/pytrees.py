"""Lets JAX see into states, goals and symmetry groups: import this where worlds are batched.

The classes themselves are plain frozen dataclasses, so that tasks on the CPU load no JAX. Fields
annotated as names or numbers of Python (`str`, `int`, tuples of them) are static; every other field is a
subtree of arrays, which may have batch dimensions.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import jax

from manipose_mj.poses import SymmetryGroup
from manipose_mj.tasks.goals import (
    GoalFrame,
    InsideGoal,
    OnTableGoal,
    OpenGoal,
    OrientationGoal,
    PoseGoal,
    ShutGoal,
    TakenOutGoal,
    Tolerance,
    UprightGoal,
)
from manipose_mj.tasks.scene.indices import SceneIndices, SceneShapes
from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState

_STATIC = ("str", "int", "tuple[str, ...]", "tuple[int, ...]")
_registered: set[type] = set()


def register(cls: type) -> None:
    """Make JAX see into a frozen dataclass, such as an own goal; a second time changes nothing."""
    if cls in _registered:
        return
    static = tuple(field.name for field in fields(cls) if field.type in _STATIC)
    arrays = tuple(field.name for field in fields(cls) if field.type not in _STATIC)

    def flatten(node: Any) -> tuple[tuple[tuple[Any, Any], ...], tuple[Any, ...]]:
        children = tuple((jax.tree_util.GetAttrKey(name), getattr(node, name)) for name in arrays)
        return children, tuple(getattr(node, name) for name in static)

    def unflatten(names: tuple[Any, ...], children: Iterable[Any]) -> Any:
        # Not through __init__: JAX also builds trees of what are no arrays, such as axes.
        node = object.__new__(cls)
        for name, value in (*zip(static, names, strict=True), *zip(arrays, children, strict=True)):
            object.__setattr__(node, name, value)
        return node

    jax.tree_util.register_pytree_with_keys(cls, flatten, unflatten)
    _registered.add(cls)


for _cls in (
    SymmetryGroup,
    ObjectState,
    PartState,
    SceneState,
    Tolerance,
    GoalFrame,
    PoseGoal,
    OrientationGoal,
    UprightGoal,
    OnTableGoal,
    InsideGoal,
    TakenOutGoal,
    OpenGoal,
    ShutGoal,
    SceneIndices,
    SceneShapes,
):
    register(_cls)
