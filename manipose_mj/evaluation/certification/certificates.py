"""Certificates of a protocol's starts: how the baseline solves each, given true poses; loads no simulator.

A start is certified when a motion planner's seed and a number of plans are known with which the baseline meets the
goal within the time limit. Whoever fails there fails at something that can be done.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from manipose_mj.errors import InputError
from manipose_mj.evaluation.protocol.frozen import Protocol
from manipose_mj.evaluation.records import write_atomically

Key = tuple[str, int]  # a task's full name, and the number of the episode


@dataclass(frozen=True)
class Certificate:
    """How a start is solved.

    Attributes:
      planner_seed: Of the motion planner.
      plans: How many the baseline may try.
    """

    planner_seed: int
    plans: int


@dataclass(frozen=True)
class Certificates:
    """What is known of a protocol's starts.

    Attributes:
      protocol: The sha256 of the protocol that they are of.
      solved: By task and episode.
      unsolved: Of starts that no attempt solved: stage and reason of the last.
    """

    protocol: str
    solved: Mapping[Key, Certificate] = field(default_factory=dict)
    unsolved: Mapping[Key, str] = field(default_factory=dict)

    def with_outcome(self, key: Key, outcome: Certificate | str) -> Certificates:
        """These and what an attempt at one more start came to."""
        solved = {each: value for each, value in self.solved.items() if each != key}
        unsolved = {each: value for each, value in self.unsolved.items() if each != key}
        if isinstance(outcome, str):
            return Certificates(self.protocol, solved, {**unsolved, key: outcome})
        return Certificates(self.protocol, {**solved, key: outcome}, unsolved)


def certificates_path(version: str) -> Path:
    """Where a version's certificates are."""
    return Path(__file__).with_name(f"{version}.json")


def load_certificates(protocol: Protocol, path: Path | None = None) -> Certificates:
    """The certificates of a protocol's starts; none where there is no file.

    Args:
      protocol: The protocol.
      path: Of the file; by default the one of this package.

    Raises:
      InputError: The file is no such file, or of another protocol.
    """
    path = certificates_path(protocol.version) if path is None else path
    if not path.exists():
        return Certificates(protocol.sha256)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        known = Certificates(
            document["protocol"],
            {
                (task, int(episode)): Certificate(**fields)
                for task, episodes in document["solved"].items()
                for episode, fields in episodes.items()
            },
            {
                (task, int(episode)): reason
                for task, episodes in document["unsolved"].items()
                for episode, reason in episodes.items()
            },
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not a file of certificates ({error})") from None
    if known.protocol != protocol.sha256:
        raise InputError(
            f"{path}: of a protocol with sha256 {known.protocol}, not of {protocol.version} with {protocol.sha256}"
        )
    return known


def save_certificates(known: Certificates, path: Path) -> None:
    """Write the file whole; a task a section, an episode a line, in order."""
    lines = [f'{{\n "protocol": {json.dumps(known.protocol)},\n "solved": {{']
    lines += _sections({key: vars(each) for key, each in known.solved.items()})
    lines += [' },\n "unsolved": {']
    lines += _sections(known.unsolved)
    lines += [" }\n}\n"]
    write_atomically(path, "\n".join(lines).encode("utf-8"))


def _sections(entries: Mapping[Key, Any]) -> list[str]:
    tasks = sorted({task for task, _ in entries})
    sections = []
    for task in tasks:
        episodes = sorted(number for name, number in entries if name == task)
        body = ",\n".join(f'   "{i:03d}": {json.dumps(entries[task, i])}' for i in episodes)
        sections.append(f"  {json.dumps(task)}: {{\n{body}\n  }}")
    return [",\n".join(sections)] if sections else []
