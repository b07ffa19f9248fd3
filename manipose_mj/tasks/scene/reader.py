"""Reads the state of a composer task's scene, whichever of its objects are in play."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from dm_control import mjcf

from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda.robot import Panda
from manipose_mj.tasks.scene.indices import find_indices, shapes_of
from manipose_mj.tasks.scene.read import PhysicsArrays, read
from manipose_mj.tasks.scene.state import SceneState


class SceneReader:
    """Looks up indices once per compiled model, and picks those of the objects in play."""

    def __init__(
        self,
        physics: mjcf.Physics,
        robot: Panda,
        objects: Sequence[RigidObject],
        articulated: Sequence[ArticulatedObject],
    ) -> None:
        """Look up the objects and parts that may be in play."""
        self._model = physics.model.ptr
        named = {str(i): entity for i, entity in enumerate(objects)}
        self._indices = find_indices(physics, robot, named, articulated)
        self._shapes = shapes_of(objects, articulated)
        self._rows = {entity: i for i, entity in enumerate(objects)}
        self._owners = [entity for entity in articulated for _ in entity.asset.parts]
        self._chosen, self._in_play = (self._indices, self._shapes), None
        self._data, self._arrays = physics.data.ptr, _without_contacts(physics)

    def reads(self, physics: mjcf.Physics) -> bool:
        """Whether this is the model it was made for."""
        return physics.model.ptr is self._model

    def read(
        self,
        physics: mjcf.Physics,
        objects: Mapping[str, RigidObject],
        articulated: Sequence[ArticulatedObject],
    ) -> SceneState:
        """The state now; poses are those of the last forward kinematics.

        Args:
          physics: Of the model it was made for.
          objects: Those in play, by the names that goals use.
          articulated: Those in play.
        """
        in_play = (tuple(objects.items()), tuple(articulated))
        if in_play != self._in_play:
            rows = {name: self._rows[entity] for name, entity in objects.items()}
            parts = [i for i, owner in enumerate(self._owners) if owner in articulated]
            self._chosen = (
                self._indices.select(rows, parts),
                self._shapes.select(list(rows.values()), parts),
            )
            self._in_play = in_play
        data = physics.data.ptr
        if data is not self._data:
            self._data, self._arrays = data, _without_contacts(physics)
        now = self._arrays
        if data.ncon:
            now = now._replace(contact_geoms=data.contact.geom)
        return read(*self._chosen, now)


def arrays(physics: mjcf.Physics) -> PhysicsArrays:
    """Views of the simulator's arrays; all but the contacts stay valid as long as its data lives."""
    data = physics.data.ptr
    return PhysicsArrays(
        qpos=data.qpos,
        qvel=data.qvel,
        xpos=data.xpos,
        xmat=data.xmat.reshape(-1, 3, 3),
        site_xpos=data.site_xpos,
        site_xmat=data.site_xmat.reshape(-1, 3, 3),
        contact_geoms=data.contact.geom,
    )


def _without_contacts(physics: mjcf.Physics) -> PhysicsArrays:
    return arrays(physics)._replace(contact_geoms=np.empty((0, 2), np.int32))
