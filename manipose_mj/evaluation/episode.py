"""One evaluation episode: reset, act, task."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np
from dm_control import composer

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.perception.pose_sources import check_pose_source
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation.estimate_errors import EstimateErrors
from manipose_mj.evaluation.records import EpisodeResult, Trajectory
from manipose_mj.failures import StageFailure
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.environment import TaskEnvironment

_RECORD_EVERY = 5  # control steps


def run_episode(
    config: EnvConfig,
    spec: EpisodeSpec,
    *,
    episode: int = 0,
    pose: str = "oracle",
    estimator: EstimatorSettings | None = None,
) -> tuple[EpisodeResult, Trajectory]:
    """Run the baseline for one episode; the same arguments give the same result bit for bit.

    Args:
      config: Of the environment, which is compiled once per process and configuration; objects by name or
        by folder.
      spec: Of the episode; its seed is the motion planner's too.
      episode: Index, copied into the result.
      pose: Where object poses come from: `"oracle"` or `"estimated"`.
      estimator: Whose estimates they are; None: those of the package's weights.

    Raises:
      InputError: Something named does not exist or cannot be used.
      ServerLostError: The estimator's server went away.
    """
    check_pose_source(pose)
    started = time.perf_counter()
    seed = spec.seed or 0
    environment, baseline = _environment(config, pose, estimator)
    environment.reset(replace(spec, seed=seed))
    task = environment.task
    estimates = EstimateErrors(task, environment.physics, baseline)
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
                failure = StageFailure("timeout", f"not done after {task.config.horizon:.0f} s")
                if environment.failure:
                    failure = StageFailure("physics", environment.failure_reason)
                break
    except StageFailure as gave_up:
        estimates.after_planning()
        failure = gave_up
    physics = environment.physics
    success = task.succeeded(physics) and (failure is None or failure.stage != "physics")
    if failure is None and not success:
        failure = StageFailure("release", "the goal is not met though the plan was carried out")
    if failure is not None and not success:
        failure = estimates.cause(failure)
    recorder.record()
    error = task.goal_error(physics)
    result = EpisodeResult(
        task=config.task,
        episode=episode,
        seed=seed,
        object=task.object_name,
        pose_source=pose,
        success_once=task.success_once,
        success_at_end=success,
        failure=None if success or failure is None else failure.stage,
        reason="" if success or failure is None else failure.reason,
        translation_error=None if error is None else error[0],
        rotation_error=None if error is None else error[1],
        steps=steps,
        sim_time=round(steps * task.control_timestep, 6),
        max_penetration=task.max_penetration,
        wall_s=time.perf_counter() - started,
        estimate_translation_error=estimates.translation,
        estimate_rotation_error=estimates.rotation,
    )
    return result, recorder.trajectory()


def start_state(config: EnvConfig, spec: EpisodeSpec) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model and the state in which an episode starts; arguments as for an episode."""
    environment, _ = _environment(config, "oracle")
    environment.reset(spec)
    return environment.physics.model.ptr, environment.physics.data.ptr


def scene_model(config: EnvConfig, spec: EpisodeSpec) -> mujoco.MjModel:
    """The model with everything where an episode has it, to draw a trajectory in."""
    return start_state(config, spec)[0]


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


@lru_cache(maxsize=4)
def _environment(
    config: EnvConfig, pose: str, estimator: EstimatorSettings | None = None
) -> tuple[TaskEnvironment, Baseline]:
    """Made once per process and configuration."""
    environment = suite.make(config, 0)
    environment.reset()
    return environment, Baseline(environment, pose, estimator)
