"""What strangers say, as Markdown can hold it."""

from __future__ import annotations

import json
import re
from typing import Any


def is_line(value: Any) -> bool:
    """Whether it is a text of one line, with something to see in it and nothing that cannot be seen."""
    return isinstance(value, str) and bool(value.strip()) and value.isprintable()


def is_lines(value: Any) -> bool:
    """Whether it is a text of such lines, of which some may be empty."""
    return is_line(value.replace("\n", " ")) if isinstance(value, str) else False


def as_text(said: str) -> str:
    """What somebody said, as Markdown that is neither HTML nor a link, code or a list of attributes."""
    return re.sub(r"[\\`\[\]<>{}]", lambda found: f"\\{found[0]}", said)


def as_code(value: Any) -> str:
    """A value in a line, as code of Markdown that nothing in it ends."""
    text = value if isinstance(value, str) else json.dumps(value) if value else ""
    seen = "".join(each if each.isprintable() else " " for each in text)
    line = " ".join(seen.split()).replace("`", "'")
    return f"`{line or ' '}`"
