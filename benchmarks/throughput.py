"""Print how fast the tasks reset, step and see on one core, beside other benchmarks' tasks.

python benchmarks/throughput.py [--only TASK ...] [--episodes N]
python benchmarks/throughput.py --engine warp|c --only TASK [--worlds N ...]: see batch_throughput.py

All in one run: compare ratios. Times are CPU time, which other programs do not stretch as they do the clock's. Ours keep
the objects of their first episode; `experiments/scene_swaps.py` times resets to others. Others are measured where they are installed and run: dm_control's
`stack_2_bricks_features` (always), Gymnasium-Robotics' FetchPickAndPlace, robosuite's Lift. Every
environment is stepped with state observations under small random actions, ten control steps at a time in
turn with the others, so that a busy machine slows all alike; the median is reported.
"""

from __future__ import annotations

import argparse
import functools
import importlib.util
import platform
import resource
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import batch_throughput
import mujoco
import numpy as np
from dm_control import manipulation

from manipose_mj import suite
from manipose_mj.evaluation.statistics import machine
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.observations.sensors import SensorConfig

RESETS = 30
TURNS, STEPS = 40, 10
CLOUDS = 20
REFERENCE = "dm_control stack_2_bricks_features"


@dataclass(frozen=True)
class Runner:
    """Attributes: name; step, one control step; substeps, physics steps in it; reset."""

    name: str
    step: Callable[[], object]
    substeps: int
    reset: Callable[[], object]


def main() -> None:
    """Print a row for each environment, then the cloud's time, then growth over many episodes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[], help="domain/task")
    parser.add_argument("--episodes", type=int, default=0, help="look for growth over so many")
    batch_throughput.add_arguments(parser)
    arguments = parser.parse_args()
    if arguments.engine:
        for task in arguments.only:
            batch_throughput.measure(task, arguments)
        return
    tasks = [t for t in suite.ALL_TASKS if not arguments.only or "/".join(t) in arguments.only]
    print(f"{machine()}; Python {platform.python_version()}, MuJoCo {mujoco.__version__}")
    runners = [_reference(), *_others(), *(_ours(*task) for task in tasks)]
    for runner in runners:
        runner.reset()
    rates = _rates(runners)
    print("| environment | reset, median [ms] | physics steps/s | of dm_control's |")
    print("| --- | --- | --- | --- |")
    for runner in runners:
        resets = [_milliseconds(runner.reset) for _ in range(RESETS)]
        share = rates[runner.name] / rates[REFERENCE]
        print(
            f"| {runner.name} | {statistics.median(resets):.0f} | {rates[runner.name]:,.0f} | {share:.2f} |"
        )
    print("| task | cloud of 3 cameras at 160x120, no GL [ms] |")
    print("| --- | --- |")
    for task in tasks:
        print(f"| {'/'.join(task)} | {_cloud(*task):.1f} |")
    if arguments.episodes:
        for task in tasks:
            _growth(task, arguments.episodes)


def _rates(runners: list[Runner]) -> dict[str, float]:
    """Physics steps a second, the median of all turns."""
    seconds: dict[str, list[float]] = {runner.name: [] for runner in runners}
    for _ in range(TURNS):
        for runner in runners:
            started = time.process_time()
            for _ in range(STEPS):
                runner.step()
            seconds[runner.name].append(time.process_time() - started)
    return {r.name: STEPS * r.substeps / statistics.median(seconds[r.name]) for r in runners}


def _ours(domain: str, task: str) -> Runner:
    environment = _same_objects(domain, task, obs_mode="state")
    joints, opening = environment.task.robot.configuration(environment.physics)
    home, rng = np.append(joints, opening), np.random.default_rng(0)
    limits = environment.action_spec()

    def step() -> None:
        action = home + rng.normal(0, 0.05, 8) * ([1.0] * 7 + [0.2])
        environment.step(np.clip(action, limits.minimum, limits.maximum))

    substeps = environment.task.physics_steps_per_control_step
    return Runner(f"{domain}/{task}", step, substeps, environment.reset)


def _same_objects(domain: str, task: str, **options: Any) -> TaskEnvironment:
    """A task after a reset, whose episodes all have the objects of the first."""
    first = suite.load(domain, task, seed=0, obs_mode="state")
    first.reset()
    drawn = first.scene_objects
    objects = None if drawn is None else drawn.assets
    first.close()
    environment = suite.load(domain, task, seed=0, objects=objects, **options)
    environment.reset()
    return environment


def _reference() -> Runner:
    environment = manipulation.load("stack_2_bricks_features", seed=0)
    environment.reset()
    limits, rng = environment.action_spec(), np.random.default_rng(0)

    def step() -> None:
        # Velocities, of which the whole range would throw the bricks about.
        environment.step(rng.uniform(0.2 * limits.minimum, 0.2 * limits.maximum))

    return Runner(
        REFERENCE, step, environment.task.physics_steps_per_control_step, environment.reset
    )


def _others() -> list[Runner]:
    """Other packages' tasks; a line about each that is installed but does not run beside this MuJoCo."""
    found = []
    for package, build in (("gymnasium_robotics", _fetch), ("robosuite", _lift)):
        if importlib.util.find_spec(package) is None:
            continue
        try:
            found.append(build())
        except Exception as error:  # whatever another package raises
            print(f"{package}: left out ({type(error).__name__}: {str(error) or 'no message'})")
    return found


def _fetch() -> Runner:
    import gymnasium
    import gymnasium_robotics

    gymnasium.register_envs(gymnasium_robotics)
    fetch = gymnasium.make("FetchPickAndPlace-v4")
    step = functools.partial(_gym_step, fetch)
    substeps = fetch.unwrapped.n_substeps
    return Runner("Gymnasium-Robotics FetchPickAndPlace", step, substeps, fetch.reset)


def _lift() -> Runner:
    import robosuite

    lift = robosuite.make(
        "Lift", robots="Panda", has_renderer=False, use_camera_obs=False,
        has_offscreen_renderer=False,
    )  # fmt: skip
    low, high = lift.action_spec
    rng = np.random.default_rng(0)

    def step() -> None:
        lift.step(rng.uniform(0.2 * low, 0.2 * high))

    substeps = round(lift.control_timestep / lift.model_timestep)
    return Runner("robosuite Lift", step, substeps, lift.reset)


def _gym_step(environment) -> None:
    if any(environment.step(0.2 * environment.action_space.sample())[2:4]):
        environment.reset()


def _cloud(domain: str, task: str) -> float:
    """Median time of the fused cloud [ms], every time of another moment."""
    sensors = SensorConfig(height=120, width=160)
    environment = _same_objects(domain, task, obs_mode="pointcloud", sensors=sensors)
    joints, opening = environment.task.robot.configuration(environment.physics)
    blind = _same_objects(domain, task, obs_mode="state")
    action, taken = np.append(joints, opening), []
    for _ in range(CLOUDS):
        with_cloud = _milliseconds(functools.partial(environment.step, action))
        taken.append(with_cloud - _milliseconds(functools.partial(blind.step, action)))
    return statistics.median(taken)


def _growth(task: tuple[str, str], episodes: int) -> None:
    """Print how reset times and memory change over many episodes."""
    environment = _same_objects(*task, obs_mode="state")
    resets, memory = [], []
    for _ in range(episodes):
        resets.append(_milliseconds(environment.reset))
        memory.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    tenth = max(1, episodes // 10)
    first, last = statistics.median(resets[:tenth]), statistics.median(resets[-tenth:])
    print(
        f"{'/'.join(task)}: {episodes} episodes, reset {first:.1f} ms in the first tenth, "
        f"{last:.1f} ms in the last; peak memory {memory[tenth]:.0f} MB, then {memory[-1]:.0f} MB"
    )


def _milliseconds(work: Callable[[], object]) -> float:
    started = time.process_time()
    work()
    return (time.process_time() - started) * 1e3


if __name__ == "__main__":
    main()
