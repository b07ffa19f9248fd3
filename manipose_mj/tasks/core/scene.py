"""What stands in a task's world: the table, the robot, and what the task adds; written, never drawn, here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset
from manipose_mj.mjcf.arena import TableArena
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda.robot import Panda, Visuals
from manipose_mj.poses import compose
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.scene.furniture_pool import FurniturePool
from manipose_mj.tasks.scene.object_pool import ObjectPool

_OUT_OF_SIGHT = compose(np.eye(3), np.array([0.0, 0.0, 60.0]))


class Fixture(Protocol):
    """An entity that stands where an episode says, and does not move by itself."""

    def place(self, physics: mjcf.Physics, pose: Float[np.ndarray, "4 4"]) -> None:
        """Put it at `T_world_fixture`."""
        ...


class Scene:
    """The world of a task, complete before it is compiled: a reset compiles nothing.

    Attributes:
      arena: The table with lights and cameras.
      robot: At the table's edge, in the world's origin.
      objects: The rigid objects, of which an episode uses some.
      furniture: The articulated objects, likewise.
      fixtures: What every episode puts in its place, such as shelves and goal markers.
      instances: What segmentation tells apart, by name, counted from 1.
    """

    def __init__(self, robot_visuals: Visuals = "primitive") -> None:
        """The table and the robot, drawn as `Panda` says."""
        self.arena = TableArena()
        self.robot = Panda(robot_visuals)
        self.arena.attach(self.robot)
        self.objects: ObjectPool | None = None
        self.furniture: FurniturePool | None = None
        self.instances: dict[str, composer.Entity] = {"robot": self.robot}
        self.fixtures: dict[str, Fixture] = {}

    def add_objects(self, assets: Sequence[Asset]) -> ObjectPool:
        """Add the rigid objects that episodes may use; once.

        Raises:
          InputError: There is none, or one of them is articulated.
        """
        assert self.objects is None, "the scene has its objects already"
        self.objects = ObjectPool(assets, self.arena)
        self.instances.update({e.mjcf_model.model: e for e in self.objects.entities})
        return self.objects

    def add_furniture(self, assets: Sequence[Asset]) -> FurniturePool:
        """Add the articulated objects that episodes may use; once.

        Args:
          assets: Articulated ones.

        Raises:
          InputError: There is none, or one of them is rigid.
        """
        assert self.furniture is None, "the scene has its furniture already"
        self.furniture = FurniturePool(assets, self.arena)
        self.instances.update({e.mjcf_model.model: e for e in self.furniture.entities})
        return self.furniture

    def add_fixture(self, name: str, entity: composer.Entity, *, seen: bool = False) -> None:
        """Add something that every episode puts in its place, such as a shelf or a goal marker.

        Args:
          name: What an episode's start calls it.
          entity: With a method `place(physics, pose)`.
          seen: Whether segmentation tells it apart, by this name.
        """
        self.arena.attach(entity)
        self.fixtures[name] = entity  # pyright: ignore[reportArgumentType]
        if seen:
            self.instances[name] = entity

    @property
    def rigid_objects(self) -> tuple[RigidObject, ...]:
        """All of them, in play or waiting."""
        return () if self.objects is None else self.objects.entities

    @property
    def articulated_objects(self) -> tuple[ArticulatedObject, ...]:
        """All of them, in play or waiting."""
        return () if self.furniture is None else self.furniture.entities

    @property
    def masks(self) -> dict[composer.Entity, int]:
        """Id in segmentations of what they tell apart."""
        return {entity: number for number, entity in enumerate(self.instances.values(), start=1)}

    def write(self, physics: mjcf.Physics, start: EpisodeStart) -> None:
        """Put everything where an episode starts; the robot and the model's changes are not touched.

        `physics` is not brought up to date: call `forward` after it, with static bodies awake.
        """
        mount = start.mount
        self.arena.stand_robot(
            physics, mount.height, table=mount.table, side_table=mount.side_table
        )
        if self.furniture is not None:
            self.furniture.park(physics)
            for piece in start.furniture:
                self.furniture.place(
                    physics, piece.index, piece.position, piece.quaternion, raised=piece.raised
                )
                for part, opening in piece.openings.items():
                    self.furniture.open(physics, piece.index, part, opening)
        if self.objects is not None:
            self.objects.use(physics, tuple(placed.index for placed in start.objects.values()))
            for placed in start.objects.values():
                self.objects.entities[placed.index].place(physics, placed.pose)
        for name, fixture in self.fixtures.items():
            fixture.place(physics, start.fixtures.get(name, _OUT_OF_SIGHT))
