"""Tasks: what stands in the world, how an episode starts, when it succeeds, what is observed.

    from manipose_mj.tasks import EnvConfig, ManipulationTask, PoseGoal

| folder | holds |
|---|---|
| `core/` | configuration, the contract of a task, starts of episodes, the environment, the registry |
| `scene/` | pools of objects and furniture, resting poses, the state of a scene |
| `goals/` | goals, success and reward as functions of the state |
| `observations/` | cameras, clouds, poses, and their noise |
| `single_object/`, `clutter/`, `articulated/` | the three families |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
    from manipose_mj.tasks.core.environment import TaskEnvironment
    from manipose_mj.tasks.core.preview import Preview
    from manipose_mj.tasks.core.registry import TaskSpec, register_task
    from manipose_mj.tasks.core.scene import Scene
    from manipose_mj.tasks.core.start import EpisodeStart, PlacedFurniture, PlacedObject
    from manipose_mj.tasks.core.task import ManipulationTask
    from manipose_mj.tasks.goals import (
        Goal,
        InsideGoal,
        OnTableGoal,
        OpenGoal,
        OrientationGoal,
        PoseGoal,
        ShutGoal,
        TakenOutGoal,
        UprightGoal,
    )
    from manipose_mj.tasks.goals.conditions import Tolerance
    from manipose_mj.tasks.observations.sensor_config import CameraView, PoseNoise, SensorConfig
    from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState

__all__ = [
    "CameraView",
    "EnvConfig",
    "EpisodeSpec",
    "EpisodeStart",
    "Goal",
    "InsideGoal",
    "ManipulationTask",
    "ObjectState",
    "OnTableGoal",
    "OpenGoal",
    "OrientationGoal",
    "PartState",
    "PlacedFurniture",
    "PlacedObject",
    "PoseGoal",
    "PoseNoise",
    "Preview",
    "Scene",
    "SceneState",
    "SensorConfig",
    "ShutGoal",
    "TakenOutGoal",
    "TaskConfig",
    "TaskEnvironment",
    "TaskSpec",
    "Tolerance",
    "UprightGoal",
    "register_task",
]

__getattr__ = lazy_exports(__name__, __file__)
