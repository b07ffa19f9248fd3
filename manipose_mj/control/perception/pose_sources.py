"""The names of where a baseline's poses come from, and the perception and sensors of each."""

from __future__ import annotations

from dm_control import mjcf

from manipose_mj.control.perception.estimated import SENSORS, EstimatedPerception
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.scene.scene_estimate import Perception
from manipose_mj.errors import unknown_name
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.observations.sensor_config import SensorConfig

POSE_SOURCES = ("oracle", "estimated")


def check_pose_source(pose: str) -> None:
    """Raise `InputError` where there is no such source; the nearest is offered."""
    if pose not in POSE_SOURCES:
        raise unknown_name("pose source", pose, POSE_SOURCES)


def sensors_for(pose: str) -> SensorConfig:
    """What the environment of such a baseline has to measure."""
    return SENSORS if pose == "estimated" else SensorConfig()


def make_perception(pose: str, task: ManipulationTask, physics: mjcf.Physics) -> Perception:
    """The perception of one environment.

    Raises:
      InputError: There is no such source.
    """
    check_pose_source(pose)
    if pose == "estimated":
        return EstimatedPerception(task, physics)
    return OraclePerception(task, physics)
