"""One attempt at a demonstration: an episode of the baseline with all its actions and states."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from manipose_mj.demos.layout import (
    RECORDED_MODE,
    DemoArrays,
    DemoEpisode,
    DemoSet,
    reading,
    write_episode,
    writing,
)
from manipose_mj.evaluation.episode import Naming, environment_of, play
from manipose_mj.evaluation.records import EpisodeResult, write_atomically
from manipose_mj.evaluation.rollout import Rules
from manipose_mj.policies.baseline import BaselinePolicy
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.instructions.sentence import instruction


class TapedBaseline(BaselinePolicy):
    """The baseline, with what it did.

    Attributes: taken: its actions, one a control step.
    """

    def __init__(self) -> None:
        super().__init__("oracle")
        self.taken: list[np.ndarray] = []

    def infer(self, obs: Any) -> dict[str, Any]:
        answer = super().infer(obs)
        self.taken += [np.array(action) for action in answer["actions"]]
        return answer


class StateTape:
    """What an environment went through.

    Attributes:
      qpos, qvel: One row a control step, the start first.
      success: One a control step.
    """

    def __init__(self, environment: TaskEnvironment) -> None:
        self._environment = environment
        self._hash = hashlib.sha256()
        self.qpos: list[np.ndarray] = []
        self.qvel: list[np.ndarray] = []
        self.success: list[bool] = []

    def record(self, steps: int) -> None:
        """Keep the present state; `steps` control steps were taken."""
        data = self._environment.physics.data
        for rows, values in ((self.qpos, data.qpos), (self.qvel, data.qvel)):
            self._hash.update(np.ascontiguousarray(values).tobytes())
            rows.append(np.array(values, np.float32))
        if steps:
            self.success.append(bool(self._environment.task.success_now))

    @property
    def digest(self) -> str:
        """The sha256 of all states, in double precision."""
        return self._hash.hexdigest()


def attempt_file(folder: Path, number: int) -> Path:
    """Where an attempt's outcome is; its arrays are beside it."""
    return folder / f"{number:05d}.json"


def attempt(config: EnvConfig, seed: int, number: int, folder: Path, *, failures: bool) -> None:
    """Run an attempt and leave its files, the arrays first: where the outcome is, they are whole.

    Args:
      config: Of the environment.
      seed: Of the episode.
      number: Of the attempt.
      folder: For the files.
      failures: Whether arrays of a failure are kept too.

    Raises:
      InputError: The configuration cannot be.
    """
    environment, policy = environment_of(config), TapedBaseline()
    tape = StateTape(environment)
    naming = Naming(config.task, number, policy.pose_source, policy.mask_source)
    result, _ = play(
        environment, policy, EpisodeSpec(seed), Rules(), naming, after_step=tape.record
    )
    if result.success_at_end or failures:
        actions = np.array(policy.taken).reshape(-1, 8)[: result.steps]
        arrays = DemoArrays(
            actions,
            np.array(tape.qpos),
            np.array(tape.qvel),
            np.array(tape.success, bool),
            truncated=result.failure == "timeout",
        )
        with writing(attempt_file(folder, number).with_suffix(".h5")) as file:
            write_episode(file, number, arrays)
    episode = _described(result, number, instruction(environment.task), tape.digest)
    _write_outcome(episode, folder)


def copy_arrays(folder: Path, number: int, into: h5py.File, episode_id: int) -> None:
    """Add an attempt's arrays to a file, as those of an episode."""
    with h5py.File(attempt_file(folder, number).with_suffix(".h5"), "r") as file:
        file.copy(f"traj_{number}", into, name=f"traj_{episode_id}")


def split_off(demos: DemoSet, episode: DemoEpisode, folder: Path, number: int) -> None:
    """Make an episode of a set into the files that its attempt left, where they are not there already."""
    if attempt_file(folder, number).exists():
        return
    with (
        reading(demos.path) as file,
        writing(attempt_file(folder, number).with_suffix(".h5")) as own,
    ):
        file.copy(f"traj_{episode.episode_id}", own, name=f"traj_{number}")
    _write_outcome(replace(episode, episode_id=number), folder)


def _write_outcome(episode: DemoEpisode, folder: Path) -> None:
    text = json.dumps(asdict(episode), allow_nan=False)
    write_atomically(attempt_file(folder, episode.episode_id), text.encode())


def _described(result: EpisodeResult, number: int, sentence: str, state_sha256: str) -> DemoEpisode:
    return DemoEpisode(
        episode_id=number,
        episode_seed=result.seed,
        control_mode=RECORDED_MODE,
        elapsed_steps=result.steps,
        success=result.success_at_end,
        failure=result.failure,
        object=result.object,
        instruction=sentence,
        state_sha256=state_sha256,
        reset_kwargs={"seed": result.seed},
    )
