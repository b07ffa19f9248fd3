"""A model that gives recorded answers, to each question its own and in their order."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from manipose_mj.control.language.exchanges import (
    INSTRUCTION,
    Answer,
    Exchange,
    Message,
    NoReplyError,
    read_exchanges,
)

_LONGEST = 100  # characters of an instruction in a message
_Answers = dict[str, list[Exchange]]


class ReplayModel:
    """Gives the recorded answers of an episode to each of its questions, in their order, and none to any other.

    Attributes:
      instruction: Own instruction that all was recorded with, or None.
    """

    def __init__(self, path: Path) -> None:
        """Reads the records.

        Raises:
          InputError: They cannot be read.
        """
        # Older records have no time: they stay in the order of their files.
        exchanges = sorted(read_exchanges(path), key=lambda each: each.at)
        self.name = f"replay of {exchanges[0].model}"
        self.parameters: dict[str, Any] = {"replay": path.name}
        instructions = {each.instruction for each in exchanges}
        self.instruction = (instructions.pop() or None) if len(instructions) == 1 else None
        self._exchanges = exchanges
        self._anywhere = _by_question(exchanges)
        self._episodes: dict[tuple[str, int], _Answers] = {
            key: _by_question(each) for key, each in _last_attempts(exchanges).items()
        }
        self._here: _Answers = {}
        self._given: Counter[str] = Counter()

    def begin(self, task: str, episode: int) -> None:
        """The questions of this episode come next: its own answers come before those of others."""
        self._here = self._episodes.get((task, episode), {})
        self._given.clear()

    def answer(self, messages: list[Message], schema: dict[str, Any]) -> Answer:
        """The recorded reply; to a question that was asked several times, one after the other, then the last.

        The schema follows from the messages, which name all that it names.

        Raises:
          NoReplyError: The question was not recorded, or had no reply then either.
        """
        asked = _question(messages)
        answers = self._here.get(asked) or self._anywhere.get(asked)
        if not answers:
            raise NoReplyError(self._why_not(messages))
        found = answers[min(self._given[asked], len(answers) - 1)]
        self._given[asked] += 1
        if found.error:
            raise NoReplyError(found.error)
        return Answer(found.reply, found.cut)

    def _why_not(self, messages: list[Message]) -> str:
        scene, _ = _parts_of(messages)
        for each in self._exchanges:
            recorded, instruction = _parts_of(each.messages)
            if scene and recorded == scene:
                return (
                    "this question is not among the recorded ones; the same scene was recorded with "
                    f"--instruction {instruction[:_LONGEST]!r}"
                )
        return "this question is not among the recorded ones"


def _last_attempts(exchanges: Iterable[Exchange]) -> dict[tuple[str, int], list[Exchange]]:
    """The exchanges of each episode that is known; of one that began anew, after an interruption, the last ones."""
    found: dict[tuple[str, int], list[Exchange]] = defaultdict(list)
    for each in exchanges:
        if each.episode is not None:
            if each.number == 0:
                found[each.task, each.episode].clear()
            found[each.task, each.episode].append(each)
    return found


def _by_question(exchanges: Iterable[Exchange]) -> _Answers:
    found: _Answers = defaultdict(list)
    for each in exchanges:
        found[_question(each.messages)].append(each)
    return found


def _question(messages: list[Message]) -> str:
    """What was asked, as text that is equal for equal questions."""
    return json.dumps(messages, sort_keys=True)


def _parts_of(messages: list[Message]) -> tuple[str, str]:
    """The scene and the instruction of a first question; empty where it is none."""
    content = messages[1].get("content") if len(messages) == 2 else None
    scene, _, instruction = (
        content.partition(INSTRUCTION) if isinstance(content, str) else ("",) * 3
    )
    return scene, instruction
