"""Success rates with their intervals, from the results of episodes."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from statistics import median
from typing import Any

from manipose_mj.evaluation.records import EpisodeResult
from manipose_mj.failures import STAGES
from manipose_mj.storage.source_hash import distribution_hash

_VERSIONED = (
    *("mujoco", "dm_control", "mink", "daqp", "jax", "numpy", "scipy"),
    *("trimesh", "manifold3d", "coacd", "manipose_mj"),
)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """The 95 % score interval of a proportion.

    Args:
      successes: Number of successes.
      trials: Number of trials, at least 1.

    Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference,
    JASA 22 (1927).
    """
    from scipy.stats import binomtest  # a second to import, which `--help` need not wait for

    interval = binomtest(successes, trials).proportion_ci(confidence_level=0.95, method="wilson")
    return float(interval.low), float(interval.high)


def summarize_task(results: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Counts, interval and medians of the episodes of one task.

    `wilson_95` bounds the rate of success at the end. Errors are medians over the episodes that
    have them, None where none has; `failures` names the stages that occurred, in their order;
    `seeds` are the episodes' own.
    """
    at_end = sum(r.success_at_end for r in results)
    once = sum(r.success_once for r in results)
    stages = Counter(r.failure for r in results if r.failure is not None)
    return {
        "episodes": len(results),
        "success_at_end": at_end,
        "success_once": once,
        "wilson_95": list(wilson_interval(at_end, len(results))),
        "wilson_95_once": list(wilson_interval(once, len(results))),
        "failures": {stage: stages[stage] for stage in STAGES if stages[stage]},
        "median_wall_s": median(r.wall_s for r in results),
        "median_policy_s": median(r.policy_s for r in results),
        "median_simulator_s": median(r.wall_s - r.policy_s for r in results),
        "policy_s_per_decision": _share(
            sum(r.policy_s for r in results), sum(r.decisions for r in results)
        ),
        "clipped_actions": sum(r.clipped_actions for r in results),
        "median_translation_error_m": _median(r.translation_error for r in results),
        "median_rotation_error_rad": _median(r.rotation_error for r in results),
        "median_estimate_translation_error_m": _median(
            r.estimate_translation_error for r in results
        ),
        "median_estimate_rotation_error_rad": _median(r.estimate_rotation_error for r in results),
        "max_penetration_m": max(
            (r.max_penetration for r in results if r.max_penetration is not None), default=None
        ),
        "seeds": [r.seed for r in results],
    }


def summarize(results: Iterable[EpisodeResult]) -> dict[str, dict[str, Any]]:
    """`summarize_task` of every task that occurs, by task name."""
    ordered = sorted(results, key=lambda r: r.key)
    return {
        task: summarize_task(list(episodes))
        for task, episodes in groupby(ordered, key=lambda r: r.task)
    }


def versions() -> dict[str, str]:
    """Of Python, the platform and the packages that can change a result; `source` is the hash of our own code."""
    found = {"python": platform.python_version()}
    for name in _VERSIONED:
        try:
            found[name] = importlib.metadata.version(name.replace("_", "-"))
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    found["source"] = distribution_hash()
    found["platform"] = platform.platform()
    return found


def machine() -> str:
    """The processor and the number of cores this process may use, for people."""
    model = platform.processor() or platform.machine()
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{model}, {cores} cores"


def _share(total: float, count: int) -> float | None:
    return total / count if count else None


def _median(values: Iterable[float | None]) -> float | None:
    present = [v for v in values if v is not None]
    return median(present) if present else None
