"""Print how often recorded plans end with the same verdict on two engines, each in the world that it was made in.

python benchmarks/batch/verdict_parity.py TASK ... [--plan-from DIR] [--plans N] [--engines c warp]

Without --plan-from, plans of the baseline with true poses are recorded first. A replay that diverged, or whose contacts
had too little room, is a failure. `MANIPOSE_WARP_ON_CPU=1` runs `warp` without a GPU, slowly.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import jax
import mujoco

from manipose_mj.evaluation.statistics import machine, wilson_interval
from manipose_mj.robustness.plans import SEEDS, recorded_plans
from manipose_mj.robustness.replay import Replay, replays
from manipose_mj.robustness.variation import Variation


def main() -> None:
    """Replay and print a row for each task, then one of all, then the plans that ended otherwise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tasks", nargs="+", metavar="TASK")
    parser.add_argument("--plan-from", default=SEEDS, metavar="seeds|DIR")
    parser.add_argument("--plans", type=int, default=10, help="of each task")
    parser.add_argument("--objects", nargs="+", help="that plans recorded now draw from")
    parser.add_argument("--engines", nargs=2, default=("c", "warp"))
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    print(f"{machine()}; {jax.devices()[0].device_kind}; MuJoCo {mujoco.__version__}")
    one, other = arguments.engines
    print(f"| task | plans | success on {one} | on {other} | same verdict | 95 % interval |")
    print("| --- | ---: | ---: | ---: | ---: | --- |")
    pairs: list[tuple[str, Replay, Replay]] = []
    for task in arguments.tasks:
        plans = recorded_plans(
            task,
            arguments.plan_from,
            arguments.plans,
            objects=tuple(arguments.objects) if arguments.objects else None,
            jobs=arguments.jobs,
        )
        # As many worlds as plans: each in its own.
        played = [
            replays(plans, Variation(), len(plans.plans), engine=engine, threads=arguments.jobs)
            for engine in arguments.engines
        ]
        own = [(task, a, b) for a, b in zip(*played, strict=True)]
        print(row(task, own), flush=True)
        pairs += own
    if len(arguments.tasks) > 1:
        print(row("all", pairs))
    for task, a, b in pairs:
        if a.success != b.success:
            print(f"{task}, seed {a.plan}: {one} {verdict(a)}, {other} {verdict(b)}")


def row(name: str, pairs: Sequence[tuple[str, Replay, Replay]]) -> str:
    """Of a table: counts, the share alike, and its interval.

    Args:
      name: Of the row.
      pairs: A task, and the same plan on either engine.
    """
    assert all(a.plan == b.plan for _, a, b in pairs), "replays are of different plans"
    alike, count = sum(a.success == b.success for _, a, b in pairs), len(pairs)
    first, second = (sum(pair[i].success for pair in pairs) for i in (1, 2))
    low, high = wilson_interval(alike, count)
    share = f"{alike / count:.1%} | {low:.1%} to {high:.1%}"
    return f"| {name} | {count} | {first} | {second} | {share} |"


def verdict(replay: Replay) -> str:
    """In a word."""
    if not replay.valid:
        return "does not count"
    return "succeeds" if replay.success else "fails"


if __name__ == "__main__":
    main()
