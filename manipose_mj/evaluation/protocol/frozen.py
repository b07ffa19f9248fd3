"""What a version of the protocol fixes, and its file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from manipose_mj.errors import InputError, unknown_name

VERSIONS = ("v1",)
EPISODES = 100


@dataclass(frozen=True)
class FrozenTask:
    """What a protocol fixes about one task.

    Attributes:
      horizon: Time limit [s].
      tolerance: The fields of `Tolerance`, SI units and radians.
      settings: Digest of the whole configuration, ranges of places and the like.
      train_objects: Names of the built-in assets for training.
      test_objects: Those for evaluation; the two have nothing in common.
      seeds: 100 evaluation episodes, by name: `"v1/single_object/target_pose/000"`.
    """

    horizon: float
    tolerance: Mapping[str, float]
    settings: str
    train_objects: tuple[str, ...]
    test_objects: tuple[str, ...]
    seeds: Mapping[str, int]


@dataclass(frozen=True)
class Protocol:
    """Attributes: version: such as `"v1"`; sha256: of everything else; tasks: by `"domain/name"`."""

    version: str
    sha256: str
    tasks: Mapping[str, FrozenTask]

    def task(self, name: str) -> FrozenTask:
        """The task's part.

        Raises:
          InputError: This version does not have the task.
        """
        if name not in self.tasks:
            raise unknown_name(f"task of protocol {self.version}", name, self.tasks)
        return self.tasks[name]

    def seed(self, task: str, episode: int) -> int:
        """The seed of one evaluation episode.

        Raises:
          InputError: This version does not have the task, or has fewer episodes.
        """
        seeds = list(self.task(task).seeds.values())
        if not 0 <= episode < len(seeds):
            raise InputError(
                f"protocol {self.version} has {len(seeds)} episodes of {task}; there is no {episode}"
            )
        return seeds[episode]


@cache
def load(version: str) -> Protocol:
    """A version of the protocol; loads no simulator.

    Raises:
      InputError: There is no such version, or its file was edited.
    """
    if version not in VERSIONS:
        raise unknown_name("protocol", version, VERSIONS)
    path = protocol_path(version)
    document = json.loads(path.read_text(encoding="utf-8"))
    if document["sha256"] != digest(document):
        raise InputError(
            f"{path}: its content does not have the sha256 it states; a protocol is never edited: "
            "a change is a new version"
        )
    tasks = {
        name: FrozenTask(
            horizon=fields["horizon"],
            tolerance=fields["tolerance"],
            settings=fields["settings"],
            train_objects=tuple(fields["train_objects"]),
            test_objects=tuple(fields["test_objects"]),
            seeds={f"{version}/{name}/{i:03d}": seed for i, seed in enumerate(fields["seeds"])},
        )
        for name, fields in document["tasks"].items()
    }
    return Protocol(version, document["sha256"], tasks)


def protocol_path(version: str) -> Path:
    """Where the version's file is."""
    return Path(__file__).with_name(f"{version}.json")


def digest(document: Mapping[str, Any]) -> str:
    """The sha256 of a protocol's content, whatever its layout."""
    content = {key: value for key, value in document.items() if key != "sha256"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def evaluation_seed(version: str, task: str, index: int) -> int:
    """The seed that the name of an evaluation episode stands for: 32 bits of its sha256."""
    name = f"manipose_mj/{version}/{task}/{index:03d}"
    return int.from_bytes(hashlib.sha256(name.encode("utf-8")).digest()[:4], "big")
