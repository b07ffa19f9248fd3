"""Print how long a reset takes that changes to other objects: python benchmarks/experiments/scene_swaps.py [--count 12]

CPU time of one process, which other processes of the machine do not change. All objects are built before. A reset of the
tasks with several objects is to the next seed, which draws others; where there is furniture, to the next piece too. `first`
is the first scene with an object or a piece in this process, which also finds where furniture can stand; `again` is the
same in a second environment, which knows no scene yet.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.evaluation.statistics import machine
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.registry import named_task
from manipose_mj.tasks.core.scene_source import SceneSource

RIGID = ("single_object/target_pose", "single_object/position")
CLUTTER = ("clutter/pick", "clutter/stacked")
FURNITURE = (
    "articulated/open_cabinet_door",
    "articulated/open_microwave",
    "articulated/open_oven",
    "articulated/store_cabinet_door",
    "articulated/store_microwave",
    "articulated/take_out_cabinet_door",
    "articulated/take_out_microwave",
)
SPLIT = "test"


def main() -> None:
    """Print a row a task."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=12, help="objects of each task")
    count = parser.parse_args().count
    print(f"{machine()}; CPU time of resets that change the scene")
    print("| task | first, median [s] | again, median [s] | again, longest [s] |")
    print("| --- | ---: | ---: | ---: |")
    for task in RIGID:
        print(row(task, [EpisodeSpec(0, object=name) for name in firsts_of_categories(count)]))
    for task in CLUTTER:
        print(row(task, built(task, [EpisodeSpec(seed) for seed in range(count)])))
    for task in FURNITURE:
        print(row(task, built(task, pieces(task))))


def row(task: str, specs: Sequence[EpisodeSpec]) -> str:
    """A line of the table."""
    domain, name = task.split("/")
    first, again = (
        swap_times(suite.load(domain, name, seed=0, obs_mode="state", split=SPLIT), specs)
        for _ in range(2)
    )
    figures = statistics.median(first), statistics.median(again), max(again)
    return f"| `{task}` | " + " | ".join(f"{each:.2f}" for each in figures) + " |"


def swap_times(environment: TaskEnvironment, specs: Sequence[EpisodeSpec]) -> list[float]:
    """CPU time of a reset to each of some episodes, one after the other [s]."""
    times = []
    for spec in specs:
        started = time.process_time()
        environment.reset(spec)
        times.append(time.process_time() - started)
    return times


def firsts_of_categories(count: int) -> list[str]:
    """The first test object of categories spread over the catalogue, built."""
    rows = [row for row in CATALOGUE.values() if row.object_type != "articulated"]
    rows = [row for row in rows if row.name != "plate"]
    chosen = rows[:: max(1, len(rows) // count)][:count]
    found = []
    for row in chosen:
        held_out = next(i for i in range(row.instances) if row.split(i) == SPLIT)
        found.append(catalogue.load(row.name, held_out).name)
    return found


def pieces(task: str) -> list[EpisodeSpec]:
    """Every piece of furniture that a task takes, with the first of the parts that it may be about; each with a seed."""
    return [replace(group[0], seed=i) for i, group in enumerate(_scenes(task).strata())]


def built(task: str, specs: Sequence[EpisodeSpec]) -> Sequence[EpisodeSpec]:
    """The same episodes, with all the objects that they draw built."""
    scenes = _scenes(task)
    for spec in specs:
        scenes.draw(np.random.RandomState(spec.seed), spec)
    return specs


def _scenes(task: str) -> SceneSource:
    return SceneSource(named_task(task), EnvConfig(task, obs_mode="state", split=SPLIT))


if __name__ == "__main__":
    main()
