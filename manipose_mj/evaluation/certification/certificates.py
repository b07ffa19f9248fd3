"""Certificates of a protocol's starts: how the baseline solves each, given true poses; loads no simulator.

A start is certified when a motion planner's seed and a number of plans are known with which the baseline meets the
goal within the time limit. Whoever fails there fails at something that can be done.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from manipose_mj.errors import InputError, brief
from manipose_mj.evaluation.protocol.frozen import Protocol, start_digest
from manipose_mj.evaluation.records import write_atomically

T = TypeVar("T")
Key = tuple[str, int]  # a task's full name, and the number of the episode
_FIELDS = ("version", "solved", "unsolved", "refused")  # of a file


@dataclass(frozen=True)
class Certificate:
    """How a start is solved.

    Attributes:
      planner_seed: Of the motion planner.
      plans: The baseline's budget, as of `Baseline.actions`.
    """

    planner_seed: int
    plans: int


@dataclass(frozen=True)
class Certificates:
    """What is known of a protocol's starts.

    Attributes:
      version: Of the protocol.
      solved: By task and episode.
      unsolved: Of starts that no attempt solved: stage and reason of the last.
      refused: Reasons of the starts that were drawn before in an episode's place, and that nobody solved.
      lapsed: Starts of which the protocol says something else than when they were certified.
    """

    version: str
    solved: Mapping[Key, Certificate] = field(default_factory=dict)
    unsolved: Mapping[Key, str] = field(default_factory=dict)
    refused: Mapping[Key, tuple[str, ...]] = field(default_factory=dict)
    lapsed: frozenset[Key] = frozenset()

    def with_outcome(self, key: Key, outcome: Certificate | str) -> Certificates:
        """These and what an attempt at one more start came to."""
        solved = {each: value for each, value in self.solved.items() if each != key}
        unsolved = {each: value for each, value in self.unsolved.items() if each != key}
        if isinstance(outcome, str):
            unsolved[key] = outcome
        else:
            solved[key] = outcome
        return replace(self, solved=solved, unsolved=unsolved, lapsed=self.lapsed - {key})


def certificates_path(version: str) -> Path:
    """Where a version's certificates are."""
    return Path(__file__).with_name(f"{version}.json")


def load_certificates(protocol: Protocol, path: Path | None = None) -> Certificates:
    """The certificates of a protocol's starts; none where there is no file.

    Of starts that the protocol has no more they are left out: it may have been frozen anew since. Those whose episodes
    it still has are told as lapsed.

    Args:
      protocol: The protocol.
      path: Of the file; by default the one of this package.

    Raises:
      InputError: The file is no such file, or of another version.
    """
    path = certificates_path(protocol.version) if path is None else path
    if not path.exists():
        return Certificates(protocol.version)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise InputError(f"{path}: not a file of certificates; no JSON ({error})") from None
    try:
        version = _version(document)
        certificates = _entries(
            document, "solved", '{"start", "planner_seed", "plans"}', _start_and_certificate
        )
        unsolved = _entries(document, "unsolved", '{"start", "reason"}', _start_and_reason)
        refused = _entries(document, "refused", "a list of reasons", _reasons)
    except InputError as error:
        raise InputError(f"{path}: not a file of certificates; {error}") from None
    if version != protocol.version:
        raise InputError(f"{path}: of protocol {version}, not of {protocol.version}")
    starts = _start_digests(protocol)
    return Certificates(
        version,
        {key: each for key, (start, each) in certificates.items() if starts.get(key) == start},
        {key: reason for key, (start, reason) in unsolved.items() if starts.get(key) == start},
        {key: reasons for key, reasons in refused.items() if key in starts},
        frozenset(k for k, (start, _) in certificates.items() if starts.get(k, start) != start),
    )


def save_certificates(known: Certificates, protocol: Protocol, path: Path) -> None:
    """Write the file whole; a task a section, an episode a line, in order.

    Args:
      known: What to write.
      protocol: Of which it is: each line says of which start it speaks.
      path: Of the file.
    """
    starts = _start_digests(protocol)
    tables = {
        "solved": {k: {"start": starts[k], **vars(each)} for k, each in known.solved.items()},
        "unsolved": {k: {"start": starts[k], "reason": r} for k, r in known.unsolved.items()},
        "refused": known.refused,
    }
    text = ",\n".join(f' "{name}": {{\n{_sections(table)} }}' for name, table in tables.items())
    head = f'{{\n "version": {json.dumps(known.version)},\n'
    write_atomically(path, f"{head}{text}\n}}\n".encode())


def causes(known: Certificates) -> Counter[tuple[str, str]]:
    """How many starts nobody solved, those that were drawn again too, by task and stage of the failure."""
    reasons = [(task, reason) for (task, _), reason in known.unsolved.items()]
    reasons += [(task, each) for (task, _), given in known.refused.items() for each in given]
    return Counter((task, reason.partition(":")[0]) for task, reason in reasons)


def _version(document: Any) -> str:
    if not isinstance(document, dict):
        raise InputError(f"it is {brief(document)}; expected {', '.join(map(repr, _FIELDS))}")
    for name in _FIELDS:
        if name not in document:
            raise InputError(f"it has no {name!r}; expected {', '.join(map(repr, _FIELDS))}")
    return document["version"]


def _entries(document: Any, table: str, form: str, read: Callable[[Any], T]) -> dict[Key, T]:
    found: dict[Key, T] = {}
    sections = document[table]
    if not isinstance(sections, dict):
        raise InputError(f"{table!r} is {brief(sections)}; expected tasks with their episodes")
    for task, entries in sections.items():
        if not isinstance(entries, dict) or not all(map(str.isdecimal, entries)):
            raise InputError(
                f"{table!r}, {task!r} is {brief(entries)}; expected episodes by number"
            )
        for number, entry in entries.items():
            try:
                found[task, int(number)] = read(entry)
            except (KeyError, TypeError):
                raise InputError(
                    f"{table!r}, {task!r}, {number!r} is {brief(entry)}; expected {form}"
                ) from None
    return found


def _start_and_certificate(entry: Any) -> tuple[str, Certificate]:
    return entry["start"], Certificate(entry["planner_seed"], entry["plans"])


def _start_and_reason(entry: Any) -> tuple[str, str]:
    return entry["start"], entry["reason"]


def _reasons(entry: Any) -> tuple[str, ...]:
    if not isinstance(entry, list):
        raise TypeError
    return tuple(entry)


def _start_digests(protocol: Protocol) -> dict[Key, str]:
    return {
        (name, i): start_digest(task, episode)
        for name, task in protocol.tasks.items()
        for i, episode in enumerate(task.episodes.values())
    }


def _sections(entries: Mapping[Key, Any]) -> str:
    sections = []
    for task in sorted({task for task, _ in entries}):
        episodes = sorted(number for name, number in entries if name == task)
        body = ",\n".join(f'   "{i:03d}": {json.dumps(entries[task, i])}' for i in episodes)
        sections.append(f"  {json.dumps(task)}: {{\n{body}\n  }}")
    return ",\n".join(sections) + "\n" if sections else ""
