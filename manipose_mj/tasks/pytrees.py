"""Lets JAX see into states, goals and symmetry groups: import this where worlds are batched.

The classes themselves are plain frozen dataclasses, so that tasks on the CPU load no JAX. Fields
annotated as names or numbers of Python (`str`, `int`, `bool`, None, tuples of them) are static; every other field is a
subtree of arrays, which may have batch dimensions.
"""

from __future__ import annotations

import sys
import types
from collections.abc import Iterable
from dataclasses import Field, fields
from typing import Any, Literal, Union, get_args, get_origin

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

_STATIC = (str, int, bool, type(None))
_registered: set[type] = set()


def register(cls: type) -> None:
    """Make JAX see into a frozen dataclass, such as an own goal; a second time changes nothing."""
    if cls in _registered:
        return
    static = tuple(each.name for each in fields(cls) if _is_static(_annotation(cls, each)))
    arrays = tuple(each.name for each in fields(cls) if each.name not in static)

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


def _annotation(cls: type, field: Field[Any]) -> Any:
    """What a field is annotated as; a string still where it names what is imported for type checkers only."""
    if not isinstance(field.type, str):
        return field.type
    owner = next(
        base for base in cls.__mro__ if field.name in vars(base).get("__annotations__", ())
    )
    try:
        return eval(field.type, dict(vars(sys.modules[owner.__module__])))
    except Exception:  # whatever evaluating a stranger's annotation raises
        return field.type


def _is_static(annotated: Any) -> bool:
    """Whether it is a name or number of Python, a union or tuple of such, or one of fixed values."""
    if annotated in _STATIC:
        return True
    origin, inner = get_origin(annotated), get_args(annotated)
    if origin is Literal:
        return True
    if origin in (Union, types.UnionType, tuple):
        return all(each is Ellipsis or _is_static(each) for each in inner)
    return False


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
