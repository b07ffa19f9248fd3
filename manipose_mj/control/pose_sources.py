"""The names of where a baseline's poses come from, and the senses and sensors of each."""

from __future__ import annotations

from dm_control import mjcf

from manipose_mj.control.belief import Senses
from manipose_mj.control.estimated import SENSORS, EstimatedSenses
from manipose_mj.control.oracle import OracleSenses
from manipose_mj.control.planning_scene import PlanningScene
from manipose_mj.errors import unknown_name
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.sensor_config import SensorConfig

POSE_SOURCES = ("oracle", "estimated")


def check_pose_source(pose: str) -> None:
    """Raise `InputError` where there is no such source; the nearest is offered."""
    if pose not in POSE_SOURCES:
        raise unknown_name("pose source", pose, POSE_SOURCES)


def sensors_for(pose: str) -> SensorConfig | None:
    """What the environment of such a baseline has to measure; None: nothing in particular."""
    return SENSORS if pose == "estimated" else None


def make_senses(pose: str, task: ManipulationTask, physics: mjcf.Physics) -> Senses:
    """The senses of one environment.

    Raises:
      InputError: There is no such source.
    """
    check_pose_source(pose)
    if pose == "estimated":
        return EstimatedSenses(task, physics)
    model, robot = physics.model.ptr, task.robot.mjcf_model.model
    scene = PlanningScene(model, model.body(f"{robot}/").id, model.body(f"{robot}/hand").id)
    return OracleSenses(task, physics, scene)
