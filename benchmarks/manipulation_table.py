"""Print the manipulation table of the README: the baseline on every task and on real scans.

    python benchmarks/manipulation_table.py --episodes 50
    python benchmarks/manipulation_table.py --objects BUILT_YCB/006_mustard_bottle ...

Rows of built-in objects come from `manipose evaluate TASK... --episodes N --seed 0`; rows of scans
from the same command with `--objects DIR/NAME`.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import tyro

from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.evaluation.statistics import summarize
from manipose_mj.suite import ALL_TASKS


@dataclass(frozen=True)
class Arguments:
    """Attributes: episodes of each row; seed; jobs; objects: built-in ones or asset folders."""

    episodes: int = 50
    seed: int = 0
    jobs: int = 2
    objects: tuple[str, ...] = ()


def main(arguments: Arguments) -> None:
    """Run every row and print the table."""
    print("| task | object | success at end | 95 % interval | failures | median wall [s] |")
    print("| --- | --- | --- | --- | --- | --- |")
    if arguments.objects:
        for name in arguments.objects:
            _rows(arguments, ("single_object/target_pose",), name)
    else:
        _rows(arguments, tuple("/".join(task) for task in ALL_TASKS), None)


def _rows(arguments: Arguments, tasks: tuple[str, ...], name: str | None) -> None:
    with tempfile.TemporaryDirectory() as out:
        config = EvaluationConfig(
            tasks,
            Path(out) / "run",
            episodes=arguments.episodes,
            seed=arguments.seed,
            jobs=arguments.jobs,
            objects=None if name is None else (name,),
        )
        results = evaluate(config)
    for task, row in summarize(results).items():
        low, high = row["wilson_95"]
        failures = ", ".join(f"{stage} {n}" for stage, n in row["failures"].items()) or "none"
        print(
            f"| `{task}` | {name or 'built-in'} | {row['success_at_end']} / {row['episodes']} "
            f"| {low:.2f} - {high:.2f} | {failures} | {row['median_wall_s']:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main(tyro.cli(Arguments))
