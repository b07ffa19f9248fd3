"""`articulated/store_*`: open a drawer or door, put an object behind it, shut it.

`store_chips_can_middle_drawer` is the paper's headline experiment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable
from jaxtyping import Float

from asset_pipeline.assets import Asset, MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.contents import Contents, starts
from manipose_mj.tasks.furniture import FurniturePool, Standing, side
from manipose_mj.tasks.goals import Goal, InsideGoal, ShutGoal
from manipose_mj.tasks.object_pool import ObjectPool
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.part_choice import PartChoice
from manipose_mj.tasks.posed_things import Carried
from manipose_mj.tasks.target_pose import pose_on_table


@dataclass(frozen=True)
class StoreConfig(TaskConfig):
    """Attributes: standing: where the furniture stands; x_range, y_range: where the object's label
    origin may start [m], y mirrored for doors hinged on the right; max_fillers: how many other
    objects may lie in the cavity already; shut: by which fraction of its range a door must be shut
    in the end; None: to within the tolerance, as a drawer."""

    horizon: float = 90.0
    standing: Standing = Standing()
    x_range: tuple[float, float] = (0.32, 0.48)
    y_range: tuple[float, float] = (-0.42, -0.28)
    max_fillers: int = 0
    shut: float | None = None


class Store(ManipulationTask):
    """Open the part, put the object inside, let go, shut the part.

    Success: the whole object is in the part's cavity, at rest and released, and the part is shut.
    """

    def __init__(
        self,
        objects: Sequence[Asset],
        furniture: Sequence[Asset],
        choice: PartChoice,
        config: StoreConfig | None = None,
        options: TaskOptions | None = None,
    ) -> None:
        """Raises InputError where an object fits no cavity, or a part has none."""
        self.task_config = config or StoreConfig()
        super().__init__(self.task_config, options or TaskOptions())
        self._furniture = FurniturePool(
            furniture, choice, self.task_config.standing, self._arena, hollow=True
        )
        self._pool = ObjectPool(objects, self._arena)
        self._contents = Contents(self._pool, self._furniture, taken=False)
        for entity in (*self._furniture.entities, *self._pool.entities):
            self._instances[entity.mjcf_model.model] = entity
        self._active = self._piece = 0
        self._fillers: tuple[int, ...] = ()
        self._finish_build(
            {"opening": observable.Generic(lambda p: self._furniture.opening(p, self._piece))}
        )

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
        """Where the object goes."""
        return self._furniture.parts[self._piece]

    @property
    def object_name(self) -> str:
        return self.object.asset.name

    @property
    def goals(self) -> tuple[Goal, ...]:
        name = self.part.name
        return (InsideGoal("object", name), ShutGoal(name, self.task_config.shut))

    @property
    def landmarks(self) -> Mapping[str, Carried]:
        return self._furniture.landmarks(self._piece)

    @property
    def object_slots(self) -> tuple[str, ...]:
        fillers = range(self.task_config.max_fillers)
        return ("object", *(f"filler_{k}" for k in fillers))

    @property
    def movable(self) -> dict[str, RigidObject]:
        others = {f"filler_{k}": self._pool.entities[i] for k, i in enumerate(self._fillers)}
        return {"object": self.object, **others}

    @property
    def furnishings(self) -> tuple[ArticulatedObject, ...]:
        return (self.furniture,)

    def cavity_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part that this task stores behind."""
        return self._furniture.cavity_pose(physics, self._piece)

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        config = self.task_config
        self._piece = _draw(random_state, len(self._furniture.entities))
        self._active = self._contents.draw(random_state, self._piece)
        self._furniture.place(physics, random_state, self._piece)
        asset = self.object.asset
        possible = starts(asset)
        start = possible[random_state.randint(len(possible))]
        xy = np.array(
            [random_state.uniform(*config.x_range), random_state.uniform(*config.y_range)]
        )
        xy[1] *= side(self.part)
        pose = pose_on_table(asset, start, xy, random_state.uniform(-np.pi, np.pi))
        count = _draw(random_state, config.max_fillers + 1)
        fillers = self._contents.beside(random_state, self._piece, self._active, count)
        self._fillers = tuple(fillers)
        self._pool.use(physics, (self._active, *fillers))
        self.object.place(physics, pose)
        physics.forward()
        cavity = self.cavity_pose(physics)
        for index, pose_cavity in fillers.items():
            self._pool.entities[index].place(physics, cavity @ pose_cavity)


def _draw(random_state: np.random.RandomState, count: int) -> int:
    """One of `count`; no random number is spent where there is no choice."""
    return int(random_state.randint(count)) if count > 1 else 0
