"""Whether the name of another file, written in a file from strangers, stays in the object's own folder."""

from __future__ import annotations

import posixpath
import re
from pathlib import PurePosixPath


def leaves(name: str, *, depth: int = 0) -> bool:
    """Whether a reference is absolute, a URL, no path at all, or climbs out of the object's folder.

    Args:
      name: As written; a backslash separates folders too.
      depth: How many folders below the object's own the file that names it lies.
    """
    text = name.replace("\\", "/")
    if not text.isprintable() or re.match(r"[A-Za-z]:|[A-Za-z]\w+://|/|~", text):
        return True
    parts = PurePosixPath(posixpath.normpath(text)).parts
    return sum(part == ".." for part in parts) > depth
