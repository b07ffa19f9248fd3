"""Print how often parts come open whose joints are estimated wrongly, with and without feeling the way.

    python benchmarks/experiments/joint_errors.py --seeds 2

Everything is estimated from clouds; on top, the axis of every joint is turned by an angle about the way out of the
front, or, of a drawer, about the vertical. `followed` corrects the joint by the way that the hand goes, `as planned`
does not.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.furniture.sensing.part_sensing import SensedFurniture, sense_parts
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.perception import pose_sources
from manipose_mj.control.perception.sensed_world import SensedWorld
from manipose_mj.failures import StageFailure
from manipose_mj.poses import rotation_about
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

TASKS = ("articulated/open_middle_drawer", "articulated/open_cabinet_door")
ANGLES = (0, 10, 20, 30)  # [deg]
UP = np.array([0.0, 0.0, 1.0])


def turned(degrees: float):
    """A sensor of parts whose joints are off by so much."""

    def sense(cloud: SceneCloud, camera_pose: np.ndarray, key: Any) -> SensedFurniture:
        found = sense_parts(cloud, camera_pose, key)
        parts = []
        for part in found.parts:
            about = UP if part.kind == "slide" else found.front
            axis = rotation_about(about, np.radians(degrees)) @ part.axis
            parts.append(replace(part, axis=axis))
        return replace(found, parts=tuple(parts))

    return sense


class Stiff(SensedWorld):
    """Parts are led as their joints are estimated."""

    feels_joints = False


def opened(environment: Any, seed: int, degrees: float, world: type[SensedWorld]) -> bool:
    """Whether an episode succeeds."""
    environment.reset(EpisodeSpec(seed))
    make = pose_sources.SensedWorld
    pose_sources.SensedWorld = lambda *a: world(*a, turned(degrees))  # pyright: ignore
    try:
        baseline = Baseline(environment, "estimated")
    finally:
        pose_sources.SensedWorld = make  # pyright: ignore
    try:
        for action in baseline.actions(seed, plans=2):
            environment.step(action)
    except StageFailure as failure:
        print(f"    {failure}")
    return environment.task.succeeded(environment.physics)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2, help="episodes of each kind")
    arguments = parser.parse_args()
    for task in TASKS:
        sensors = pose_sources.sensors_for("estimated")
        environment = suite.make(EnvConfig(task, obs_mode="state", sensors=sensors), 0)
        for degrees in ANGLES:
            for name, world in (("followed", SensedWorld), ("as planned", Stiff)):
                good = [opened(environment, s, degrees, world) for s in range(arguments.seeds)]
                print(f"{task} {degrees} deg {name}: {sum(good)} of {len(good)}", flush=True)


if __name__ == "__main__":
    main()
