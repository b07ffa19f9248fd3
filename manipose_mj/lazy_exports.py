"""Names that a package offers without loading the modules that define them before somebody asks."""

from __future__ import annotations

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_exports(package: str, file: str) -> Callable[[str], Any]:
    """The `__getattr__` of a package: imports a name on first use from the module that defines it.

    The names are those that the package's `__init__.py` imports under `if TYPE_CHECKING:`, so that they are
    written once, where type checkers and editors read them.

    Args:
      package: The package's `__name__`.
      file: Its `__file__`.

    Raises:
      AttributeError: By the function returned: the package offers no such name.
    """
    homes: dict[str, str] = {}
    for statement in ast.parse(Path(file).read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING":
            for line in statement.body:
                if isinstance(line, ast.ImportFrom) and line.module:
                    homes |= {alias.name: line.module for alias in line.names}

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return load
