"""Questions to a language model and its answers, as records that can be replayed exactly."""

from __future__ import annotations

import json
from collections import defaultdict, deque
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
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    records = []
    for number, line in enumerate(lines, 1):
        try:
            record = Exchange(**json.loads(line))
            if not isinstance(record.reply, str) or not isinstance(record.error, str):
                raise TypeError("reply and error are text")
            records.append(record)
        except (ValueError, TypeError, RecursionError) as error:
            raise InputError(f"{path}, line {number}: no recorded exchange ({error})") from None
    return records


class ReplayModel:
    """Gives the recorded answers to each question, in their order, and none to any other."""

    def __init__(self, path: Path) -> None:
        """Reads the records.

        Raises:
          InputError: They cannot be read.
        """
        exchanges = read_exchanges(path)
        self.name = f"replay of {exchanges[0].model}"
        self.parameters: dict[str, Any] = {"replay": path.name}
        self._answers: dict[str, deque[Exchange]] = defaultdict(deque)
        for each in exchanges:
            self._answers[each.question].append(each)

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> str:
        """The recorded reply; to a question that was asked several times, one after the other, then the last.

        Raises:
          NoReplyError: The question was not recorded, or had no reply then either.
        """
        answers = self._answers.get(question(messages, schema))
        if not answers:
            raise NoReplyError(
                "this question is not among the recorded ones; an own --instruction has to be given again"
            )
        found = answers.popleft() if len(answers) > 1 else answers[0]
        if found.error:
            raise NoReplyError(found.error)
        return found.reply
