"""What tasks share that bring an object into or out of a cavity that a drawer or door shuts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable
from jaxtyping import Float

from asset_pipeline.assets import Asset, MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.contents import Contents, Lain
from manipose_mj.tasks.furniture import FurniturePool, Standing, side
from manipose_mj.tasks.object_pool import ObjectPool
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.part_choice import PartChoice
from manipose_mj.tasks.posed_things import Carried


class CavityTask(ManipulationTask):
    """Furniture with a part that shuts a cavity, an object for it, and others that lie in it.

    Subclasses call `_finish_build` once their scene is complete, and `_draw_scene` before anything
    else in `place_objects`.
    """

    def __init__(
        self,
        objects: Sequence[Asset],
        furniture: Sequence[Asset],
        choice: PartChoice,
        config: TaskConfig,
        options: TaskOptions,
        *,
        standing: Standing,
        max_fillers: int,
        taken: bool,
    ) -> None:
        """Build furniture and objects.

        Args:
          objects: Of which an episode is about one.
          furniture: Of which an episode uses one.
          choice: The part in question.
          config: Of the task.
          options: Of the user.
          standing: Where the furniture stands.
          max_fillers: How many other objects may lie in the cavity.
          taken: Whether the object is taken out of the cavity, rather than put in.

        Raises:
          InputError: An object fits no cavity, or a part has none.
        """
        super().__init__(config, options)
        self._furniture = FurniturePool(furniture, choice, standing, self._arena, hollow=True)
        self._pool = ObjectPool(objects, self._arena)
        self._contents = Contents(self._pool, self._furniture, taken=taken)
        for entity in (*self._furniture.entities, *self._pool.entities):
            self._instances[entity.mjcf_model.model] = entity
        self._max_fillers = max_fillers
        self._active = self._piece = 0
        self._fillers: tuple[int, ...] = ()

    def _finish_build(
        self, pose_observables: Mapping[str, observable.Observable] | None = None
    ) -> None:
        opening = observable.Generic(lambda p: self._furniture.opening(p, self._piece))
        super()._finish_build({"opening": opening, **(pose_observables or {})})

    @property
    def object(self) -> RigidObject:
        """The object of this episode."""
        return self._pool.entities[self._active]

    @property
    def furniture(self) -> ArticulatedObject:
        """The piece of furniture of this episode."""
        return self._furniture.entities[self._piece]

    @property
    def part(self) -> MovingPart:
        """The drawer or door that shuts the cavity."""
        return self._furniture.parts[self._piece]

    @property
    def object_name(self) -> str:
        return self.object.asset.name

    @property
    def landmarks(self) -> Mapping[str, Carried]:
        return self._furniture.landmarks(self._piece)

    @property
    def object_slots(self) -> tuple[str, ...]:
        return ("object", *(f"filler_{k}" for k in range(self._max_fillers)))

    @property
    def movable(self) -> dict[str, RigidObject]:
        others = {f"filler_{k}": self._pool.entities[i] for k, i in enumerate(self._fillers)}
        return {"object": self.object, **others}

    @property
    def furnishings(self) -> tuple[ArticulatedObject, ...]:
        return (self.furniture,)

    def cavity_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part in question."""
        return self._furniture.cavity_pose(physics, self._piece)

    def _draw_scene(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Choose furniture and object, and stand the furniture on the table, its parts shut."""
        self._piece = int(random_state.randint(len(self._furniture.entities)))
        self._active = self._contents.draw(random_state, self._piece)
        self._furniture.place(physics, random_state, self._piece)

    def _draw_place(
        self,
        random_state: np.random.RandomState,
        x_range: tuple[float, float],
        y_range: tuple[float, float],
    ) -> Float[np.ndarray, "2"]:
        """A place on the table [m], y mirrored for doors hinged on the right."""
        place = np.array([random_state.uniform(*x_range), random_state.uniform(*y_range)])
        place[1] *= side(self.part)
        return place

    def _draw_fillers(
        self,
        physics: mjcf.Physics,
        random_state: np.random.RandomState,
        lain: Lain | None = None,
    ) -> dict[int, Float[np.ndarray, "4 4"]]:
        """Choose other objects for the cavity, and park all that the episode does not use.

        Args:
          physics: Of the scene.
          random_state: Draws how many, which and where.
          lain: Where the object lies in the cavity; None: room is kept for it.

        Returns:
          Their indices in the pool, with `T_cavity_object` of each.
        """
        count = int(random_state.randint(self._max_fillers + 1))
        fillers = self._contents.beside(random_state, self._piece, self._active, count, lain)
        self._fillers = tuple(fillers)
        self._pool.use(physics, (self._active, *fillers))
        return fillers

    def _lay_inside(
        self, physics: mjcf.Physics, poses: Mapping[int, Float[np.ndarray, "4 4"]]
    ) -> None:
        """Put objects of the pool at their `T_cavity_object`."""
        physics.forward()
        cavity = self.cavity_pose(physics)
        for index, pose in poses.items():
            self._pool.entities[index].place(physics, cavity @ pose)
