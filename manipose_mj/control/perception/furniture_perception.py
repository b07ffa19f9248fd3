"""Drawers and doors as the simulator has them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from dm_control import mjcf

from manipose_mj.assets.asset import MovingPart
from manipose_mj.control.scene.collision_model import subtree_geoms
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate
from manipose_mj.mjcf.objects import ArticulatedObject
from manipose_mj.poses import invert
from manipose_mj.tasks.core.task import ManipulationTask


class TrueFurniture:
    """Furniture as the simulator has it."""

    source = "true"

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics) -> None:
        self._task = task
        self._physics = physics

    def parts(
        self, scene: PlanningScene, objects: Mapping[str, ObjectEstimate]
    ) -> dict[str, PartEstimate]:
        """All of them, true."""
        return {
            part.name: self._part(furniture, part, scene, objects)
            for furniture in self._task.articulated_objects
            for part in furniture.asset.parts
            if part.handle is not None
        }

    def _part(
        self,
        furniture: ArticulatedObject,
        part: MovingPart,
        scene: PlanningScene,
        objects: Mapping[str, ObjectEstimate],
    ) -> PartEstimate:
        assert part.handle is not None
        element = furniture.mjcf_model.find("body", part.name)
        body = int(scene.model.body(element.full_identifier).id)
        return PartEstimate(
            name=part.name,
            base_pose=furniture.base_pose(self._physics),
            pose=furniture.part_pose(self._physics, part.name),
            opening=furniture.opening(self._physics, part.name),
            joint=part.joint,
            handle=part.handle,
            cavity=part.cavity,
            body=body,
            geoms=subtree_geoms(scene.model, body),
            bodies_inside=self._bodies_inside(furniture, part, objects),
        )

    def _bodies_inside(
        self, furniture: ArticulatedObject, part: MovingPart, objects: Mapping[str, ObjectEstimate]
    ) -> tuple[int, ...]:
        """Bodies of the objects whose label origin lies in a drawer's cavity."""
        if part.cavity is None or not part.cavity.moves_with_part:
            return ()
        to_cavity = invert(furniture.cavity_pose(self._physics, part.name))
        inside = []
        for obj in objects.values():
            if (np.abs((to_cavity @ obj.label_pose)[:3, 3]) < part.cavity.extents / 2).all():
                inside.append(obj.body)
        return tuple(inside)
