"""Print how often the baseline's recorded joint targets have the outcome of their recording, played as a policy.

    python benchmarks/experiments/recorded_targets.py --out recorded_targets --jobs 2

Attempts of the baseline are recorded, failures too, and played by `manipose evaluate --policy` at 50 Hz and at 10 Hz,
where every fifth target is sent and held. A second run with the same `--out` goes on where the first one ended.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import tyro

from manipose_mj.demos.layout import DemoSet, task_folder
from manipose_mj.demos.record import RecordConfig, record
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.records import EpisodeResult
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.evaluation.statistics import machine

_PLAYER = "manipose_mj.demos.playback:RecordedPolicy"
READY_MADE = (
    "single_object/target_pose",
    "single_object/position",
    "single_object/orientation",
    "articulated/open_cabinet_door",
    "articulated/close_cabinet_door",
    "articulated/open_top_drawer",
    "articulated/close_top_drawer",
    "articulated/open_microwave",
    "articulated/close_oven",
    "articulated/store_chips_can_middle_drawer",
)


@dataclass(frozen=True)
class Arguments:
    """Attributes: out: folder of recordings and results; tasks: to record; episodes: successes of each; exact: of each
    task's recordings, how many are played at 50 Hz too; seed: of the recordings; jobs: at the same time."""

    out: Path
    tasks: tuple[str, ...] = READY_MADE
    episodes: int = 10
    exact: int = 2
    seed: int = 1
    jobs: int = 1


def main(arguments: Arguments) -> None:
    """Record every task, play its recordings, and print the table."""
    print(machine())
    print("| task | recorded | successes | same outcome at 50 Hz | same at 10 Hz |")
    print("| --- | ---: | ---: | ---: | ---: |")
    total = [0] * 6
    differing: list[str] = []
    for task in arguments.tasks:
        asked = RecordConfig(
            task,
            arguments.out / "demos",
            arguments.episodes,
            arguments.seed,
            failures=True,
            jobs=arguments.jobs,
        )
        demos = record(asked, resume=True)
        row = [len(demos.episodes), sum(each.success for each in demos.episodes)]
        for hz, count in ((50.0, arguments.exact), (10.0, len(demos.episodes))):
            results = _played(demos, hz, count, arguments)
            other = [
                _told(one, hz, recorded.failure)
                for one, recorded in zip(results, demos.episodes, strict=False)
                if one.success_at_end != recorded.success
            ]
            row += [len(results) - len(other), len(results)]
            differing += other
        total = [a + b for a, b in zip(total, row, strict=True)]
        print(_row(task, row), flush=True)
    print(_row("all", total))
    print("\n".join(differing))


def _played(demos: DemoSet, hz: float, count: int, arguments: Arguments) -> list[EpisodeResult]:
    """Results of the first recordings, played at a rate until they end."""
    settings = PolicySettings(_PLAYER, json.dumps({"data": str(demos.path)}), hz=hz, stop="horizon")
    out = task_folder(arguments.out / f"{hz:g}_hz", demos.task)
    config = EvaluationConfig(
        (demos.task,), out, count, arguments.seed, jobs=arguments.jobs, policy=settings
    )
    return evaluate(config, resume=True)


def _row(name: str, row: list[int]) -> str:
    recorded, wins, exact, of_exact, slow, of_slow = row
    return f"| {name} | {recorded} | {wins} | {exact} of {of_exact} | {slow} of {of_slow} |"


def _told(result: EpisodeResult, hz: float, before: str | None) -> str:
    now = f"{result.failure}: {result.reason}" if result.failure else "success"
    return (
        f"{result.task}, episode {result.episode} at {hz:g} Hz: was {before or 'success'}, is {now}"
    )


if __name__ == "__main__":
    main(tyro.cli(Arguments))
