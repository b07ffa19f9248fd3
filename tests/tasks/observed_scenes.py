"""Two tasks with small sensors, ideal and noisy, for tests of what is observed."""

from __future__ import annotations

import numpy as np
from dm_control import composer

from manipose_mj.tasks.observations.sensors import MODES, CameraView, PoseNoise, SensorConfig
from tests import few_objects

TARGET_POSE = ("single_object", "target_pose")
STORE = ("articulated", "store_chips_can_middle_drawer")
EVERYTHING = "+".join(MODES)
ABOVE = CameraView("above", (0.5, 0.0, 1.3), (0.5, 0.0, 0.0), 60.0)
SMALL = SensorConfig(
    cameras=("left", ABOVE),
    height=60,
    width=80,
    cloud_size=2048,
    object_cloud_size=64,
    renderer="ray",
)
NOISY = SensorConfig(
    cameras=("left", ABOVE),
    height=60,
    width=80,
    cloud_size=2048,
    object_cloud_size=64,
    renderer="ray",
    depth_model="structured_light",
    pose_noise=PoseNoise(0.004, 0.02),
)


def load(
    task: tuple[str, str], observations: str, sensors: SensorConfig = SMALL, seed: int = 0
) -> composer.Environment:
    """The environment of a task, by domain and name."""
    return few_objects.load(*task, seed=seed, obs_mode=observations, sensors=sensors)


def hold(environment: composer.Environment) -> np.ndarray:
    """The action `(8,)` that keeps the robot where it is."""
    joints, opening = environment.task.robot.configuration(environment.physics)
    return np.append(joints, opening)
