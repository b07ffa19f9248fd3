"""Compare sources of grasps: `single_object/target_pose` with estimated poses, one object a category, one start each.

python benchmarks/experiments/grasp_sources.py                      # every second category, number 9 of each, cloud and shape
python benchmarks/experiments/grasp_sources.py --every 1 --number 14 --grasps annotated shape cloud
"""

from __future__ import annotations

import logging
import sys
from collections import Counter
from dataclasses import dataclass

import tyro

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.control.perception.source_names import GraspSource
from manipose_mj.evaluation import episode
from manipose_mj.evaluation.records import EpisodeResult
from manipose_mj.evaluation.statistics import wilson_interval
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

TASK = "single_object/target_pose"


@dataclass(frozen=True)
class Arguments:
    """Attributes: grasps: to compare; number: of the test object in its category; seed: of the start; every: so many
    categories one, the first left out unless all are taken."""

    grasps: tuple[GraspSource, ...] = ("cloud", "shape")
    number: int = 9
    seed: int = 21
    every: int = 2


def main(arguments: Arguments) -> None:
    """Play, and print a line an episode and a row a source."""
    logging.getLogger("absl").setLevel(logging.ERROR)
    rigid = [name for name, row in CATALOGUE.items() if row.object_type != "articulated"]
    rows = []
    for source in arguments.grasps:
        results = [
            _played(f"{name}_{arguments.number:03d}", source, arguments.seed)
            for name in rigid[arguments.every - 1 :: arguments.every]
        ]
        won = sum(result.success_at_end for result in results)
        low, high = wilson_interval(won, len(results))
        stages = Counter(result.failure for result in results if result.failure)
        failures = ", ".join(f"{count} {stage}" for stage, count in sorted(stages.items()))
        rows.append(
            f"| `{source}` | {won} / {len(results)} | {100 * low:.0f} - {100 * high:.0f} % | {failures} |"
        )
    print("| grasps | success at end | Wilson 95 % | failures |")
    print("| --- | --- | --- | --- |")
    print("\n".join(rows))


def _played(name: str, source: GraspSource, seed: int) -> EpisodeResult:
    config = EnvConfig(
        TASK, obs_mode="state", objects=(name,), split="test", sensors=sensors_for("estimated")
    )
    result, _ = episode.run_episode(config, EpisodeSpec(seed), pose="estimated", grasps=source)
    sys.stderr.write(f"{source} {name}: {result.failure or 'success'} {result.reason}\n")
    # One scene after the other, each of one object: none is needed again.
    episode.environment_of.cache_clear()
    return result


if __name__ == "__main__":
    main(tyro.cli(Arguments))
