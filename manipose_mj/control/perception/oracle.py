"""The oracle's perception: true poses, read from the simulator."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import GraspSet
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.perception.furniture_perception import TrueFurniture
from manipose_mj.control.perception.objects.colour_words import surface_colour_words
from manipose_mj.control.scene.collision_model import CollisionModel, subtree_geoms
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.tasks.core.task import ManipulationTask


class OraclePerception:
    """Estimates that are exact; for `pose="oracle"` only."""

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics) -> None:
        """Copies the model of the environment's scene."""
        self._task = task
        self._physics = physics
        self._model = CollisionModel(physics.model.ptr, task.robot.mjcf_model.model)
        self._furniture = TrueFurniture(task, physics)
        self._arm = ArmModel(task.root_entity.mjcf_model, task.robot.mjcf_model.model)
        self._colours: dict[str, str] = {}
        self.sources: Mapping[str, str] = {"objects": "true", "furniture": self._furniture.source}

    feels_joints = False
    looks_by_hand = False
    unseen: frozenset[str] = frozenset()

    @property
    def arm(self) -> ArmModel:
        """The arm in the simulator's scene."""
        return self._arm

    def reset(self, seed: int, *, for_goals: bool = True) -> None:
        """Nothing to prepare: only colours are remembered, nothing is random."""
        self._colours = {}

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m]."""
        return self._task.robot.configuration(self._physics)

    def observe(self) -> SceneEstimate:
        """The state of the simulator as an estimate."""
        physics = self._physics
        positions = self._model.positions_of(physics.model.ptr, physics.data.qpos)
        scene = PlanningScene(self._model, positions)
        joints, opening = self.robot()
        objects = {name: self._object(name, entity) for name, entity in self._task.objects.items()}
        parts = self._furniture.parts(scene, objects)
        return SceneEstimate(joints, opening, objects, parts, scene)

    def hold(self, name: str | None) -> None:
        """Nothing to remember: what is held is seen."""

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """Nothing to learn."""

    def pushed(self, name: str, opening: float) -> None:
        """Nothing to learn."""

    def look_around(self) -> None:
        """Nothing is hidden or uncertain."""

    def look_again(self) -> None:
        """Nothing is hidden."""

    def look_closely(self) -> None:
        """Nothing is hidden."""

    def _object(self, name: str, entity: RigidObject) -> ObjectEstimate:
        frame = mjcf.get_attachment_frame(entity.mjcf_model)
        body = int(self._physics.bind(frame).element_id)
        count = len(entity.asset.stable_poses)
        none = GraspSet(np.empty((0, 4, 4)), np.empty(0), np.empty((0, count), bool))
        return ObjectEstimate(
            name=name,
            pose=entity.object_pose(self._physics),
            label=entity.asset.label,
            sample_grasps=lambda: entity.asset.grasps or none,
            body=body,
            geoms=subtree_geoms(self._model.model, body),
            rests=entity.asset.stable_poses,
            category=entity.asset.category,
            find_colours=partial(self._colours_of, name, body),
        )

    def _colours_of(self, name: str, body: int) -> str:
        """Of the object's materials and textures."""
        if name not in self._colours:
            model = self._physics.model.ptr
            self._colours[name] = surface_colour_words(model, subtree_geoms(model, body))
        return self._colours[name]
