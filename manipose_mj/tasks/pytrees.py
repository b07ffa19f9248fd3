"""Lets JAX see into states, goals and symmetry groups: import this where worlds are batched.

The classes themselves are plain frozen dataclasses, so that tasks on the CPU load no JAX. Fields
annotated as names or numbers of Python (`str`, `int`, `bool`, None, tuples of them) are static; every other field is a
subtree of arrays, which may have batch dimensions.
"""

from __future__ import annotations

import contextlib
import types
from collections.abc import Iterable
from dataclasses import fields
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

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
    annotations = _field_types(cls)
    static = tuple(name for name, annotated in annotations.items() if _is_static(annotated))
    arrays = tuple(name for name in annotations if name not in static)

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


def _field_types(cls: type) -> dict[str, Any]:
    """What every field is annotated as; annotations that name nothing here stay strings."""
    own = {field.name: field.type for field in fields(cls)}
    try:
        known = get_type_hints(cls)
    except (NameError, TypeError):  # names that are imported for type checkers only
        known = {}
        for name, annotated in own.items():
            if isinstance(annotated, str):
                with contextlib.suppress(Exception):
                    known[name] = eval(annotated, {})  # of builtins alone: str, tuple[int, ...]
    return {name: known.get(name, annotated) for name, annotated in own.items()}


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
