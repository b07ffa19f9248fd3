"""Stand-ins for a task and its simulation that let sensors and proprioception through, and nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.tasks.core.task import ManipulationTask


class PrivilegedError(AssertionError):
    """Somebody read what no robot knows."""


class DeniedPhysics:
    """A simulation that tells the time."""

    def __init__(self, physics: Any) -> None:
        self._real = physics
        # Only compared with the last one, to find out that a scene was compiled anew.
        self.model = SimpleNamespace(ptr=mujoco.MjModel.from_xml_string("<mujoco/>"))

    @property
    def data(self) -> Any:
        return _TimeOnly(self._real)

    def __getattr__(self, name: str) -> Any:
        raise PrivilegedError(f"physics.{name}")


class _TimeOnly:
    def __init__(self, physics: Any) -> None:
        self._physics = physics

    def __getattr__(self, name: str) -> Any:
        if name != "time":
            raise PrivilegedError(f"physics.data.{name}")
        return self._physics.data.time


class DeniedTask(ManipulationTask):
    """A task that tells its goals and their tolerance, the categories and masks of things, what sensors there are and measure."""

    def __init__(self, task: ManipulationTask) -> None:
        object.__setattr__(self, "_task", task)

    def sample(self, rng: Any, spec: Any, preview: Any) -> Any:
        raise PrivilegedError("task.sample")

    def __getattribute__(self, name: str) -> Any:
        task = object.__getattribute__(self, "_task")
        if name.startswith("__"):
            return object.__getattribute__(self, name)
        if name in ("goals", "furniture_masks", "surroundings_masks", "control_timestep"):
            return getattr(task, name)
        if name == "config":
            return SimpleNamespace(tolerance=task.config.tolerance)
        if name == "robot":
            return _Robot(task.robot)
        if name == "objects":
            return {
                each: SimpleNamespace(asset=_told(entity.asset))
                for each, entity in task.objects.items()
            }
        if name == "task_observables":
            return _Sensors(task.task_observables)
        if name == "env_config":
            names = task.env_config.sensors.camera_names
            return SimpleNamespace(sensors=SimpleNamespace(camera_names=names))
        raise PrivilegedError(f"task.{name}")


def _told(asset: Any) -> SimpleNamespace:
    """The category; the object type as well where the catalogue lacks the category."""
    if asset.category in CATALOGUE:
        return SimpleNamespace(category=asset.category)
    return SimpleNamespace(category=asset.category, object_type=asset.object_type)


class _Robot:
    """Its joints and its gripper's opening."""

    def __init__(self, robot: Any) -> None:
        self._robot = robot

    def configuration(self, physics: Any) -> Any:
        return self._robot.configuration(physics._real)

    def __getattr__(self, name: str) -> Any:
        raise PrivilegedError(f"robot.{name}")


class _Sensors:
    """Depth, segmentation, colours and poses of cameras; none of the true poses."""

    def __init__(self, observables: Any) -> None:
        self._observables = observables

    def __getitem__(self, key: str) -> Any:
        if key.split("/")[0] not in ("depth", "segmentation", "camera", "rgb"):
            raise PrivilegedError(f"task.task_observables[{key!r}]")
        return lambda physics: self._observables[key](physics._real)


def denied(environment: Any) -> Any:
    """An environment of which a baseline gets what a robot has."""
    return SimpleNamespace(
        task=DeniedTask(environment.task), physics=DeniedPhysics(environment.physics)
    )
