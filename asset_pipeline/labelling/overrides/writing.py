"""Put one entry into a labels file, and leave all else in it, comments too, as a person wrote it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import yaml

from asset_pipeline.labelling.overrides.reading import read_entries


def put_entry(path: Path, name: str, entry: dict[str, Any]) -> None:
    """Set the entry of an object, or take it out where `entry` is empty; the file is replaced whole.

    Args:
      path: The labels file; made if it is not there.
      name: The object.
      entry: Its fields, as plain data.

    Raises:
      InputError: The file is there and cannot be read as labels.
    """
    text, spans = "", {}
    if path.exists():
        text = _in_blocks(path)
        spans = _spans(text)
    block = _block(name, entry) if entry else ""
    if name in spans:
        start, end = spans[name]
        text = text[:start] + block + text[end:]
    elif block:
        text = (text.rstrip("\n") + "\n\n" if text.strip() else "") + block
    _replace(path, text)


def _in_blocks(path: Path) -> str:
    """The file's text, each object's entry on lines of its own."""
    entries = read_entries(path)
    text = path.read_text(encoding="utf-8")
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if root is not None and root.flow_style:  # written in braces
        return "".join(_block(name, entry) for name, entry in entries.items())
    return text


def _spans(text: str) -> dict[str, tuple[int, int]]:
    """First character and end of every object's entry, without the comments before the next one."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if root is None:
        return {}
    spans = {}
    for key, value in root.value:
        start, end = key.start_mark.index, value.end_mark.index
        # A block ends where the next begins: blank lines and comments between are not its own.
        lines = text[start:end].splitlines(keepends=True)
        while len(lines) > 1 and (not lines[-1].strip() or lines[-1].startswith("#")):
            lines.pop()
        end = start + len("".join(lines))
        if text[end - 1 : end] != "\n":  # the rest of a line, after a value written in braces
            newline = text.find("\n", end)
            end = len(text) if newline < 0 else newline + 1
        spans[key.value] = (start, end)
    return spans


def _block(name: str, entry: dict[str, Any]) -> str:
    return yaml.safe_dump({name: entry}, sort_keys=False, default_flow_style=None, width=100)


def _replace(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, scratch = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(scratch, 0o644)
        os.replace(scratch, path)
    except BaseException:
        os.unlink(scratch)
        raise
