"""Hashes of our own source: of modules with every module that they import, directly or not, or of all there is."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

_ROOT = Path(__file__).parents[2]
_PACKAGES = ("asset_pipeline", "manipose_mj")
_SHIPPED = (".py", ".json", ".npz")


def source_hash(modules: Iterable[str], *extra: str) -> str:
    """Twelve hexadecimal digits that change when any of the code does.

    Args:
      modules: Full names of modules of this distribution.
      extra: Further strings that results depend on, such as a library's version.
    """
    digest = hashlib.sha256("\n".join(extra).encode())
    for path in sorted(sources(modules)):
        digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def distribution_hash() -> str:
    """Twelve hexadecimal digits that change when any code, weights or other data of both packages do."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted(_ROOT.joinpath(package).rglob("*")):
            if path.suffix in _SHIPPED:
                digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0")
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def sources(modules: Iterable[str]) -> set[Path]:
    """The files of modules and of all they import from this distribution."""
    found: set[Path] = set()
    waiting = list(modules)
    while waiting:
        path = _file(waiting.pop())
        if path is not None and path not in found:
            found.add(path)
            waiting += _imported(path.read_bytes())
    return found


@cache
def _imported(source: bytes) -> tuple[str, ...]:
    return tuple(_imports(ast.parse(source)))


def _imports(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                module = f"{node.module}.{alias.name}"
                # Packages offer names of modules that nothing here may depend on: a name or a module, not both.
                yield node.module if _file(module) is None else module


def _file(module: str) -> Path | None:
    """Where the module's source is; None for what is not a module of ours."""
    if module.split(".")[0] not in _PACKAGES:
        return None
    stem = _ROOT.joinpath(*module.split("."))
    candidates = (stem.with_suffix(".py"), stem / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)
