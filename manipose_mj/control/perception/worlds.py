"""What estimated objects stand in: the scene of the simulator, or one made of what cameras see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.perception.estimated_scene import EstimatedScene, EstimatedScenes
from manipose_mj.control.perception.furniture_perception import TrueFurniture
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate
from manipose_mj.tasks.core.task import ManipulationTask

Poses = Mapping[str, Float[np.ndarray, "4 4"]]
Hulls = Mapping[str, Sequence[Float[np.ndarray, "_ 3"]]]


class World(Protocol):
    """Robot, furniture and surroundings of an episode.

    Attributes:
      source: `"true"` or `"estimated"`, of furniture and surroundings, for reports.
      feels_joints: Whether joints are corrected by what the hand feels.
    """

    source: str
    feels_joints: bool

    @property
    def arm(self) -> ArmModel:
        """The arm among it."""
        ...

    def reset(self, key: Any) -> None:
        """An episode begins."""
        ...

    def build(self, shapes: Hulls) -> None:
        """Compile the scene anew, with bodies for objects; vertices of their convex parts [m]."""
        ...

    def body(self, name: str) -> int:
        """The body that stands for an object."""
        ...

    def observed(
        self,
        joints: Float[np.ndarray, "7"],
        opening: float,
        poses: Mapping[str, Float[np.ndarray, "4 4"]],
    ) -> PlanningScene:
        """The scene now, objects at these `T_world_label`."""
        ...

    def parts(
        self, scene: PlanningScene, objects: Mapping[str, ObjectEstimate]
    ) -> dict[str, PartEstimate]:
        """Drawers and doors, by name."""
        ...

    def follow(
        self, tcp_pose: Float[np.ndarray, "4 4"], objects: Poses
    ) -> dict[str, Float[np.ndarray, "4 4"]]:
        """Time has passed: find out how far parts are open, with the TCP at `T_world_tcp`.

        Returns:
          Poses, by name, of those objects that have gone along with a drawer.
        """
        ...

    def hold(self, name: str | None, tcp_pose: Float[np.ndarray, "4 4"]) -> None:
        """The hand at `T_world_tcp` holds a part's handle from now on, or something else."""
        ...

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """The hand led a part along a path, world frame [m]; `stopped`: it went no further."""
        ...

    def pushed(self, name: str, opening: float) -> None:
        """The hand pushed a part to about this opening [m or rad]."""
        ...

    def look_again(self, key: Any) -> None:
        """Measure what open parts show; `build` comes next."""
        ...


class SimulatedWorld:
    """Furniture and surroundings as the simulator has them."""

    source = "true"
    feels_joints = False

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics) -> None:
        self._physics = physics
        root, robot = task.root_entity.mjcf_model, task.robot.mjcf_model.model
        self._scenes = EstimatedScenes(root, robot)
        self._arm = ArmModel(root, robot)
        self._furniture = TrueFurniture(task, physics)
        self._scene: EstimatedScene | None = None

    @property
    def arm(self) -> ArmModel:
        """The arm in the simulator's scene."""
        return self._arm

    def reset(self, key: Any) -> None:
        """Nothing to estimate."""

    def build(self, shapes: Hulls) -> None:
        """A scene with these objects."""
        self._scene = self._scenes.build(shapes)

    def body(self, name: str) -> int:
        """The body that stands for an object."""
        return self._built.body(name)

    def observed(
        self,
        joints: Float[np.ndarray, "7"],
        opening: float,
        poses: Mapping[str, Float[np.ndarray, "4 4"]],
    ) -> PlanningScene:
        """Everything but objects as the simulator has it."""
        physics = self._physics
        return self._built.observed(physics.model.ptr, physics.data.qpos, poses)

    def parts(
        self, scene: PlanningScene, objects: Mapping[str, ObjectEstimate]
    ) -> dict[str, PartEstimate]:
        """All of them, true."""
        return self._furniture.parts(scene, objects)

    def follow(
        self, tcp_pose: Float[np.ndarray, "4 4"], objects: Poses
    ) -> dict[str, Float[np.ndarray, "4 4"]]:
        """Nothing to find out."""
        return {}

    def hold(self, name: str | None, tcp_pose: Float[np.ndarray, "4 4"]) -> None:
        """Nothing to remember."""

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """Nothing to learn."""

    def pushed(self, name: str, opening: float) -> None:
        """Nothing to learn."""

    def look_again(self, key: Any) -> None:
        """Nothing new to see."""

    @property
    def _built(self) -> EstimatedScene:
        assert self._scene is not None  # reset comes first
        return self._scene
