"""Measure what errors cost: success of the baseline, or of your estimator, against the size of each error.

    python benchmarks/experiments/robustness_curves.py --runs RUNS --out docs/plots/robustness.csv
    python benchmarks/experiments/robustness_curves.py --estimator MODULE:FACTORY --errors depth_noise --runs RUNS --out OWN.csv
    python docs/plots/draw.py

Every size plays the same episodes of protocol v1. A run that was interrupted goes on with the same command. The table
is replaced when all is measured; it keeps the curves of other tasks, errors and estimators.

Without errors of poses, the baseline with true poses is told by the simulator whether the goals are met, and plans again
where they are not; with errors it is not told. `--no-second-attempt` keeps it from being told at size 0 too.
"""

from __future__ import annotations

import csv
import io
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
from manipose_mj.evaluation.records import write_atomically
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
# Too small for anything but that the baseline is not told whether it met the goals.
NEXT_TO_NONE = 1e-6
COLUMNS = (
    *("task", "pose", "error", "size", "successes", "episodes", "low", "high", "failures"),
    "estimator",  # empty: the package's
)
_SINCE = ("estimator",)  # columns that older tables lack
Curve = tuple[str, str, str]  # task, error and estimator


@dataclass(frozen=True)
class Arguments:
    """Attributes: runs: folder for the evaluations; out: the table; tasks; errors: names of `SIZES`; episodes of each
    size; jobs; sizes: instead of those of `SIZES`; estimator: whose estimates are measured, the package's by default;
    second_attempt: where the simulator says that goals are not met, which it does without errors of poses only."""

    runs: Path
    out: Path
    tasks: tuple[str, ...] = TASKS
    errors: tuple[str, ...] = tuple(SIZES)
    episodes: int = 10
    jobs: int = 1
    sizes: tuple[float, ...] = ()
    estimator: str | None = None
    second_attempt: bool = True

    def __post_init__(self) -> None:
        for name in self.errors:
            if name not in SIZES:
                raise unknown_name("error", name, SIZES)


def main(arguments: Arguments) -> None:
    """Run every size of every error; then write the table.

    Raises:
      InputError: The file holds something else than such a table, or an evaluation cannot be.
    """
    curves = read_curves(arguments.out)
    measured: dict[Curve, list[dict[str, Any]]] = {}
    for row in _rows(arguments):
        measured.setdefault(_curve_of(row), []).append(row)
        sys.stderr.write(" ".join(str(value) for value in row.values()) + "\n")
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for rows in {**curves, **measured}.values():
        writer.writerows(rows)
    write_atomically(arguments.out, stream.getvalue().encode("utf-8"))


def read_curves(path: Path) -> dict[Curve, list[dict[str, Any]]]:
    """The rows of a table by what they are about; none where there is no file.

    Raises:
      InputError: It holds something else.
    """
    if not path.exists():
        return {}
    curves: dict[Curve, list[dict[str, Any]]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        columns = reader.fieldnames or ()
        if tuple(columns) not in (COLUMNS, tuple(c for c in COLUMNS if c not in _SINCE)):
            raise InputError(f"{path}: columns are {','.join(columns)!r:.80}; choose another --out")
        for row in reader:
            whole = {**dict.fromkeys(COLUMNS, ""), **row}
            curves.setdefault(_curve_of(whole), []).append(whole)
    return curves


def _curve_of(row: dict[str, Any]) -> Curve:
    return row["task"], row["error"], row["estimator"]


def injected(error: str, size: float, *, second_attempt: bool = True) -> InjectedErrors:
    """The errors of one run: this one, of this size, and no other."""
    if size == USUAL.get(error, 0.0):
        if second_attempt or not error.startswith("pose_error"):
            return InjectedErrors()
        size = NEXT_TO_NONE
    value: Any = CAMERAS[: int(size)] if error == "cameras" else size
    return InjectedErrors(**{error: value})


def _rows(arguments: Arguments) -> Iterator[dict[str, Any]]:
    for task in arguments.tasks:
        for error in arguments.errors:
            pose, sizes = SIZES[error]
            for size in sorted({USUAL.get(error, 0.0), *(arguments.sizes or sizes)}):
                made = injected(error, size, second_attempt=arguments.second_attempt)
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
        "estimator": "" if estimator is None else estimator.identity["name"],
    }


if __name__ == "__main__":
    try:
        main(tyro.cli(Arguments))
    except InputError as error:
        sys.exit(str(error))
