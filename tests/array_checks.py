"""Checks of the shapes and dtypes that functions declare with jaxtyping, when a test calls them."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable
from dataclasses import is_dataclass
from functools import partial, wraps
from types import UnionType
from typing import Any, Union, get_args, get_origin

PACKAGES = ("manipose_mj", "asset_pipeline")
# A check costs 20 to 100 us, as long as a step of the physics: of a function that a loop calls, in every process,
# so many calls are checked, and then one in so many.
FIRST_CALLS = 100
EVERY = 50
_SHAPE = re.compile(r"\b(?:Bool|Float\d*|Int\d*|Integer|Key|Num|PRNGKeyArray|Shaped|UInt\d*)\b")


def install_array_checks() -> None:
    """Check arrays in both packages, if they are imported after this; code that declares none runs as it is."""
    import jaxtyping

    plain = jaxtyping.jaxtyped

    def jaxtyped(code: Any = None, *, typechecker: Any) -> Any:
        check = partial(plain, typechecker=typechecker)
        if code is None:
            return partial(jaxtyped, typechecker=typechecker)
        if isinstance(code, classmethod | staticmethod):
            return type(code)(jaxtyped(code.__func__, typechecker=typechecker))
        if isinstance(code, property):
            parts = (code.fget, code.fset, code.fdel)
            return property(*(f and jaxtyped(f, typechecker=typechecker) for f in parts))
        if not _mentions_shapes(code):
            return code
        if not inspect.isclass(code):
            return _checked_at_times(code, check)
        return code if _is_pytree(code) else check(code)  # JAX fills pytrees with what it likes

    jaxtyping.jaxtyped = jaxtyped
    jaxtyping.install_import_hook(PACKAGES, f"{__name__}.check_arrays")


def check_arrays(function: Callable) -> Callable:
    """A function that checks its arrays; other types are the static checker's, so that tests may pass fakes."""
    from beartype import BeartypeConf, beartype

    hints = {
        name: _of_any_library(hint) if _declares_array(hint) else Any
        for name, hint in function.__annotations__.items()
    }
    if all(hint is Any for hint in hints.values()):
        return function
    function.__annotations__ = hints
    conf = BeartypeConf(is_pep484_tower=True)  # an int is a float, as static checkers see it
    return beartype(conf=conf)(function)


def _checked_at_times(function: Callable, check: Callable[[Callable], Callable]) -> Callable:
    """A function, checked in its first calls and at times thereafter; what checks it is made when it is called."""
    calls, checked = 0, None

    @wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        nonlocal calls, checked
        calls += 1
        if calls > FIRST_CALLS and calls % EVERY:
            return function(*args, **kwargs)
        if checked is None:
            checked = check(function)
        return checked(*args, **kwargs)

    return called


def _mentions_shapes(code: Any) -> bool:
    """Whether annotations, as they are written, name an array's shape."""
    return any(_SHAPE.search(str(hint)) for hint in inspect.get_annotations(code).values())


def _of_any_library(hint: Any) -> Any:
    """A type whose JAX arrays may be NumPy's as well, which JAX takes everywhere."""
    import numpy as np
    from jaxtyping import AbstractArray

    if isinstance(hint, type) and issubclass(hint, AbstractArray):
        return hint if issubclass(np.ndarray, hint.array_type) else hint.dtype[Any, hint.dim_str]
    parts = get_args(hint)
    if isinstance(hint, UnionType) or get_origin(hint) is Union:
        return Union[tuple(_of_any_library(part) for part in parts)]  # noqa: UP007
    origin = get_origin(hint)
    if origin in (tuple, list, dict):
        return origin[tuple(_of_any_library(part) for part in parts)]
    return hint


def _declares_array(hint: Any) -> bool:
    """Whether a shape stands anywhere in a type."""
    from jaxtyping import AbstractArray

    if isinstance(hint, type) and issubclass(hint, AbstractArray):
        return True
    return any(_declares_array(part) for part in get_args(hint))


def _is_pytree(kind: type) -> bool:
    """Whether JAX, if it is loaded, knows a dataclass as a container."""
    if "jax" not in sys.modules or not is_dataclass(kind):
        return False
    from jax.tree_util import all_leaves

    try:
        return not all_leaves([object.__new__(kind)])
    except (AttributeError, TypeError):  # it looked for the fields
        return True
