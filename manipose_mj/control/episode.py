"""One evaluation episode: reset, act, judge."""

from __future__ import annotations

import time
from functools import lru_cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from dm_control import composer

from asset_pipeline.asset_json import list_assets, read_asset
from asset_pipeline.assets import Asset
from asset_pipeline.catalogue import Split
from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.estimate_errors import EstimateErrors
from manipose_mj.control.failure import StageFailure
from manipose_mj.control.pose_sources import check_pose_source, sensors_for
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.evaluation.records import EpisodeResult, Trajectory
from manipose_mj.tasks.base import ManipulationTask

_RECORD_EVERY = 5  # control steps


def run_episode(
    task: str,
    *,
    episode: int,
    seed: int,
    pose: str = "oracle",
    assets: Path | None = None,
    object_name: str | None = None,
    split: Split = "train",
) -> tuple[EpisodeResult, Trajectory]:
    """Run the baseline for one episode; the same arguments give the same result bit for bit.

    Args:
      task: `"domain/task"`.
      episode: Index, copied into the result.
      seed: Of the start state and of the motion planner.
      pose: Where object poses come from: `"oracle"` or `"estimated"`.
      assets: Folder of built assets to take the object from.
      object_name: Which asset of that folder, or of the built-in catalogue.
      split: Which built-in objects, train or test.

    Raises:
      InputError: Something named does not exist or cannot be used.
    """
    check_pose_source(pose)
    started = time.perf_counter()
    environment, baseline = _environment(task, assets, object_name, split, pose)
    judge = _reset(environment, seed)
    estimates = EstimateErrors(judge, environment.physics, baseline)
    baseline.status = ""  # the generator below resets it too late for the first record
    recorder = _Recorder(environment, baseline)
    recorder.record()
    failure: StageFailure | None = None
    steps = 0
    try:
        for action in baseline.actions(seed):
            estimates.after_planning()
            last = environment.step(action).last()
            steps += 1
            recorder.after_step(steps)
            if last:
                failure = StageFailure("timeout", f"not done after {judge.config.horizon:.0f} s")
                if environment.failure:
                    failure = StageFailure("physics", environment.failure_reason)
                break
    except StageFailure as gave_up:
        estimates.after_planning()
        failure = gave_up
    physics = environment.physics
    success = judge.succeeded(physics) and (failure is None or failure.stage != "physics")
    if failure is None and not success:
        failure = StageFailure("release", "the goal is not met though the plan was carried out")
    if failure is not None and not success:
        failure = estimates.cause(failure)
    recorder.record()
    error = judge.goal_error(physics)
    result = EpisodeResult(
        task=task,
        episode=episode,
        seed=seed,
        object=judge.object_name,
        pose_source=pose,
        success_once=judge.success_once,
        success_at_end=success,
        failure=None if success or failure is None else failure.stage,
        reason="" if success or failure is None else failure.reason,
        translation_error=None if error is None else error[0],
        rotation_error=None if error is None else error[1],
        steps=steps,
        sim_time=round(steps * judge.control_timestep, 6),
        max_penetration=judge.max_penetration,
        wall_s=time.perf_counter() - started,
        estimate_translation_error=estimates.translation,
        estimate_rotation_error=estimates.rotation,
    )
    return result, recorder.trajectory()


def start_state(
    task: str,
    *,
    seed: int,
    assets: Path | None = None,
    object_name: str | None = None,
    split: Split = "train",
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model and the state in which the episode of this seed starts; arguments as for an episode."""
    environment, _ = _environment(task, assets, object_name, split, "oracle")
    _reset(environment, seed)
    return environment.physics.model.ptr, environment.physics.data.ptr


def scene_model(task: str, *, seed: int, **options: Any) -> mujoco.MjModel:
    """The model with everything where the episode of this seed has it, to draw a trajectory in."""
    return start_state(task, seed=seed, **options)[0]


class _Recorder:
    def __init__(self, environment: composer.Environment, baseline: Baseline) -> None:
        self._data = environment.physics.data
        self._baseline = baseline
        self._times: list[float] = []
        self._positions: list[np.ndarray] = []
        self._annotations: list[str] = []

    def after_step(self, steps: int) -> None:
        if steps % _RECORD_EVERY == 0:
            self.record()

    def record(self) -> None:
        self._times.append(float(self._data.time))
        self._positions.append(np.array(self._data.qpos, np.float32))
        self._annotations.append(self._baseline.status)

    def trajectory(self) -> Trajectory:
        return Trajectory(np.array(self._times), np.stack(self._positions), self._annotations)


def _reset(environment: composer.Environment, seed: int) -> ManipulationTask:
    environment.random_state.seed(seed)
    environment.reset()
    assert isinstance(environment.task, ManipulationTask)
    return environment.task


def load_environment(
    task: str,
    *,
    assets: Path | None = None,
    object_name: str | None = None,
    split: Split = "train",
    pose: str = "oracle",
) -> composer.Environment:
    """The environment in which episodes take place; arguments as for an episode."""
    domain, _, name = task.partition("/")
    objects = _objects(assets, object_name)
    return suite.load(
        domain,
        name,
        seed=0,
        observations="state",
        sensors=sensors_for(pose),
        objects=objects,
        split=split,
    )


@lru_cache(maxsize=4)
def _environment(
    task: str, assets: Path | None, object_name: str | None, split: Split, pose: str
) -> tuple[composer.Environment, Baseline]:
    """Compiled once per process and scene."""
    environment = load_environment(
        task, assets=assets, object_name=object_name, split=split, pose=pose
    )
    environment.reset()
    return environment, Baseline(environment, pose)


def _objects(assets: Path | None, object_name: str | None) -> tuple[Asset, ...] | None:
    if assets is None:
        if object_name is None:
            return None
        from asset_pipeline import catalogue

        return (catalogue.load_by_name(object_name),)
    folders = {folder.name: folder for folder in list_assets(assets)}
    if object_name is None:
        raise InputError(f"--assets {assets}: name one of its objects with --object")
    if object_name not in folders:
        raise unknown_name("object", object_name, folders)
    return (read_asset(folders[object_name]),)
