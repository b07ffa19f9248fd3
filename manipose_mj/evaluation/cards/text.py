"""What strangers say, as Markdown can hold it."""

from __future__ import annotations

from typing import Any


def is_line(value: Any) -> bool:
    """Whether it is a text of one line, with something to see in it and nothing that cannot be seen."""
    return isinstance(value, str) and bool(value.strip()) and value.isprintable()
