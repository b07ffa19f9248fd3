"""The oracle's senses: true poses, read from the simulator."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import GraspSet
from manipose_mj.control.belief import Belief, ObjectBelief
from manipose_mj.control.furniture_senses import TrueFurniture
from manipose_mj.control.planning_scene import PlanningScene, subtree_geoms
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.tasks.base import ManipulationTask


class OracleSenses:
    """Beliefs that are true; for `pose="oracle"` only."""

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics, scene: PlanningScene) -> None:
        self._task = task
        self._physics = physics
        self._scene = scene
        self._furniture = TrueFurniture(task, physics)
        self.sources: Mapping[str, str] = {"objects": "true", "furniture": self._furniture.source}

    def begin(self, seed: int) -> PlanningScene:
        """The scene that never changes."""
        return self._scene

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m]."""
        return self._task.robot.configuration(self._physics)

    def look(self) -> Belief:
        """The state of the simulator as a belief; the planning scene is synchronised."""
        physics = self._physics
        self._scene.synchronise(physics.model.ptr, physics.data.qpos)
        joints, opening = self.robot()
        objects = {name: self._object(name, entity) for name, entity in self._task.movable.items()}
        return Belief(joints, opening, objects, self._furniture.parts(self._scene, objects))

    def hold(self, name: str | None) -> None:
        """Nothing to remember: what is held is seen."""

    def _object(self, name: str, entity: RigidObject) -> ObjectBelief:
        frame = mjcf.get_attachment_frame(entity.mjcf_model)
        body = int(self._physics.bind(frame).element_id)
        count = len(entity.asset.stable_poses)
        none = GraspSet(np.empty((0, 4, 4)), np.empty(0), np.empty((0, count), bool))
        return ObjectBelief(
            name=name,
            pose=entity.object_pose(self._physics),
            label=entity.asset.label,
            grasps=entity.asset.grasps or none,
            body=body,
            geoms=subtree_geoms(self._scene.model, body),
            rests=entity.asset.stable_poses,
        )
