"""Measure what errors cost: success of the baseline, or of your estimator, against the size of each error.

    python benchmarks/experiments/robustness_curves.py --runs RUNS --out docs/plots/robustness.csv
    python benchmarks/experiments/robustness_curves.py --estimator MODULE:FACTORY --errors depth_noise --runs RUNS --out OWN.csv
    python docs/plots/draw.py

Every size plays the same episodes of protocol v1. A run that was interrupted goes on with the same command.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.injected_errors import InjectedErrors
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.evaluation.statistics import summarize_task

# One task of each family.
TASKS = (
    "single_object/target_pose",
    "articulated/store_chips_can_middle_drawer",
    "clutter/pick",
)
CAMERAS = ("front", "left", "right")
# Of each error its sizes, beside none, and where poses come from meanwhile.
SIZES: dict[str, tuple[str, tuple[float, ...]]] = {
    "pose_error_cm": ("oracle", (1.0, 2.0, 4.0)),
    "pose_error_deg": ("oracle", (10.0, 20.0, 40.0)),
    "latency_ms": ("oracle", (100.0, 200.0)),
    "camera_error_deg": ("estimated", (0.5, 1.0, 2.0)),
    "depth_noise": ("estimated", (0.0, 3.0)),
    "cameras": ("estimated", (1.0, 2.0)),
}
# What an error's size is when none is made.
USUAL = {"depth_noise": 1.0, "cameras": float(len(CAMERAS))}
COLUMNS = ("task", "pose", "error", "size", "successes", "episodes", "low", "high", "failures")


@dataclass(frozen=True)
class Arguments:
    """Attributes: runs: folder for the evaluations; out: the table; tasks; errors: names of `SIZES`; episodes of each
    size; jobs; sizes: instead of those of `SIZES`; estimator: whose estimates are measured, the package's by default."""

    runs: Path
    out: Path
    tasks: tuple[str, ...] = TASKS
    errors: tuple[str, ...] = tuple(SIZES)
    episodes: int = 10
    jobs: int = 1
    sizes: tuple[float, ...] = ()
    estimator: str | None = None

    def __post_init__(self) -> None:
        for name in self.errors:
            if name not in SIZES:
                raise unknown_name("error", name, SIZES)


def main(arguments: Arguments) -> None:
    """Run every size of every error and write the table, a row at a time."""
    with arguments.out.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for row in _rows(arguments):
            writer.writerow(row)
            file.flush()
            sys.stderr.write(" ".join(str(value) for value in row.values()) + "\n")


def injected(error: str, size: float) -> InjectedErrors:
    """The errors of one run: this one, of this size, and no other."""
    if size == USUAL.get(error, 0.0):
        return InjectedErrors()
    value: Any = CAMERAS[: int(size)] if error == "cameras" else size
    return InjectedErrors(**{error: value})


def _rows(arguments: Arguments) -> Iterator[dict[str, Any]]:
    for task in arguments.tasks:
        for error in arguments.errors:
            pose, sizes = SIZES[error]
            for size in sorted({USUAL.get(error, 0.0), *(arguments.sizes or sizes)}):
                made = injected(error, size)
                row = _measured(arguments, task, pose, made)
                yield {"task": task, "pose": pose, "error": error, "size": f"{size:g}", **row}


def _measured(arguments: Arguments, task: str, pose: str, errors: InjectedErrors) -> dict[str, Any]:
    """The last columns of a row; a run that is complete is not repeated."""
    name = "-".join([task.replace("/", "__"), pose, *errors.words]).replace("--", "")
    estimator = None
    if arguments.estimator is not None and pose == "estimated":
        estimator = EstimatorSettings(arguments.estimator)
    config = EvaluationConfig(
        (task,),
        arguments.runs / name,
        episodes=arguments.episodes,
        pose=pose,
        jobs=arguments.jobs,
        protocol="v1",
        estimator=estimator,
        errors=errors,
    )
    summary = summarize_task(evaluate(config, resume=True))
    low, high = summary["wilson_95"]
    return {
        "successes": summary["success_at_end"],
        "episodes": summary["episodes"],
        "low": f"{low:.3f}",
        "high": f"{high:.3f}",
        "failures": ", ".join(f"{count} {stage}" for stage, count in summary["failures"].items()),
    }


if __name__ == "__main__":
    try:
        main(tyro.cli(Arguments))
    except InputError as error:
        sys.exit(str(error))
