"""Print how often a recorded success is one still in another control mode, and back again.

    python benchmarks/experiments/trajectory_conversion.py --episodes 20 --first 0

Recordings in `pd_joint_pos`: successes of the baseline on `single_object/target_pose`; and, because two
modes cannot turn the hand, straight carries of an upright chips can to another upright place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import tyro
from dm_control import composer
from jaxtyping import Float

from manipose_mj import suite
from manipose_mj.actions import CONTROL_MODES
from manipose_mj.actions.tcp_motion import euler_angles
from manipose_mj.assets import catalogue
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.conversion.convert import convert
from manipose_mj.control.conversion.recording import Recording, record
from manipose_mj.control.motion.line_motion import LineConfig, line_poses
from manipose_mj.evaluation.statistics import machine, wilson_interval
from manipose_mj.failures import StageFailure
from manipose_mj.mjcf.panda.robot import MAX_OPENING

TASK = ("single_object", "target_pose")
CANNOT_TURN = ("pd_ee_delta_pos", "pd_ee_target_delta_pos")
_GRASP_DEPTH = 0.025  # of the TCP below the can's top [m]
_CLEARANCE = 0.06  # above the can, and lifted, while moving sideways [m]


@dataclass(frozen=True)
class Arguments:
    """Attributes: episodes: recorded successes of each kind; first: seed; kinds: of recordings; modes:
    to convert into."""

    episodes: int = 20
    first: int = 0
    kinds: tuple[Literal["baseline", "carry"], ...] = ("baseline", "carry")
    modes: tuple[str, ...] = CONTROL_MODES[1:]


def main(arguments: Arguments) -> None:
    """Convert every recording into every mode and back, and print the shares."""
    print(f"{machine()}; seeds from {arguments.first}")
    print(
        "| recordings | mode | same outcome | 95 % interval | and back in pd_joint_pos | length |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    if "baseline" in arguments.kinds:
        environment = suite.load(*TASK, seed=0, obs_mode="state")
        able = tuple(mode for mode in arguments.modes if mode not in CANNOT_TURN)
        recordings = baseline_successes(environment, arguments.first)
        _rows("baseline", environment, recordings, able, arguments.episodes)
    if "carry" in arguments.kinds:
        cans = [catalogue.load("chips_can", index) for index in (0, 1)]
        environment = suite.load(*TASK, seed=0, obs_mode="state", objects=cans)
        recordings = straight_carries(environment, arguments.first)
        _rows("carry", environment, recordings, arguments.modes, arguments.episodes)


def baseline_successes(environment: composer.Environment, first: int) -> Iterator[Recording]:
    """Recorded successes of the baseline, seed after seed."""
    environment.reset()
    baseline = Baseline(environment)
    for seed in range(first, first + 10_000):
        try:
            recording = record(environment, baseline.actions(seed), seed=seed)
        except StageFailure:
            continue
        if recording.success:
            yield recording


def straight_carries(environment: composer.Environment, first: int) -> Iterator[Recording]:
    """Recorded carries of a can from above, the hand pointing down as it does at the start."""
    for seed in range(first, first + 10_000):
        environment.random_state.seed(seed)
        environment.reset()
        start, goal = _label_poses(environment)
        # Both ways up the can looks alike, but it must not change sides.
        if start[2, 0] * goal[2, 0] < 0.9:
            continue
        actions = record(environment, _carry(environment), seed=seed, mode="pd_ee_pose")
        recording = convert(environment, actions, "pd_joint_pos")
        if recording.success:
            yield recording


def _label_poses(
    environment: composer.Environment,
) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "4 4"]]:
    task = environment.task
    return task.object.label_pose(environment.physics), task.goals[0].pose


def _carry(environment: composer.Environment) -> Iterator[Float[np.ndarray, "7"]]:
    """Actions of `pd_ee_pose` that take the can, carry it straight and let go of it."""
    task, physics = environment.task, environment.physics
    start, goal = _label_poses(environment)
    length, width = task.object.asset.label.extents[:2]
    above = np.array([0.0, 0.0, _CLEARANCE])
    take = start[:3, 3] + [0.0, 0.0, length / 2 - _GRASP_DEPTH]
    put = goal[:3, 3] + [0.0, 0.0, length / 2 - _GRASP_DEPTH + 0.001]
    open_again = min(width + 0.012, MAX_OPENING)
    here = task.robot.tcp_pose(physics)
    for place, opening, wait in (
        (take + above, MAX_OPENING, 10),
        (take, MAX_OPENING, 15),
        (take, 0.0, 50),
        (take + above, 0.0, 10),
        (put + above, 0.0, 20),
        (put, 0.0, 20),
        (put, open_again, 40),
        (put + above, open_again, 40),
    ):
        there = here.copy()
        there[:3, 3] = place
        for pose in line_poses(here, there, task.control_timestep, LineConfig()):
            yield _action(pose, opening)
        for _ in range(wait):
            yield _action(there, opening)
        here = there


def _action(pose: Float[np.ndarray, "4 4"], opening: float) -> Float[np.ndarray, "7"]:
    return np.concatenate([pose[:3, 3], euler_angles(pose[:3, :3]), [opening]])


def _rows(
    kind: str,
    environment: composer.Environment,
    recordings: Iterator[Recording],
    modes: tuple[str, ...],
    episodes: int,
) -> None:
    same, back, length = Counter[str](), Counter[str](), Counter[str]()
    recorded = 0
    for _, recording in zip(range(episodes), recordings, strict=False):
        recorded += len(recording.actions)
        for mode in modes:
            converted = convert(environment, recording, mode)
            same[mode] += converted.success
            back[mode] += convert(environment, converted, "pd_joint_pos").success
            length[mode] += len(converted.actions)
            if not converted.success:
                print(f"{kind}: seed {recording.seed} fails in {mode}", flush=True)
    for mode in modes:
        low, high = wilson_interval(same[mode], episodes)
        print(
            f"| {kind} | `{mode}` | {same[mode]} / {episodes} | {low:.2f} - {high:.2f} "
            f"| {back[mode]} / {episodes} | {length[mode] / recorded:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main(tyro.cli(Arguments))
