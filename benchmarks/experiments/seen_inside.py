"""How far off estimates are of objects in drawers and behind doors that stand open, by which cameras look.

    python -m benchmarks.experiments.seen_inside [--episodes 8] [--resample 310]

Starts are those of protocol v1's tasks that take out, with other seeds if `--resample` says so. The part is set open, the
hand to where the baseline would bring it to look in there. Every object counts, goal or not; one that shows too few points
counts as flipped. Right is within 15 deg and 2 cm, flipped beyond 90 deg.
"""

from __future__ import annotations

import argparse
import logging
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.experiments.object_estimates import Estimated, line, started
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution.looking import way_to_look_into
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception.camera_rig import CAMERAS, HAND_CAMERA
from manipose_mj.control.perception.objects.object_views import ObjectView, ObjectViews
from manipose_mj.control.perception.pose_sensing import MIN_VIEW_POINTS, random_keys
from manipose_mj.evaluation.protocol.frozen import Protocol, load
from manipose_mj.poses import invert, pose_error, pose_to_vector
from manipose_mj.ppf_jax.fused_views import FusedViewEstimator
from manipose_mj.tasks.core.environment import TaskEnvironment

OPEN = 0.9  # of a part's range, doors up to WIDEST [rad]
WIDEST = 1.9
LEAST = 8  # points of a camera that counts
RIGS = ("three usual", "all standing", "and the hand's", "the hand's alone")


def open_part(environment: TaskEnvironment) -> None:
    """Set the part in question open; what lies in a drawer goes with it."""
    task, physics = environment.task, environment.physics
    low, high = task.part.joint.range
    travel = min(high - low, WIDEST) if task.part.joint.kind == "hinge" else high - low
    before = task.cavity_pose(physics)
    physics.bind(task.furniture.joint(task.part.name)).qpos = low + OPEN * travel
    physics.forward()
    motion = task.cavity_pose(physics) @ invert(before)
    for entity in task.objects.values():
        moved = motion @ entity.object_pose(physics)
        physics.bind(entity.free_joint).qpos = pose_to_vector(moved)
    physics.forward()


def look_inside(environment: TaskEnvironment) -> bool:
    """Set the arm to where the hand's camera looks into the open part; whether there is such a place."""
    task, physics = environment.task, environment.physics
    baseline = Baseline(environment)
    estimate = baseline.perception.observe()
    rng = np.random.default_rng(0)
    planner = MotionPlanner(estimate.scene, baseline.arm, task.control_timestep, rng)
    way = way_to_look_into(planner, estimate, estimate.parts[task.part.name])
    if way is not None:
        task.robot.set_configuration(physics, way[-1], 0.08)
    physics.forward()
    physics.data.time += task.control_timestep  # sensors are read once a time
    return way is not None


def estimates(
    protocol: Protocol, task: str, number: int, resample: int | None
) -> Iterator[tuple[str, Estimated]]:
    """Of every object, by each rig."""
    environment = started(protocol, task, number, resample)
    open_part(environment)
    if not look_inside(environment):
        print(f"{task} {number}: the hand cannot look in", flush=True)
    physics, keys = environment.physics, random_keys(0)
    views = ObjectViews(
        environment.task.task_observables, environment.task.env_config.sensors.camera_names
    )
    for name, entity in environment.task.objects.items():
        seen, label = views.of(physics, name), entity.asset.label
        truth = entity.object_pose(physics) @ label.pose
        for rig, used in zip(RIGS, _of_rigs(seen), strict=True):
            wrong = Estimated(task, label.object_type, np.inf, np.inf, 0.0)
            if sum(map(len, used)) < MIN_VIEW_POINTS:
                yield rig, wrong
                continue
            frames = np.stack([view.T_world_camera for view in used])
            estimator = FusedViewEstimator.load(entity.asset.category)
            found = estimator.estimate_views(used, frames, key=keys())
            shift, turn = pose_error(found.pose, truth, label.symmetry)
            yield rig, replace(wrong, shift=shift, turn=turn, confidence=found.confidence)


def _of_rigs(seen: tuple[ObjectView, ...]) -> Iterator[list[ObjectView]]:
    seen = tuple(view for view in seen if len(view) >= LEAST)
    yield [view for view in seen if view.camera in CAMERAS]
    yield [view for view in seen if view.camera != HAND_CAMERA]
    yield list(seen)
    yield [view for view in seen if view.camera == HAND_CAMERA]


def main() -> None:
    """Print a table of the rigs, and one of the tasks with all cameras."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--episodes", type=int, default=8)
    parser.add_argument("--resample", type=int, default=None, metavar="SEED")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    protocol = load("v1")
    by_name: dict[str, list[Estimated]] = defaultdict(list)
    for task in (name for name in protocol.tasks if "/take_out_" in name):
        for number in range(options.episodes):
            for rig, row in estimates(protocol, task, number, options.resample):
                by_name[rig].append(row)
                if rig == RIGS[2]:
                    by_name[task].append(row)
    print(
        f"{'':28} {'n':>5} {'right':>7} {'flipped':>8} {'deg':>6} {'cm':>6}  confidence > 0.9: right"
    )
    for name in (*RIGS, *sorted(by_name.keys() - set(RIGS))):
        print(line(name, by_name[name]))


if __name__ == "__main__":
    main()
