"""What an evaluation runs, and the seed of each of its episodes."""

from __future__ import annotations

import hashlib
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.errors import InputError


@dataclass(frozen=True)
class EvaluationConfig:
    """An evaluation's input; with the versions, it determines every result but the times.

    Attributes:
      tasks: `"domain/task"` names.
      out: Folder for the results.
      episodes: Number per task.
      seed: Base seed, from which every episode's own seed follows.
      pose: Where the baseline takes object poses from.
      jobs: Episodes that run at the same time, each on one core. Results do not depend on it.
      assets: Folder of built assets; None takes the built-in objects.
      object_name: The one object to manipulate; None lets the task choose.
    """

    tasks: tuple[str, ...]
    out: Path
    episodes: int = 50
    seed: int = 0
    pose: str = "oracle"
    jobs: int = 1
    assets: Path | None = None
    object_name: str | None = None

    def __post_init__(self) -> None:
        if not self.tasks:
            raise InputError("no task given; `manipose list` names them")
        if len(set(self.tasks)) < len(self.tasks):
            raise InputError(f"a task is given twice: {' '.join(self.tasks)}")
        for name, least in (("episodes", 1), ("seed", 0), ("jobs", 1)):
            if getattr(self, name) < least:
                raise InputError(f"{name} is {getattr(self, name)}; expected at least {least}")

    @property
    def identity(self) -> dict[str, Any]:
        """What two runs must share for their results to belong together."""
        return {
            "tasks": sorted(self.tasks),
            "episodes": self.episodes,
            "seed": self.seed,
            "pose": self.pose,
            "assets": None if self.assets is None else str(self.assets.resolve()),
            "object": self.object_name,
        }

    @property
    def command(self) -> str:
        """The command line that repeats this evaluation."""
        words = ["manipose", "evaluate", *self.tasks]
        words += ["--episodes", str(self.episodes), "--seed", str(self.seed), "--pose", self.pose]
        words += ["--jobs", str(self.jobs), "--out", str(self.out)]
        if self.assets is not None:
            words += ["--assets", str(self.assets)]
        if self.object_name is not None:
            words += ["--object", self.object_name]
        return shlex.join(words)


def episode_seed(seed: int, task: str, episode: int) -> int:
    """The seed of one episode: a 32-bit number, whatever else runs and in whatever order.

    Args:
      seed: Base seed of the evaluation.
      task: `"domain/task"`.
      episode: Index within the evaluation.
    """
    # `hash` differs between processes.
    name = int.from_bytes(hashlib.sha256(task.encode()).digest()[:8], "big")
    return int(np.random.SeedSequence([seed, name, episode]).generate_state(1)[0])
