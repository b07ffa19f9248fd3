"""Run the episodes of an evaluation, keep each result as it comes, and go on after a kill."""

from __future__ import annotations

import json
import logging
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Protocol

from dm_control.rl.control import PhysicsError

from manipose_mj.console.cluster import cluster
from manipose_mj.console.process import end_with_parent
from manipose_mj.control.perception.source_names import GraspSource
from manipose_mj.errors import InputError, ServerAbsentError, ServerLostError, worker_deaths
from manipose_mj.estimators.loading import load_estimator
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.injected_errors import InjectedErrors
from manipose_mj.evaluation.planner_settings import PlannerSettings
from manipose_mj.evaluation.policy_settings import PolicySettings, attachment_of
from manipose_mj.evaluation.records import (
    EpisodeResult,
    Trajectory,
    storable,
    to_line,
    trajectory_path,
    write_atomically,
    write_sorted,
    write_trajectory,
)
from manipose_mj.evaluation.results_folder import (
    RESULTS_FILE,
    RUN_FILE,
    SUMMARY_FILE,
    append_result,
    holds_results,
    is_asked_for,
    kept_results,
    results_file,
)
from manipose_mj.evaluation.statistics import machine, summarize, versions
from manipose_mj.policies.loading import load_policy, metadata_of

if TYPE_CHECKING:
    from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

# Episodes of one process share their compiled environments, and a dask worker may have several threads.
_one_at_a_time = Lock()

logger = logging.getLogger(__name__)


class Runner(Protocol):
    """What runs one episode; must survive pickling by `cloudpickle`."""

    def __call__(
        self, config: EnvConfig, spec: EpisodeSpec, *, episode: int, pose: str
    ) -> tuple[EpisodeResult, Trajectory]: ...


@dataclass(frozen=True)
class BaselineRunner:
    """The runner of every real evaluation of the baseline, in MuJoCo."""

    planner: PlannerSettings
    estimator: EstimatorSettings | None = None
    errors: InjectedErrors = InjectedErrors()
    grasps: GraspSource | None = None

    def __call__(
        self, config: EnvConfig, spec: EpisodeSpec, *, episode: int, pose: str
    ) -> tuple[EpisodeResult, Trajectory]:
        """One episode."""
        from manipose_mj.evaluation.episode import run_episode  # loads the simulator: workers only

        with _quiet_simulator():
            return run_episode(
                config,
                spec,
                episode=episode,
                pose=pose,
                planner=self.planner,
                estimator=self.estimator,
                errors=self.errors.pose_errors(),
                grasps=self.grasps,
            )


@dataclass(frozen=True)
class PolicyRunner:
    """The runner of every real evaluation of somebody's policy.

    Attributes: settings: of the policy; out: folder of the results.
    """

    settings: PolicySettings
    out: Path

    def __call__(
        self, config: EnvConfig, spec: EpisodeSpec, *, episode: int, pose: str
    ) -> tuple[EpisodeResult, Trajectory]:
        """One episode."""
        from manipose_mj.evaluation.episode import run_policy_episode  # as above

        with _quiet_simulator():
            return run_policy_episode(
                config,
                spec,
                episode=episode,
                settings=self.settings,
                begun=holds_results(self.out),
            )


@contextmanager
def _quiet_simulator() -> Iterator[None]:
    # An unstable simulation is in its episode's result; dm_control would say it hundreds of times.
    simulator_log = logging.getLogger("absl")
    level = simulator_log.level
    simulator_log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        simulator_log.setLevel(level)


def _ignore(done: Sequence[EpisodeResult], total: int) -> None: ...


def evaluate(
    config: EvaluationConfig,
    *,
    resume: bool = False,
    runner: Runner | None = None,
    on_progress: Callable[[Sequence[EpisodeResult], int], None] = _ignore,
) -> list[EpisodeResult]:
    """Run every episode that the output folder lacks, and write results and summary there.

    `results.jsonl` gains a line as each episode ends, on disk before the next one is waited for; when all have
    ended it is sorted, so that it is the same for any number of jobs, times apart.

    Args:
      config: What to run.
      resume: Keep the results that `config.out` holds and run only what is missing: of a run that was cut short, or
        of one with fewer tasks or episodes.
      runner: Runs one episode; None: in MuJoCo.
      on_progress: Called with the results so far and the number wanted, first before any runs.

    Returns:
      The results in the order of task and episode.

    Raises:
      InputError: The folder cannot be written or holds results of something else, an episode's
        input is wrong, the protocol's assets are not all there, a task is not as the protocol fixes it, or there is
        no such cluster.
      WorkerDiedError: A worker process was killed, or the server of a method; what had ended is kept.
    """
    config.check_assets()
    given = config
    config, metadata = _checked_policy(config.independent_of_folder())
    told = replace(given, policy=config.policy)
    said = {"policy metadata": metadata, "estimator metadata": _estimator_metadata(config)}
    if runner is None:
        _check_protocol(config)
    if runner is None and config.policy is not None:
        runner = PolicyRunner(config.policy, config.out.absolute())
    elif runner is None:
        if config.dask is None:  # workers elsewhere may have keys of their own
            config.planner.language_model()
        runner = BaselineRunner(config.planner, config.estimator, config.errors, config.grasps)
    identity = {**told.identity, **{f"{k} version": v for k, v in versions().items()}, **said}
    del identity["platform version"]  # a new kernel changes no result
    seeds = {
        (task, episode): config.episode_seed(task, episode)
        for task in sorted(config.tasks)
        for episode in range(config.episodes)
    }
    with cluster(config.dask), results_file(config.out) as file:
        results = kept_results(config.out, identity, seeds, file, resume=resume)
        if not results or not is_asked_for(config.out, identity):
            (config.out / SUMMARY_FILE).unlink(missing_ok=True)  # of fewer episodes
            run = {
                **identity,
                "masks": config.mask_source,
                "jobs": config.jobs,
                "command": told.command,
                "machine": machine(),
            }
            write_atomically(config.out / RUN_FILE, _json(run))
        done = {r.key for r in results}
        missing = [key for key in seeds if key not in done]
        total = len(seeds)
        on_progress(results, total)
        for result in _outcomes(config, runner, missing):
            append_result(file, result)
            results.append(result)
            on_progress(results, total)
        write_sorted(config.out / RESULTS_FILE, results)
        write_atomically(config.out / SUMMARY_FILE, _json(_summary(told, results)))
    return sorted(results, key=lambda r: r.key)


def _checked_policy(config: EvaluationConfig) -> tuple[EvaluationConfig, dict[str, Any]]:
    """The evaluation with what its policy takes from the simulator, and what the policy says of itself.

    Nothing is written before the policy can be had.

    Raises:
      InputError: It cannot, or its observations are none of a task's.
    """
    if config.policy is None:
        return config, {}
    for task in config.tasks:
        config.env_config(task)  # misspelt modes
    policy = load_policy(config.policy.name, config.policy.arguments)
    if "/" in config.policy.obs_mode:  # a key, which some tasks may lack
        from manipose_mj.evaluation.episode import environment_of

        for task in config.tasks:
            environment_of(config.env_config(task))
    if _has_workers(config):
        load_policy.cache_clear()  # workers make their own
        getattr(policy, "close", lambda: None)()
    # In batched worlds nobody attaches a policy.
    attachment = attachment_of(policy) if config.batch is None else None
    told = replace(config, policy=replace(config.policy, attachment=attachment))
    return told, metadata_of(policy)


def _has_workers(config: EvaluationConfig) -> bool:
    """Whether other processes run the episodes."""
    several = config.jobs > 1 and len(config.tasks) * config.episodes > 1
    return several or config.dask is not None


def _check_protocol(config: EvaluationConfig) -> None:
    """Refuse tasks that are not what the protocol fixes any more."""
    if config.protocol is None:
        return
    from manipose_mj.evaluation.protocol.present_settings import check_settings  # as above

    for task in config.tasks:
        check_settings(protocol.load(config.protocol), config.env_config(task))


def _estimator_metadata(config: EvaluationConfig) -> dict[str, Any]:
    """What the estimator says of itself; makes it, so that what is not there is told before anything is written."""
    if config.estimator is None:
        return {}
    service = load_estimator(config.estimator)
    said = metadata_of(service.estimator)
    if _has_workers(config):
        service.close()  # workers make their own
        load_estimator.cache_clear()
    return said


def _outcomes(
    config: EvaluationConfig, runner: Runner, episodes: list[tuple[str, int]]
) -> Iterator[EpisodeResult]:
    """Results as the episodes end, in any order."""
    if config.batch is not None:
        from manipose_mj.evaluation.batched import batched_results  # loads the simulator

        started = time.perf_counter()
        yield from batched_results(
            config,
            config.batch,
            episodes,
            lambda task, number, error: _raised(
                config, task, number, error, time.perf_counter() - started
            ),
        )
        return
    if not _has_workers(config):
        for task, episode in episodes:
            yield run_one(config, runner, task, episode)
        return
    import joblib

    # One thread per worker: else every worker's BLAS takes all cores, and sums change their order.
    here: dict[str, Any] = {"backend": "loky", "inner_max_num_threads": 1}
    with joblib.parallel_config(**here) if config.dask is None else nullcontext():
        # Batches would hold finished episodes back.
        options: Any = {"return_as": "generator_unordered", "batch_size": 1}
        pool: Any = joblib.Parallel(n_jobs=min(config.jobs, len(episodes)), **options)
        run = _run_in_worker if config.dask is None else run_one
        outcomes = pool(joblib.delayed(run)(config, runner, *key) for key in episodes)
    with worker_deaths(f"finished episodes are kept in {config.out}: repeat with --resume"):
        yield from outcomes


def _run_in_worker(
    config: EvaluationConfig, runner: Runner, task: str, episode: int
) -> EpisodeResult:
    end_with_parent()
    return run_one(config, runner, task, episode)


def run_one(config: EvaluationConfig, runner: Runner, task: str, episode: int) -> EpisodeResult:
    """Run an episode and save its trajectory; what raises is a failed episode.

    Raises:
      InputError: The episode's input is wrong, or its trajectory cannot be written.
      ServerLostError: The server of a method is not there any more.
    """
    path = trajectory_path(config.out, task, episode)
    start = time.perf_counter()
    try:
        spec = config.episode_spec(task, episode)
        with _one_at_a_time:
            result, trajectory = runner(
                config.env_config(task), spec, episode=episode, pose=config.pose
            )
        result = replace(result, reason=storable(result.reason))
        to_line(result)  # a number that is not finite shows here, where it costs one episode only
    except (ServerLostError, ServerAbsentError) as error:
        # A worker that finds no server comes late: the evaluation spoke with it before the first episode.
        advice = "finished episodes are kept: start it again and repeat with --resume"
        raise ServerLostError(f"{error}; {advice}") from None
    except (InputError, OSError, MemoryError):
        raise
    except Exception as error:  # one broken episode must not end the other hundred
        return _raised(config, task, episode, error, time.perf_counter() - start)
    write_trajectory(path, trajectory)
    if trajectory.raised:
        _write_traceback(path, trajectory.raised)
    return result


def _write_traceback(trajectory: Path, text: str) -> None:
    """Leave a traceback beside an episode's trajectory."""
    write_atomically(trajectory.with_suffix(".error.txt"), storable(text).encode("utf-8"))


def _raised(
    config: EvaluationConfig, task: str, episode: int, error: Exception, wall_s: float
) -> EpisodeResult:
    """The result of an episode that raised, whose traceback is kept."""
    logger.debug("episode %d of %s raised", episode, task, exc_info=error)
    text = "".join(traceback.format_exception(error))
    _write_traceback(trajectory_path(config.out, task, episode), text)
    return _crashed(config, task, episode, error, wall_s)


def _crashed(
    config: EvaluationConfig, task: str, episode: int, error: Exception, wall_s: float
) -> EpisodeResult:
    stage = "physics" if isinstance(error, PhysicsError) else "error"
    reason = " ".join(f"{type(error).__name__}: {error}".split())
    return EpisodeResult(
        task=task,
        episode=episode,
        seed=config.episode_seed(task, episode),
        object="",
        pose_source=config.pose_source,
        mask_source=config.mask_source,
        success_once=False,
        success_at_end=False,
        failure=stage,
        reason=storable(reason[:300]),
        translation_error=None,
        rotation_error=None,
        steps=0,
        sim_time=0.0,
        max_penetration=0.0,
        wall_s=wall_s,
    )


def _summary(config: EvaluationConfig, results: list[EpisodeResult]) -> dict[str, Any]:
    settings = {k: v for k, v in config.identity.items() if k not in ("tasks", "episodes")}
    settings["split"] = config.split
    settings["assets"] = list(config.assets)
    settings["poses"] = config.poses
    settings["masks"] = config.mask_source
    settings["grasps"] = config.grasp_source
    return {
        "tasks": summarize(results),
        "versions": versions(),
        "machine": machine(),
        "command": config.command,
        **settings,
    }


def _json(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, indent=1, allow_nan=False) + "\n").encode("utf-8")
