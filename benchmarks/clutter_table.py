"""Print how often the baseline succeeds in piles of objects of all categories, true poses, and why not.

    python benchmarks/clutter_table.py --seed 0 --scenes 3 --episodes 1

A scene is twelve test objects of as many random categories, all of which the gripper can hold; the tasks share them.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import tyro
from joblib import Parallel, delayed

from manipose_mj.assets import categories
from manipose_mj.assets.asset import MIN_HELD
from manipose_mj.assets.inventory import audited_grasps
from manipose_mj.errors import InputError
from manipose_mj.evaluation.episode import run_episode
from manipose_mj.evaluation.statistics import wilson_interval
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

TASKS = ("pick", "multi", "stacked", "occluded")
OBJECTS = 12


@dataclass(frozen=True)
class Arguments:
    """Attributes: tasks of the family; seed of objects and starts; scenes of each task; episodes in each; jobs;
    lines: print each episode, as JSON, to the standard error."""

    tasks: tuple[str, ...] = TASKS
    seed: int = 0
    scenes: int = 3
    episodes: int = 1
    jobs: int = 2
    lines: bool = True


@dataclass(frozen=True)
class Outcome:
    """Attributes: task; scene; seed; success; reason: of a failure, with its stage; seconds."""

    task: str
    scene: int
    seed: int
    success: bool
    reason: str
    seconds: float


def main(arguments: Arguments) -> None:
    """Run the episodes and print one row per task, then one per failure."""
    calls = (
        delayed(run_scene)(task, arguments.seed, scene, arguments.episodes)
        for scene in range(arguments.scenes)
        for task in arguments.tasks
    )
    outcomes: list[Outcome] = []
    for some in Parallel(n_jobs=arguments.jobs, return_as="generator_unordered")(calls):
        outcomes += some
        if arguments.lines:
            for outcome in some:
                print(json.dumps(vars(outcome)), file=sys.stderr, flush=True)
    print("\n".join(table(outcomes)))


def scene_objects(seed: int, scene: int) -> tuple[str, ...]:
    """Names of the objects of a scene: test instances of different categories, sorted."""
    rng = np.random.default_rng((seed, scene))
    rigid = [row for row in categories.CATALOGUE.values() if row.object_type != "articulated"]
    chosen: list[str] = []
    for k in rng.permutation(len(rigid)):
        row = rigid[int(k)]
        able = [
            index
            for index in range(row.instances)
            if row.split(index) == "test" and audited_grasps(row.name, index) >= MIN_HELD
        ]
        if able and len(chosen) < OBJECTS:
            chosen.append(row.instance(int(rng.choice(able))))
    return tuple(sorted(chosen))


def run_scene(task: str, seed: int, scene: int, episodes: int) -> list[Outcome]:
    """The outcomes of a scene's episodes; one without a start says so."""
    config = EnvConfig(
        f"clutter/{task}", obs_mode="state", objects=scene_objects(seed, scene), split="test"
    )
    return [_run(config, task, seed, scene, episode) for episode in range(episodes)]


def _run(config: EnvConfig, task: str, seed: int, scene: int, episode: int) -> Outcome:
    number = episode_seed(seed, scene, episode)
    try:
        result, _ = run_episode(config, EpisodeSpec(number), episode=episode)
    except InputError as error:
        return Outcome(task, scene, number, False, f"no start: {error}", 0.0)
    reason = "" if result.success_at_end else f"{result.failure}: {result.reason}"
    return Outcome(task, scene, number, result.success_at_end, reason, result.wall_s)


def episode_seed(seed: int, scene: int, episode: int) -> int:
    """The seed of one episode."""
    return (seed * 1000 + scene) * 100 + episode


def table(outcomes: list[Outcome]) -> Iterator[str]:
    """Lines of Markdown: successes by task, and the reasons of failures."""
    yield "| task | scenes without a start | succeeded | 95 % interval | median wall [s] |"
    yield "| --- | --- | --- | --- | --- |"
    for task in dict.fromkeys(o.task for o in sorted(outcomes, key=lambda o: TASKS.index(o.task))):
        mine = [o for o in outcomes if o.task == task]
        ran = [o for o in mine if o.seconds]
        won = sum(o.success for o in ran)
        low, high = wilson_interval(won, len(ran))
        seconds = np.median([o.seconds for o in ran]) if ran else 0.0
        yield (
            f"| `clutter/{task}` | {len(mine) - len(ran)} | {won} of {len(ran)} "
            f"| {low:.2f} - {high:.2f} | {seconds:.0f} |"
        )
    yield ""
    for outcome in sorted(outcomes, key=lambda o: (TASKS.index(o.task), o.scene, o.seed)):
        if not outcome.success:
            yield f"- `clutter/{outcome.task}`, scene {outcome.scene}, seed {outcome.seed}: {outcome.reason}"


if __name__ == "__main__":
    main(tyro.cli(Arguments))
