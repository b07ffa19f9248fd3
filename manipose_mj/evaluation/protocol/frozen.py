"""What a version of the protocol fixes, and its file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from manipose_mj.errors import InputError, unknown_name

# Episodes of a task in each version.
EPISODES = {"v1": 100, "v1-real": 50}
VERSIONS = tuple(EPISODES)


@dataclass(frozen=True)
class FrozenEpisode:
    """One evaluation episode.

    Attributes:
      seed: From which all that is random about it follows.
      object: Name of the rigid object that it shall be about; None leaves it to the seed.
      furniture: Name of the piece of furniture, likewise.
      part: Name of its drawer or door, likewise.
      objects: What the seed then draws: all objects of the scene, by name.
    """

    seed: int
    object: str | None
    furniture: str | None
    part: str | None
    objects: tuple[str, ...]

    @property
    def asked(self) -> dict[str, Any]:
        """The fields of its `EpisodeSpec`."""
        return {name: getattr(self, name) for name in ("seed", "object", "furniture", "part")}


@dataclass(frozen=True)
class FrozenTask:
    """What a protocol fixes about one task.

    Attributes:
      horizon: Time limit [s].
      tolerance: The fields of `Tolerance`, SI units and radians.
      settings: Digest of the whole configuration, ranges of places and the like.
      episodes: Evaluation episodes, by name: `"v1/single_object/target_pose/000"`.
      pool: Names of the user's assets that they are drawn from, in this order; none where these are built in.
    """

    horizon: float
    tolerance: Mapping[str, float]
    settings: str
    episodes: Mapping[str, FrozenEpisode]
    pool: tuple[str, ...] = ()

    @property
    def seeds(self) -> dict[str, int]:
        """The seeds of the episodes, by name."""
        return {name: episode.seed for name, episode in self.episodes.items()}

    @property
    def objects(self) -> tuple[str, ...]:
        """The names of all objects that the episodes use, sorted."""
        return tuple(sorted({name for each in self.episodes.values() for name in each.objects}))


@dataclass(frozen=True)
class Protocol:
    """A version.

    Attributes:
      version: Such as `"v1"`.
      sha256: Of everything else.
      tasks: By `"domain/name"`.
      sources: Data set of each asset that users build themselves, by its name; empty where all are built in.
    """

    version: str
    sha256: str
    tasks: Mapping[str, FrozenTask]
    sources: Mapping[str, str] = field(default_factory=dict)

    def task(self, name: str) -> FrozenTask:
        """The task's part.

        Raises:
          InputError: This version does not have the task.
        """
        if name not in self.tasks:
            raise unknown_name(f"task of protocol {self.version}", name, self.tasks)
        return self.tasks[name]

    def episode(self, task: str, number: int) -> FrozenEpisode:
        """One evaluation episode.

        Raises:
          InputError: This version does not have the task, or has fewer episodes.
        """
        episodes = list(self.task(task).episodes.values())
        if not 0 <= number < len(episodes):
            raise InputError(
                f"protocol {self.version} has {len(episodes)} episodes of {task}; there is no {number}"
            )
        return episodes[number]


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
            episodes={
                f"{version}/{name}/{i:03d}": read_episode(entry)
                for i, entry in enumerate(fields["episodes"])
            },
            pool=tuple(fields.get("pool", ())),
        )
        for name, fields in document["tasks"].items()
    }
    lists: Mapping[str, list[str]] = document.get("assets", {})
    sources = {name: data_set for data_set, names in lists.items() for name in names}
    return Protocol(version, document["sha256"], tasks, sources)


def read_episode(entry: Mapping[str, Any]) -> FrozenEpisode:
    """An episode from its entry in the file, where what is left to the seed is left out."""
    asked = {name: entry.get(name) for name in ("object", "furniture", "part")}
    return FrozenEpisode(seed=entry["seed"], **asked, objects=tuple(entry["objects"]))


def protocol_path(version: str) -> Path:
    """Where the version's file is."""
    return Path(__file__).with_name(f"{version}.json")


def digest(document: Mapping[str, Any]) -> str:
    """The sha256 of a protocol's content, whatever its layout."""
    content = {key: value for key, value in document.items() if key != "sha256"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def start_digest(task: FrozenTask, episode: FrozenEpisode) -> str:
    """Twelve digits that stand for all that a protocol says of one start, and change with any of it."""
    rules = {name: getattr(task, name) for name in ("horizon", "tolerance", "settings", "pool")}
    return digest({**rules, **asdict(episode)})[:12]


def evaluation_seed(version: str, task: str, index: int, draw: int = 0) -> int:
    """The seed that the name of an evaluation episode stands for: 32 bits of its sha256.

    Args:
      version: Of the protocol.
      task: Its full name.
      index: Of the episode.
      draw: How many seeds before were given up because nobody could solve their starts.
    """
    name = f"manipose_mj/{version}/{task}/{index:03d}" + (f"/{draw}" if draw else "")
    return int.from_bytes(hashlib.sha256(name.encode("utf-8")).digest()[:4], "big")
