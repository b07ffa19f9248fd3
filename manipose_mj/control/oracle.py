"""The oracle's senses: true poses, read from the simulator."""

from __future__ import annotations

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import GraspSet, MovingPart
from manipose_mj.control.belief import Belief, ObjectBelief, PartBelief
from manipose_mj.control.planning_scene import PlanningScene, subtree_geoms
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.poses import invert
from manipose_mj.tasks.base import ManipulationTask


class OracleSenses:
    """Beliefs that are true; for `pose="oracle"` only."""

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics, scene: PlanningScene) -> None:
        self._task = task
        self._physics = physics
        self._scene = scene

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m]."""
        return self._task.robot.configuration(self._physics)

    def look(self) -> Belief:
        """The state of the simulator as a belief; the planning scene is synchronised."""
        physics = self._physics
        self._scene.synchronise(physics.model.ptr, physics.data.qpos)
        joints, opening = self.robot()
        objects = {name: self._object(name, entity) for name, entity in self._task.movable.items()}
        parts = {
            part.name: part
            for furniture in self._task.furnishings
            for part in self._parts(furniture, objects)
        }
        return Belief(joints, opening, objects, parts)

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

    def _parts(
        self, furniture: ArticulatedObject, objects: dict[str, ObjectBelief]
    ) -> list[PartBelief]:
        found = []
        for part in furniture.asset.parts:
            if part.handle is None:
                continue
            element = furniture.mjcf_model.find("body", part.name)
            body = int(self._physics.bind(element).element_id)
            found.append(
                PartBelief(
                    name=part.name,
                    base_pose=furniture.base_pose(self._physics),
                    pose=furniture.part_pose(self._physics, part.name),
                    opening=furniture.opening(self._physics, part.name),
                    joint=part.joint,
                    handle=part.handle,
                    cavity=part.cavity,
                    body=body,
                    geoms=subtree_geoms(self._scene.model, body),
                    contents=self._contents(furniture, part, objects),
                )
            )
        return found

    def _contents(
        self, furniture: ArticulatedObject, part: MovingPart, objects: dict[str, ObjectBelief]
    ) -> tuple[int, ...]:
        """Bodies of the objects whose label origin lies in a drawer's cavity."""
        if part.cavity is None or not part.cavity.moves_with_part:
            return ()
        to_cavity = invert(furniture.cavity_pose(self._physics, part.name))
        inside = []
        for thing in objects.values():
            if (np.abs((to_cavity @ thing.label_pose)[:3, 3]) < part.cavity.extents / 2).all():
                inside.append(thing.body)
        return tuple(inside)
