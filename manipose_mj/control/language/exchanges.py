"""Questions to a language model and its answers, as records that can be replayed exactly."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from manipose_mj.errors import InputError

Message = dict[str, str]


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
    """

    model: str
    parameters: dict[str, Any]
    messages: list[Message]
    schema: dict[str, Any]
    reply: str
    error: str = ""
    seconds: float = 0.0

    @property
    def question(self) -> str:
        """What was asked, as text that is equal for equal questions."""
        return question(self.messages, self.schema)


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

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> str:
        """The reply to the last message, of the schema if the model keeps to it.

        Raises:
          NoReplyError: There is none.
        """
        ...


def question(messages: list[Message], schema: dict[str, Any]) -> str:
    """Messages and schema as text."""
    return json.dumps([messages, schema], sort_keys=True)


def append_exchange(path: Path, exchange: Exchange) -> None:
    """Add a record to a file of JSON lines.

    Raises:
      InputError: It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(exchange)) + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def read_exchanges(path: Path) -> list[Exchange]:
    """The records of a file, or of every `*.jsonl` in a folder.

    Raises:
      InputError: There is no such file, or a line is no record.
    """
    files = sorted(path.glob("*.jsonl")) if path.is_dir() else [path]
    if not files:
        raise InputError(f"{path}: holds no *.jsonl with recorded exchanges")
    return [exchange for file in files for exchange in _records(file)]


def _records(path: Path) -> list[Exchange]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    records = []
    for number, line in enumerate(lines, 1):
        try:
            records.append(Exchange(**json.loads(line)))
        except (ValueError, TypeError) as error:
            raise InputError(f"{path}, line {number}: no recorded exchange ({error})") from None
    return records


class ReplayModel:
    """Gives the recorded answer to each question, and none to any other."""

    def __init__(self, path: Path) -> None:
        """Reads the records.

        Raises:
          InputError: They cannot be read.
        """
        exchanges = read_exchanges(path)
        self.name = f"replay of {exchanges[0].model}" if exchanges else "replay"
        self.parameters: dict[str, Any] = {"replay": path.name}
        self._answers = {each.question: each for each in exchanges}

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> str:
        """The recorded reply.

        Raises:
          NoReplyError: The question was not recorded, or had no reply then either.
        """
        found = self._answers.get(question(messages, schema))
        if found is None:
            raise NoReplyError("this question is not among the recorded ones")
        if found.error:
            raise NoReplyError(found.error)
        return found.reply
