"""Recorded plans: what the baseline did in some episodes, as set-points of the arm."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from manipose_mj.demos.layout import RECORDED_MODE, find_sets, read_actions
from manipose_mj.demos.record import RecordConfig, record
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig

SEEDS = "seeds"


@dataclass(frozen=True)
class RecordedPlan:
    """Attributes: seed: of the episode; actions: joint angles and the opening, in every control step."""

    seed: int
    actions: Float[np.ndarray, "t 8"]


@dataclass(frozen=True)
class Plans:
    """Attributes: config: of the environment in which they were made; plans: which succeeded in it."""

    config: EnvConfig
    plans: tuple[RecordedPlan, ...]


def recorded_plans(
    task: str,
    source: str,
    count: int,
    *,
    seed: int = 1,
    objects: tuple[str, ...] | None = None,
    jobs: int = 1,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Plans:
    """Plans of the baseline with true poses, on objects for training.

    Args:
      task: `"domain/name"`.
      source: `"seeds"` records them now; otherwise a folder that `manipose demos record` wrote.
      count: How many; of a folder's, the first.
      seed: From which the episodes' own follow, where they are recorded now.
      objects: Likewise, what to draw from.
      jobs: Likewise, episodes at the same time.
      on_progress: Called with the number of plans recorded and that wanted.

    Raises:
      InputError: The folder holds no success of the task, or sets of it with other objects than each other's; or the
        baseline fails too often.
    """
    if count < 1:
        raise InputError(f"plans is {count}; expected at least 1")
    if source != SEEDS:
        return _read(task, Path(source), count)
    with tempfile.TemporaryDirectory(prefix="manipose-plans-") as folder:
        config = RecordConfig(task, Path(folder), count, seed, jobs=jobs, objects=objects)
        record(config, for_training=False, on_progress=on_progress)
        return _read(task, Path(folder), count)


def _read(task: str, folder: Path, count: int) -> Plans:
    found = [demos for demos in find_sets(folder) if demos.task == task]
    plans = [
        RecordedPlan(episode.episode_seed, read_actions(demos, episode))
        for demos in found
        for episode in demos.episodes
        if episode.success and episode.control_mode == RECORDED_MODE
    ]
    if not plans:
        raise InputError(
            f"{folder}: holds no successful recording of {task} in {RECORDED_MODE}; "
            "`manipose demos record` makes them, or take --plan-from seeds"
        )
    kwargs = found[0].env_kwargs
    for other in found[1:]:
        if any(other.env_kwargs[name] != kwargs[name] for name in ("objects", "split")):
            raise InputError(
                f"{folder}: {other.path} and {found[0].path} have other objects; give one of them"
            )
    config = EnvConfig(
        task,
        obs_mode="state",
        control_mode=RECORDED_MODE,
        objects=kwargs["objects"],
        split=kwargs["split"],
    )
    return Plans(config, tuple(plans[:count]))
