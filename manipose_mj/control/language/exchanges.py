"""Questions to a language model and its answers, as records that can be replayed exactly."""

from __future__ import annotations

import json
import math
import os
from contextlib import suppress
from dataclasses import MISSING, asdict, dataclass, fields
from pathlib import Path
from typing import IO, Any, Protocol

from manipose_mj.errors import InputError, RecordError

Message = dict[str, str]
INSTRUCTION = "\n\nInstruction: "  # in a first question, between the scene and what is wanted
_NUMBER, _INDEX = int | float, int | None
_WORDS: dict[Any, str] = {
    str: "text", dict: "object", list: "list", int: "whole number", bool: "true or false",
    _NUMBER: "number", _INDEX: "whole number or null",
}  # fmt: skip
_KINDS: dict[str, Any] = {
    "model": str,
    "parameters": dict,
    "messages": list,
    "schema": dict,
    "reply": str,
    "error": str,
    "task": str,
    "number": int,
    "instruction": str,
    "at": _NUMBER,
    "seconds": _NUMBER,
    "cut": bool,
    "episode": _INDEX,
}


@dataclass(frozen=True)
class Exchange:
    """One question and what came back.

    Attributes:
      model: Name of the model.
      parameters: Sent with the question: temperature, seed and the like; never a key.
      messages: The conversation so far: `role` and `content`.
      schema: JSON schema of the answer that was asked for.
      reply: The answer's text; empty where there was none.
      error: Why there was none, in one line; empty otherwise.
      seconds: How long it took.
      cut: The reply was cut at the greatest length of an answer.
      task: Of the episode, `"domain/task"`; empty where it is not known.
      episode: Its index; None where it is not known.
      number: Of the question within the episode, from 0.
      instruction: What the model was to do instead of what the episode asks for; empty otherwise.
      at: When the answer came, in seconds since 1970; 0 in older records.
    """

    model: str
    parameters: dict[str, Any]
    messages: list[Message]
    schema: dict[str, Any]
    reply: str
    error: str = ""
    seconds: float = 0.0
    cut: bool = False
    task: str = ""
    episode: int | None = None
    number: int = 0
    instruction: str = ""
    at: float = 0.0


@dataclass(frozen=True)
class Answer:
    """What a model says; `cut`: that it came to the greatest length of an answer before its end."""

    text: str
    cut: bool = False


class NoReplyError(Exception):
    """The model did not answer; the text says why, in one line."""


class ChatModel(Protocol):
    """What answers questions.

    Attributes:
      name: Of the model.
      parameters: That it is asked with.
    """

    name: str
    parameters: dict[str, Any]

    def begin(self, task: str, episode: int) -> None:
        """The questions of this episode come next."""
        ...

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> Answer:
        """The reply to the last message, of the schema if the model keeps to it.

        Raises:
          NoReplyError: There is none.
        """
        ...


def append_exchange(path: Path, exchange: Exchange) -> None:
    """Add a record to a file of JSON lines.

    Raises:
      RecordError: It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as file:
            _drop_unfinished_line(file)
            file.write((json.dumps(asdict(exchange)) + "\n").encode("ascii"))
    except OSError as error:
        raise RecordError(
            f"{path}: exchanges cannot be written there ({error.strerror or error}); "
            "make room, or choose another --out"
        ) from None


def _drop_unfinished_line(file: IO[bytes]) -> None:
    """Of a process of the same number that was killed."""
    if file.seek(0, os.SEEK_END):
        file.seek(-1, os.SEEK_END)
        if file.read(1) != b"\n":
            file.seek(0)
            file.truncate(file.read().rfind(b"\n") + 1)


def read_exchanges(path: Path) -> list[Exchange]:
    """The records of a file, or of every `*.jsonl` in a folder.

    Raises:
      InputError: There is no such file, it has no records, or a line is none.
    """
    # Named for processes: 9999 is before 10000.
    numbered = sorted(path.glob("*.jsonl"), key=lambda file: (len(file.stem), file.stem))
    exchanges = [
        each for file in (numbered if path.is_dir() else [path]) for each in _records(file)
    ]
    if not exchanges:
        raise InputError(f"{path}: holds no recorded exchange")
    return exchanges


def _records(path: Path) -> list[Exchange]:
    try:
        *lines, unfinished = path.read_text(encoding="utf-8").split("\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: cannot be read (no text in UTF-8)") from None
    records = []
    for number, line in enumerate(lines, 1):
        try:
            records.append(_record(json.loads(line)))
        except (ValueError, TypeError, RecursionError) as error:
            raise InputError(f"{path}, line {number}: no recorded exchange ({error})") from None
    with suppress(ValueError, TypeError, RecursionError):  # of a process that was killed
        records.append(_record(json.loads(unfinished)))
    return records


def _record(document: Any) -> Exchange:
    """The record that a line holds.

    Raises:
      TypeError: It has other fields, or others in them.
    """
    if not isinstance(document, dict):
        raise TypeError("it is no JSON object")
    for field in fields(Exchange):
        if field.name not in document and field.default is MISSING:
            raise TypeError(f"lacks field {field.name!r}")
    for name in document:
        if name not in Exchange.__annotations__:
            raise TypeError(f"unknown field {name!r}")
    record = Exchange(**document)
    for name, kind in _KINDS.items():
        if not isinstance(getattr(record, name), kind):
            raise TypeError(f"field {name!r} is no {_WORDS[kind]}")
    for name in ("at", "seconds"):
        if not math.isfinite(getattr(record, name)):
            raise TypeError(f"field {name!r} is no finite number")
    if not all(isinstance(message, dict) for message in record.messages):
        raise TypeError("field 'messages' is no list of messages")
    return record
