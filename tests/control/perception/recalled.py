"""An estimator that knows its answers, and a perception that asks it."""

from __future__ import annotations

from typing import Any

import numpy as np

from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.poses import invert
from manipose_mj.ppf_jax.estimator import PoseEstimate
from manipose_mj.tasks.core.config import EnvConfig

TARGET_POSE = "single_object/target_pose"
CUP = "cup_004"  # a test object: no training saw it, nor is it a known shape


class Recalled:
    """An estimator that answers with what it was told, whatever it sees."""

    def __init__(
        self, pose_world: np.ndarray, extents: np.ndarray, confidence: float = 1.0
    ) -> None:
        self.pose_world, self.extents, self.confidence = pose_world, extents, confidence
        self.asked = 0

    def estimate(self, cloud: Any, *, key: Any) -> PoseEstimate:
        self.asked += 1
        pose = invert(cloud.T_world_camera) @ self.pose_world
        return PoseEstimate(pose, self.extents, self.confidence)


def config_of(name: str) -> EnvConfig:
    return EnvConfig(
        TARGET_POSE, obs_mode="state", objects=(name,), sensors=sensors_for("estimated")
    )


def perception_of(environment, estimator) -> EstimatedPerception:
    return EstimatedPerception(
        environment.task, environment.physics, estimators=lambda _: estimator
    )
