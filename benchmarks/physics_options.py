"""Print what friction by the no-slip solver or by a stiffer constraint costs, and how well either holds.

python benchmarks/physics_options.py [--objects NAME ...]

Every object is grasped, lifted and held for five seconds under each setting in turn; a cabinet stands shut for as
long. All in one run: compare ratios.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from dm_control import composer

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution.executor import Executor
from manipose_mj.control.execution.primitives import Primitives, retraction_of
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.poses import invert, rotation_angle
from manipose_mj.tasks.core.config import EpisodeSpec

# `impratio` and iterations of the no-slip solver.
SETTINGS = ((10.0, 10), (10.0, 0), (100.0, 0))
HELD = 5.0  # [s]
OBJECTS = ("box_000", "chips_can_000", "mug_000", "hammer_000", "bowl_000", "remote_000")


@dataclass(frozen=True)
class Hold:
    """Attributes: slip [mm] and turn [deg] in the hand; penetration, the deepest [mm]; rate, physics steps a second."""

    slip: float
    turn: float
    penetration: float
    rate: float


def hold(environment: composer.Environment, name: str, setting: tuple[float, int]) -> Hold:
    """Grasp an object, lift it and wait."""
    environment.reset(EpisodeSpec(0, object=name))
    set_friction(environment, setting)
    task, physics = environment.task, environment.physics
    baseline = Baseline(environment)
    executor = Executor(baseline.perception, task.control_timestep)
    scene = executor.observe().scene
    rng = np.random.default_rng(0)
    planner = MotionPlanner(scene, baseline.arm, task.control_timestep, rng)
    primitives = Primitives(executor)

    def play(actions: Iterator) -> int:
        count = 0
        for action in actions:
            environment.step(action)
            count += 1
        return count * task.physics_steps_per_control_step

    def in_hand() -> np.ndarray:
        return invert(task.robot.tcp_pose(physics)) @ task.object.object_pose(physics)

    play(primitives.grasp_at(planner, "object", None))
    estimate = executor.observe()
    play(executor.follow(retraction_of(planner.within(estimate.scene), estimate, "object")))
    play(executor.wait(0.5))
    before, start = in_hand(), time.process_time()
    steps = play(executor.wait(HELD))
    rate = steps / (time.process_time() - start)
    after = in_hand()
    return Hold(
        slip=1000 * float(np.linalg.norm(after[:3, 3] - before[:3, 3])),
        turn=float(np.degrees(rotation_angle(after[:3, :3], before[:3, :3]))),
        penetration=1000 * task.max_penetration,
        rate=rate,
    )


def drift(environment: composer.Environment, setting: tuple[float, int]) -> float:
    """By how much any part of a shut cabinet opens by itself [mm or mrad]."""
    environment.reset(EpisodeSpec(0))
    set_friction(environment, setting)
    task, physics = environment.task, environment.physics
    joints = [task.furniture.joint(part.name) for part in task.furniture.asset.parts]
    before = np.array(physics.bind(joints).qpos)
    action = np.append(*task.robot.configuration(physics))
    for _ in range(round(HELD / task.control_timestep)):
        environment.step(action)
    return 1000 * float(np.abs(np.array(physics.bind(joints).qpos) - before).max())


def set_friction(environment: composer.Environment, setting: tuple[float, int]) -> None:
    """Change the compiled model's options."""
    option = environment.physics.model.ptr.opt
    option.impratio, option.noslip_iterations = setting


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--objects", nargs="+", default=OBJECTS, metavar="NAME")
    names = parser.parse_args().objects
    environment = suite.load("single_object", "target_pose", 0, obs_mode="state", objects=names)
    cabinet = suite.load(
        "articulated", "open_top_drawer", 0, obs_mode="state", objects=["cabinet_000"]
    )
    print("impratio, no-slip | object | slip mm | turn deg | penetration mm | steps/s")
    for name in names:
        for setting in SETTINGS:
            held = hold(environment, name, setting)
            print(
                f"{setting[0]:g}, {setting[1]} | {name} | {held.slip:.3f} | {held.turn:.3f} | "
                f"{held.penetration:.2f} | {held.rate:.0f}",
                flush=True,
            )
    for setting in SETTINGS:
        print(
            f"{setting[0]:g}, {setting[1]} | shut cabinet opens by {drift(cabinet, setting):.4f} mm"
        )


if __name__ == "__main__":
    main()
