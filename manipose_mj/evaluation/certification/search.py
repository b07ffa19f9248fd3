"""Finding and replaying the certificates of a protocol's starts: every start is one episode of the baseline."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence

import joblib

from manipose_mj.control.baseline import MAX_PLANS
from manipose_mj.errors import InputError, worker_deaths
from manipose_mj.evaluation.certification.certificates import Certificate, Certificates, Key
from manipose_mj.evaluation.episode import run_episode
from manipose_mj.evaluation.protocol.frozen import Protocol, load
from manipose_mj.evaluation.protocol.own_assets import pool_folders
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import tasks_named
from manipose_mj.tasks.core.start import NoStartError

# Budgets of plans, each with a seed of its own: first what an evaluation has, at last three times as many.
BUDGETS = (MAX_PLANS, MAX_PLANS, 3 * MAX_PLANS)
_ROUNDS = (
    2  # of them, where a certificate does not hold: a pile may lie otherwise on another processor
)
UNDRAWN = "start"  # the stage at which a start fails that cannot be drawn


def attempts(seed: int, rounds: int = 1) -> tuple[Certificate, ...]:
    """What is tried in turn for an episode's seed: first what an evaluation does, then other samples; `rounds` times as many."""
    budgets = BUDGETS * rounds
    return tuple(Certificate((seed + i) % 2**32, plans) for i, plans in enumerate(budgets))


def chosen_starts(
    protocol: Protocol, tasks: Sequence[str] = (), episodes: int | None = None
) -> list[Key]:
    """The starts of some tasks, by names or patterns, or of all; the first `episodes` of each, or all.

    Raises:
      InputError: The protocol lacks a task, or has no such number of episodes.
    """
    keys = []
    for task in tasks_named(tasks, protocol.tasks) if tasks else sorted(protocol.tasks):
        most = len(protocol.task(task).episodes)
        count = most if episodes is None else episodes
        if not 1 <= count <= most:
            raise InputError(f"episodes is {count}; expected 1 to {most}")
        keys += [(task, i) for i in range(count)]
    return keys


def certify(
    version: str, starts: Sequence[Key], jobs: int, assets: tuple[str, ...] = ()
) -> Iterator[tuple[Key, Certificate | str]]:
    """Look for certificates; each as it is found, or the reason why the last attempt failed.

    Args:
      version: Of the protocol.
      starts: Of it.
      jobs: Episodes at the same time.
      assets: Folders with those that this version leaves to the user to build.
    """
    yield from _in_parallel(((version, start, None, assets) for start in starts), jobs)


def verify(
    version: str,
    known: Certificates,
    starts: Sequence[Key],
    jobs: int,
    assets: tuple[str, ...] = (),
) -> Iterator[tuple[Key, Certificate | str]]:
    """Replay certificates: each that still solves its start, another that does where it does not, or why none does."""
    solved = known.solved
    yield from _in_parallel(((version, start, solved[start], assets) for start in starts), jobs)


def _in_parallel(starts: Iterator, jobs: int) -> Iterator[tuple[Key, Certificate | str]]:
    with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
        pool = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
        outcomes = pool(joblib.delayed(_outcome)(*start) for start in starts)
    with worker_deaths("repeat the command"):
        yield from outcomes


def _outcome(
    version: str, start: Key, certificate: Certificate | None, assets: tuple[str, ...] = ()
) -> tuple[Key, Certificate | str]:
    """Play a start by a certificate, then by twice what `certify` tries; what solves it, or why the last did not."""
    # An unstable simulation is in its episode's result; dm_control would say it hundreds of times.
    logging.getLogger("absl").setLevel(logging.ERROR)
    task, number = start
    frozen = load(version).episode(task, number)
    objects = pool_folders(version, task, assets)
    config = EnvConfig(task, obs_mode="state", split="test", objects=objects)
    tried = attempts(frozen.seed)
    if certificate is not None:
        others = attempts(frozen.seed, _ROUNDS)
        tried = (certificate, *(attempt for attempt in others if attempt != certificate))
    reason = ""
    for attempt in tried:
        try:
            result, _ = run_episode(
                config,
                EpisodeSpec(**frozen.asked),
                episode=number,
                planner_seed=attempt.planner_seed,
                plans=attempt.plans,
            )
        except NoStartError as error:
            return start, f"{UNDRAWN}: {error}"
        if result.success_at_end:
            return start, attempt
        reason = f"{result.failure}: {result.reason}"
    return start, reason
