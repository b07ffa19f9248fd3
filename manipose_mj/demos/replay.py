"""Replays demonstrations: to see that they repeat, and to add observations or change their control mode."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from manipose_mj.demos.layout import (
    RECORDED_HZ,
    RECORDED_MODE,
    DemoArrays,
    DemoEpisode,
    DemoSet,
    current_versions,
    read_actions,
    read_set,
    reading,
    task_folder,
    trajectory_name,
    write_description,
    write_episode,
    writing,
)
from manipose_mj.errors import InputError, worker_deaths
from manipose_mj.storage.staging import clear_staging, made_for_result, staging

if TYPE_CHECKING:
    import h5py

    from manipose_mj.tasks.core.config import EnvConfig


@dataclass(frozen=True)
class Replayed:
    """What became of a demonstration.

    Attributes:
      episode: As it was recorded.
      success: Whether the goal was met at the end again.
      identical: Whether all states were those of the recording, bit for bit.
      now: As it is in the new file; None where none is written, or the goal was not met.
    """

    episode: DemoEpisode
    success: bool
    identical: bool
    now: DemoEpisode | None = None


@dataclass(frozen=True)
class ReplayConfig:
    """How to replay.

    Attributes:
      obs_mode: Modes and keys of observations to add, joined by `+`; empty: none.
      control_mode: To convert actions into.
      out: Folder for the new files; None: replay only.
      jobs: Episodes at the same time.
    """

    obs_mode: str = ""
    control_mode: str = RECORDED_MODE
    out: Path | None = None
    jobs: int = 1

    def __post_init__(self) -> None:
        if self.jobs < 1:
            raise InputError(f"jobs is {self.jobs}; expected at least 1")
        changes = self.obs_mode or self.control_mode != RECORDED_MODE
        if changes and self.out is None:
            raise InputError("observations or another control mode need --out for the new files")
        if self.control_mode == "primitive":
            raise InputError(
                "control mode primitive: joint targets cannot be made into whole motions"
            )
        if self.out is not None and not changes:
            raise InputError("--out needs --obs-mode or --control-mode: else nothing is new")

    def path(self, demos: DemoSet) -> Path | None:
        """Of the new HDF5 file of a set; None where none is written."""
        if self.out is None:
            return None
        name = trajectory_name(self.obs_mode, self.control_mode)
        return task_folder(self.out, demos.task) / f"{name}.h5"

    def env_config(self, demos: DemoSet) -> EnvConfig:
        """The environment of a set's episodes, which sees what is asked for.

        Raises:
          InputError: There is no such mode.
        """
        from manipose_mj.gym.features import feature_sensors
        from manipose_mj.tasks.core.config import EnvConfig  # loads the simulator: workers only

        obs_mode = self.obs_mode or "state"
        objects = demos.env_kwargs["objects"]
        return EnvConfig(
            demos.task,
            obs_mode=obs_mode,
            control_mode=self.control_mode,
            objects=None if objects is None else tuple(objects),
            split=demos.env_kwargs["split"],
            sensors=feature_sensors(obs_mode),
        )


def _ignore(done: int, total: int) -> None: ...


def replay(
    demos: DemoSet,
    config: ReplayConfig,
    before: DemoSet | None = None,
    *,
    on_progress: Callable[[int, int], None] = _ignore,
) -> list[Replayed]:
    """Replay the episodes of a set; where there is a place for it, write those that succeed into a new one.

    Args:
      demos: Recorded in `pd_joint_pos`.
      config: How.
      before: An earlier replay of the set, as `replayed_before` gives it; what it lacks is added to it.
      on_progress: Called with the number of episodes that have ended, and of those to be replayed.

    Raises:
      InputError: Modes that do not exist, demonstrations of another control mode, or a file there already.
    """
    config.env_config(demos)  # misspelt modes
    if any(each.control_mode != RECORDED_MODE for each in demos.episodes):
        raise InputError(f"{demos.path}: is a replay already; give the file that was recorded")
    path = config.path(demos)
    if path is None:
        return _all(demos, config, None, on_progress)
    if path.exists() and before is None:
        raise InputError(f"{path}: is there already; add --resume or choose another --out")
    clear_staging(path.parent)
    with made_for_result(path.parent), staging(path.parent / "replay") as parts:
        first = 0 if before is None else before.replayed
        results = _all(replace(demos, episodes=demos.episodes[first:]), config, parts, on_progress)
        kept = [each.now for each in results if each.now is not None]
        known = () if before is None else before.episodes
        env_kwargs = {
            **demos.env_kwargs,
            "obs_mode": config.obs_mode or "none",
            "control_mode": config.control_mode,
        }
        new = replace(
            demos,
            path=path,
            env_kwargs=env_kwargs,
            versions=current_versions(),
            episodes=(*known, *kept),
            replayed=len(demos.episodes),
        )
        # Of what is not described nothing is read, and arrays alone are no set.
        if before is None:
            write_description(new)
            _join(parts, path, kept)
        else:
            _join(parts, path, kept, before)
            write_description(new)
    return results


def replayed_before(demos: DemoSet, config: ReplayConfig) -> DemoSet | None:
    """What an earlier replay of a set left, whole as far as the set went then; None where there was none.

    Raises:
      InputError: It is broken, or of another set, or its episodes were replayed with other versions than these.
    """
    path = config.path(demos)
    if path is None or not path.exists():
        return None
    before = read_set(path)
    seeds = {each.episode_id: each.episode_seed for each in demos.episodes}
    same = before.env_kwargs["objects"] == demos.env_kwargs["objects"]
    ours = all(seeds.get(each.episode_id) == each.episode_seed for each in before.episodes)
    if not same or not ours or before.replayed is None:
        raise InputError(f"{path}: is of other demonstrations; choose another --out")
    if before.replayed < len(demos.episodes) and before.versions != current_versions():
        raise InputError(f"{path}: was made with other versions; choose another --out for more")
    return before


def _join(
    parts: Path, path: Path, episodes: Sequence[DemoEpisode], before: DemoSet | None = None
) -> None:
    """One file of all parts, after the episodes of a set that was there before."""
    import h5py

    with writing(path) as file:
        if before is not None:
            with reading(before.path) as old:
                for episode in before.episodes:
                    old.copy(f"traj_{episode.episode_id}", file)
        for episode in episodes:
            name = f"traj_{episode.episode_id}"
            with h5py.File(parts / f"{name}.h5", "r") as part:
                part.copy(name, file, name=name)
            (parts / f"{name}.h5").unlink()


def _all(
    demos: DemoSet,
    config: ReplayConfig,
    parts: Path | None,
    on_progress: Callable[[int, int], None],
) -> list[Replayed]:
    ended = []
    for each in _run(demos, config, parts):
        ended.append(each)
        on_progress(len(ended), len(demos.episodes))
    return sorted(ended, key=lambda each: each.episode.episode_id)


def _run(demos: DemoSet, config: ReplayConfig, parts: Path | None) -> Iterator[Replayed]:
    if config.jobs == 1 or len(demos.episodes) < 2:
        for episode in demos.episodes:
            yield replay_one(demos, episode, config, parts)
        return
    import joblib

    with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
        options: Any = {"return_as": "generator_unordered", "batch_size": 1}
        pool: Any = joblib.Parallel(n_jobs=config.jobs, **options)
        calls = (joblib.delayed(replay_one)(demos, e, config, parts) for e in demos.episodes)
        outcomes = pool(calls)
    with worker_deaths("nothing of this set is kept: repeat the command"):
        yield from outcomes


def replay_one(
    demos: DemoSet, episode: DemoEpisode, config: ReplayConfig, parts: Path | None
) -> Replayed:
    """Replay an episode; leave the new one in the folder `parts`, if there is one and the goal was met.

    Raises:
      InputError: The file is broken, or the control mode cannot do what was recorded.
    """
    from manipose_mj.control.conversion.convert import convert
    from manipose_mj.control.conversion.recording import Recording
    from manipose_mj.evaluation.episode import environment_of

    actions = read_actions(demos, episode)
    environment = environment_of(config.env_config(demos))
    if config.control_mode != episode.control_mode:
        recording = Recording(episode.control_mode, episode.episode_seed, actions, episode.success)
        actions = convert(environment, recording, config.control_mode).actions
    part = None if parts is None else parts / f"traj_{episode.episode_id}.h5"
    with nullcontext() if part is None else writing(part) as file:
        group = None
        if file is not None and config.obs_mode:
            group = file.create_group(f"traj_{episode.episode_id}/obs")
        arrays, success, digest = run_actions(environment, episode.episode_seed, actions, group)
        if file is not None:
            write_episode(file, episode.episode_id, arrays)
    identical = digest == episode.state_sha256
    if part is None or not success:
        if part is not None:
            part.unlink()
        return Replayed(episode, success, identical)
    now = replace(
        episode,
        control_mode=config.control_mode,
        elapsed_steps=len(arrays.actions),
        success=True,
        failure=None,
        state_sha256=digest,
    )
    return Replayed(episode, success, identical, now)


def run_actions(
    environment: Any, seed: int, actions: Float[np.ndarray, "t n"], group: h5py.Group | None = None
) -> tuple[DemoArrays, bool, str]:
    """Carry out actions, one a control step.

    Args:
      environment: Of the task.
      seed: Of the episode.
      actions: Of the environment's control mode.
      group: Where to write the features of all steps; None: nowhere.

    Returns:
      What happened, whether the goal is met at the end, and the sha256 of all states.
    """
    from manipose_mj.demos.attempts import StateTape
    from manipose_mj.demos.observation_tape import ObservationTape
    from manipose_mj.evaluation.rollout import Rollout, Rules
    from manipose_mj.gym.features import Features
    from manipose_mj.tasks.core.config import EpisodeSpec

    step = environment.reset(EpisodeSpec(seed))
    tape, features = StateTape(environment), Features(environment)
    tape.record(0)
    observations = None if group is None else ObservationTape(group)
    policy = SteppedPolicy(actions, observations.append if observations else _unseen)
    rollout = Rollout(
        environment,
        policy,
        Rules(RECORDED_HZ),
        observe=features.read if observations else lambda observation: {},
        after_step=tape.record,
    )
    outcome = rollout.run(step)
    if observations:
        observations.flush()
    timeout = outcome.failure is not None and outcome.failure.stage == "timeout"
    arrays = DemoArrays(
        actions[: outcome.steps],
        np.array(tape.qpos),
        np.array(tape.qvel),
        np.array(tape.success, bool),
        timeout,
    )
    return arrays, bool(environment.task.succeeded(environment.physics)), tape.digest


def _unseen(observation: Mapping[str, Any]) -> None: ...


class SteppedPolicy:
    """Answers with one action after the other, and passes on what it is shown."""

    def __init__(
        self,
        actions: Float[np.ndarray, "t n"],
        show: Callable[[Mapping[str, Any]], None] = _unseen,
    ) -> None:
        """Keeps the actions.

        Args:
          actions: `(t, n)`.
          show: Called with every observation: one for each action and, as it is asked once more, one of the end.
        """
        self._actions, self._asked, self._show = actions, 0, show

    def reset(self, **episode: Any) -> None:
        """Nothing to do: an episode has a policy of its own."""

    def infer(self, obs: Mapping[str, Any]) -> dict[str, Any]:
        """The next action; done after the last."""
        self._show(obs)
        chosen = self._actions[self._asked : self._asked + 1]
        self._asked += 1
        return {"actions": chosen, "done": len(chosen) == 0}


def lost(results: Sequence[Replayed]) -> int:
    """Recorded successes that are none now."""
    return sum(each.episode.success and not each.success for each in results)


def differing_versions(demos: DemoSet) -> list[str]:
    """Packages whose version is another than when the set was recorded, such as `numpy 2.3 -> 2.4`."""
    now = current_versions()
    return [
        f"{name} {before} -> {now.get(name, 'none')}"
        for name, before in demos.versions.items()
        if now.get(name) != before
    ]
