"""One evaluation episode: reset, act, task."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
from dm_control import composer

from manipose_mj import suite
from manipose_mj.control.baseline import MAX_PLANS
from manipose_mj.control.perception.perturbed import UNPERTURBED, PosePerturbation
from manipose_mj.control.perception.source_names import GraspSource, masks_of
from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.estimators.answer import EstimatorFailedError
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation.estimate_errors import EstimateErrors
from manipose_mj.evaluation.planner_settings import PlannerSettings
from manipose_mj.evaluation.policy_settings import PolicySettings, attachment_of
from manipose_mj.evaluation.records import EpisodeResult, Trajectory
from manipose_mj.evaluation.rollout import Outcome, Rollout, Rules
from manipose_mj.failures import StageFailure
from manipose_mj.gym.droid import droid_observation, from_droid
from manipose_mj.gym.features import Features
from manipose_mj.mjcf.panda.robot import picture_visuals
from manipose_mj.policies.baseline import BaselinePolicy
from manipose_mj.policies.loading import load_policy
from manipose_mj.policies.protocol import ActionSpace, Policy
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.user_code import reason_of
from manipose_mj.wire.client import RemoteFailureError

_RECORD_EVERY = 5  # control steps
BY_RULES = PlannerSettings()


def run_episode(
    config: EnvConfig,
    spec: EpisodeSpec,
    *,
    episode: int = 0,
    pose: str = "oracle",
    planner_seed: int | None = None,
    plans: int = MAX_PLANS,
    planner: PlannerSettings = BY_RULES,
    estimator: EstimatorSettings | None = None,
    errors: PosePerturbation = UNPERTURBED,
    grasps: GraspSource | None = None,
) -> tuple[EpisodeResult, Trajectory]:
    """Run the baseline for one episode; the same arguments give the same result bit for bit.

    Args:
      config: Of the environment, which is compiled once per process and configuration; objects by name or
        by folder.
      spec: Of the episode.
      episode: Index, copied into the result.
      pose: Where object poses come from: `"oracle"` or `"estimated"`.
      planner_seed: Of the motion planner; by default the episode's.
      plans: How many the baseline may try.
      planner: What makes them.
      estimator: Whose estimates they are; None: those of the package's weights.
      errors: Made to the poses of objects on purpose.
      grasps: Where those of objects come from; by default what suits `pose`.

    Raises:
      InputError: Something named does not exist or cannot be used.
      ServerLostError: The estimator's server went away.
    """
    environment = environment_of(config)
    policy = _baseline(config, pose, plans, planner, estimator, errors, grasps)
    policy.name_episode(config.task, episode)
    naming = Naming(config.task, episode, pose, masks_of(pose))
    return play(environment, policy, spec, Rules(), naming, policy_seed=planner_seed)


def run_policy_episode(
    config: EnvConfig,
    spec: EpisodeSpec,
    *,
    episode: int = 0,
    pose: str = "",
    settings: PolicySettings,
    begun: bool = False,
) -> tuple[EpisodeResult, Trajectory]:
    """Run anybody's policy for one episode; arguments as of `run_episode`, but poses are the policy's affair.

    Args:
      config: Of the environment.
      spec: Of the episode.
      episode: Index, copied into the result.
      pose: Ignored.
      settings: The policy, what it sees, and how it acts.
      begun: Whether there are results of other episodes; actions of another width are a failure of this one then.

    Raises:
      InputError: Something named does not exist, or the policy's actions are those of another control mode.
      ServerLostError: The policy's server went away.
    """
    policy = _Guarded(load_policy(settings.name, settings.arguments))
    settings = replace(settings, attachment=attachment_of(policy.policy))
    rules = Rules(settings.hz, settings.execute, settings.stop, begun)
    naming = Naming(config.task, episode, settings.pose_source, settings.mask_source)
    return play(environment_of(config), policy, spec, rules, naming, settings)


@dataclass(frozen=True)
class Naming:
    """What an episode's result copies.

    Attributes: task; episode: its index; pose_source: where poses came from; mask_source: where instance masks did.
    """

    task: str
    episode: int
    pose_source: str
    mask_source: str


def play(
    environment: TaskEnvironment,
    policy: Policy,
    spec: EpisodeSpec,
    rules: Rules,
    naming: Naming,
    settings: PolicySettings | None = None,
    after_step: Callable[[int], None] = lambda steps: None,
    policy_seed: int | None = None,
) -> tuple[EpisodeResult, Trajectory]:
    """Reset an environment and let a policy act in it.

    Args:
      environment: Of the task.
      policy: To play.
      spec: Of the episode.
      rules: Rates and when to stop.
      naming: For the result.
      settings: What the policy sees; None: nothing, as for the baseline.
      after_step: Called with the number of control steps, first with 0 after the reset.
      policy_seed: That the policy gets; by default the episode's.
    """
    started = time.perf_counter()
    seed = spec.seed or 0
    first = environment.reset(replace(spec, seed=seed))
    task = environment.task
    outcome = Outcome()
    attach: Callable[[composer.Environment], None] | None = getattr(policy, "attach", None)
    try:
        if attach is not None:
            attach(environment)
    except StageFailure as failure:
        outcome.failure = failure
    inner = policy.policy if isinstance(policy, _Guarded) else policy
    estimates = None
    if isinstance(inner, BaselinePolicy) and outcome.failure is None:
        estimates = EstimateErrors(task, environment.physics, inner.baseline)
    recorder = _Recorder(environment, inner)
    recorder.record()
    after_step(0)

    def both(steps: int) -> None:
        recorder.after_step(steps)
        after_step(steps)

    limits = environment.action_spec()
    features = None if settings is None else Features(environment)
    droid = settings is not None and settings.obs_format == "droid"
    low, high = limits.minimum, limits.maximum
    if droid:
        low, high = np.append(low[:-1], 0.0), np.append(high[:-1], 1.0)
    space = ActionSpace(low, high, task.control_mode.name, rules.hz)
    try:
        if outcome.failure is None:
            policy.reset(
                task=naming.task,
                instruction="" if features is None else features.instruction,
                seed=seed if policy_seed is None else policy_seed,
                action_space=space,
            )
    except StageFailure as failure:
        outcome.failure = failure
    if outcome.failure is None:
        rollout = Rollout(
            environment,
            policy,
            rules,
            observe=_observer(features, droid),
            translate=from_droid if droid else np.asarray,
            after_decision=estimates.after_planning if estimates else lambda: None,
            after_step=both,
        )
        outcome = rollout.run(first)
    recorder.record()
    wall_s = time.perf_counter() - started
    result = _result(environment, outcome, naming, seed, estimates, wall_s)
    return result, replace(recorder.trajectory(), raised=traceback_of(outcome.failure))


def traceback_of(failure: StageFailure | None) -> str:
    """The traceback of what a policy, an estimator or a server raised, where that ended the episode."""
    failed = None if failure is None else failure.__cause__
    of_estimator = isinstance(failed, EstimatorFailedError)
    while isinstance(failed, EstimatorFailedError):
        failed = failed.__cause__
    if isinstance(failed, RemoteFailureError):
        return failed.text
    if failure is None or failed is None or not (of_estimator or failure.stage == "policy"):
        return ""
    return "".join(traceback.format_exception(failed))


def _observer(features: Features | None, droid: bool) -> Callable[[Any], dict[str, Any]]:
    """What makes a policy's observation; of none, where nothing is to be seen."""
    if features is None:
        return lambda observation: {}
    if droid:
        return lambda observation: droid_observation(features.read(observation))
    return features.read


def _result(
    environment: TaskEnvironment,
    outcome: Outcome,
    naming: Naming,
    seed: int,
    estimates: EstimateErrors | None,
    wall_s: float,
) -> EpisodeResult:
    task, physics, failure = environment.task, environment.physics, outcome.failure
    diverged = failure is not None and failure.stage == "physics"
    # Who gives up with the goal met has met it; whose policy broke has not come to an end.
    broken = failure is not None and failure.stage in ("physics", "policy")
    success = not broken and task.succeeded(physics)
    if failure is None and not success:
        ended = "the policy said it was done" if estimates is None else "the plan was carried out"
        failure = StageFailure("release", f"the goal is not met though {ended}")
    if failure is not None and not success and estimates is not None:
        failure = estimates.cause(failure)
    error = None if diverged else task.goal_error(physics)
    return EpisodeResult(
        task=naming.task,
        episode=naming.episode,
        seed=seed,
        object=task.object_name,
        pose_source=naming.pose_source,
        mask_source=naming.mask_source,
        success_once=task.success_once or success,
        success_at_end=success,
        failure=None if success or failure is None else failure.stage,
        reason="" if success or failure is None else failure.reason,
        translation_error=None if error is None else error[0],
        rotation_error=None if error is None else error[1],
        steps=outcome.steps,
        sim_time=round(outcome.steps * task.control_timestep, 6),
        max_penetration=task.max_penetration,
        wall_s=wall_s,
        estimate_translation_error=estimates.translation if estimates else None,
        estimate_rotation_error=estimates.rotation if estimates else None,
        decisions=outcome.decisions,
        clipped_actions=outcome.clipped,
        policy_s=outcome.policy_s,
    )


class _Guarded:
    """A stranger's policy, whose mistakes are told from those of the simulation.

    Attributes:
      policy: It.
      privileged: Whether it asks for its environment: it then may read what only a simulator knows.
    """

    def __init__(self, policy: Policy) -> None:
        self.policy = policy
        self.privileged = attachment_of(policy) is not None

    def attach(self, environment: composer.Environment) -> None:
        if self.privileged:
            self._called("attach", environment)

    def reset(self, **episode: Any) -> None:
        self._called("reset", **episode)

    def infer(self, obs: Any) -> Any:
        return self._called("infer", obs)

    def _called(self, method: str, *arguments: Any, **named: Any) -> Any:
        try:
            return getattr(self.policy, method)(*arguments, **named)
        except (InputError, ServerLostError, StageFailure, MemoryError):
            raise
        except (Exception, SystemExit) as error:
            reason = f"the policy's {method} raised {reason_of(error)}"
            raise StageFailure("policy", reason) from error


def start_state(config: EnvConfig, spec: EpisodeSpec) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model and the state in which an episode starts, for pictures; arguments as for an episode.

    The robot has Menagerie's meshes where they are on this machine. Physics are the same; what sensors saw is not.
    """
    environment = environment_of(replace(config, robot_visuals=picture_visuals()))
    environment.reset(spec)
    return environment.physics.model.ptr, environment.physics.data.ptr


def scene_model(config: EnvConfig, spec: EpisodeSpec) -> mujoco.MjModel:
    """The model with everything where an episode has it, to draw a trajectory in."""
    return start_state(config, spec)[0]


class _Recorder:
    def __init__(self, environment: composer.Environment, policy: Policy) -> None:
        self._data = environment.physics.data
        self._baseline = policy if isinstance(policy, BaselinePolicy) else None
        self._times: list[float] = []
        self._positions: list[np.ndarray] = []
        self._annotations: list[str] = []

    def after_step(self, steps: int) -> None:
        if steps % _RECORD_EVERY == 0:
            self.record()

    def record(self) -> None:
        self._times.append(float(self._data.time))
        self._positions.append(np.array(self._data.qpos, np.float32))
        self._annotations.append("" if self._baseline is None else self._baseline.status)

    def trajectory(self) -> Trajectory:
        return Trajectory(np.array(self._times), np.stack(self._positions), self._annotations)


@lru_cache(maxsize=4)
def environment_of(config: EnvConfig) -> TaskEnvironment:
    """The environment of a configuration, made once per process.

    Raises:
      InputError: The configuration cannot be.
    """
    environment = suite.make(config, 0)
    environment.reset()
    assert isinstance(environment, TaskEnvironment)
    return environment


@lru_cache(maxsize=4)
def _baseline(
    config: EnvConfig,
    pose: str,
    plans: int,
    planner: PlannerSettings,
    estimator: EstimatorSettings | None,
    errors: PosePerturbation,
    grasps: GraspSource | None,
) -> BaselinePolicy:
    """The baseline of the configuration's environment."""
    policy = BaselinePolicy(pose, planner.make(), plans, estimator, errors, grasps)
    policy.attach(environment_of(config))
    return policy
