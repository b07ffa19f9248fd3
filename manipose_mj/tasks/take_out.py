"""`articulated/take_out_*`: open a drawer or door, bring an object out onto the table, shut it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable
from jaxtyping import Float

from asset_pipeline.assets import Asset, MovingPart
from manipose_mj.mjcf.goal_area import GoalArea
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.poses import compose
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.contents import Contents
from manipose_mj.tasks.furniture import FurniturePool, Standing, side
from manipose_mj.tasks.goals import Goal, ShutGoal, TakenOutGoal
from manipose_mj.tasks.object_pool import ObjectPool
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.part_choice import PartChoice
from manipose_mj.tasks.posed_things import Carried


@dataclass(frozen=True)
class TakeOutConfig(TaskConfig):
    """Attributes: standing: where the furniture stands; x_range, y_range: where the middle of the
    goal area may be [m], y mirrored for doors hinged on the right; area: half its sides [m];
    front: how far from the cavity's open side the object may lie [m]; room: between it and the
    walls, where there is that much, and other objects [m]; max_fillers: how many other
    objects may lie in the cavity; shut: by which fraction of its range a door must be shut in the
    end; None: to within the tolerance, as a drawer."""

    horizon: float = 90.0
    standing: Standing = Standing()
    x_range: tuple[float, float] = (0.36, 0.46)
    y_range: tuple[float, float] = (-0.40, -0.30)
    area: tuple[float, float] = (0.08, 0.08)
    front: float = 0.02
    room: float = 0.035
    max_fillers: int = 0
    shut: float | None = None


class TakeOut(ManipulationTask):
    """Open the part, take the object out, set it down in the marked area, shut the part.

    Success: the object is out of the cavity, rests on the table in the goal area, released, and the
    part is shut.
    """

    def __init__(
        self,
        objects: Sequence[Asset],
        furniture: Sequence[Asset],
        choice: PartChoice,
        config: TakeOutConfig | None = None,
        options: TaskOptions | None = None,
    ) -> None:
        """Raises InputError where an object fits no cavity, or a part has none."""
        self.task_config = config or TakeOutConfig()
        super().__init__(self.task_config, options or TaskOptions())
        self._furniture = FurniturePool(
            furniture, choice, self.task_config.standing, self._arena, hollow=True
        )
        self._pool = ObjectPool(objects, self._arena)
        self._contents = Contents(self._pool, self._furniture, taken=True)
        for entity in (*self._furniture.entities, *self._pool.entities):
            self._instances[entity.mjcf_model.model] = entity
        self._marker = GoalArea(half_sides=self.task_config.area)
        self._arena.attach(self._marker)
        self._active = self._piece = 0
        self._fillers: tuple[int, ...] = ()
        self._center = np.zeros(2)
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
        """Where the object comes from."""
        return self._furniture.parts[self._piece]

    @property
    def object_name(self) -> str:
        return self.object.asset.name

    @property
    def goals(self) -> tuple[Goal, ...]:
        name = self.part.name
        half = np.array(self.task_config.area)
        return (
            TakenOutGoal("object", name, self._center.copy(), half),
            ShutGoal(name, self.task_config.shut),
        )

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
        """`T_world_cavity` of the part that this task takes out of."""
        return self._furniture.cavity_pose(physics, self._piece)

    def _goal_pose(self) -> Float[np.ndarray, "4 4"]:
        """A frame in the middle of the goal area, Z up."""
        return compose(np.eye(3), np.array([*self._center, 0.0]))

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        config = self.task_config
        self._piece = int(random_state.randint(len(self._furniture.entities)))
        self._active = self._contents.draw(random_state, self._piece)
        self._furniture.place(physics, random_state, self._piece)
        self._center = np.array(
            [random_state.uniform(*config.x_range), random_state.uniform(*config.y_range)]
        )
        self._center[1] *= side(self.part)
        self._marker.place(physics, self._goal_pose())
        lain, pose = self._contents.inside(
            random_state, self._piece, self._active, front=config.front, room=config.room
        )
        count = int(random_state.randint(config.max_fillers + 1))
        fillers = self._contents.beside(random_state, self._piece, self._active, count, lain)
        self._fillers = tuple(fillers)
        self._pool.use(physics, (self._active, *fillers))
        physics.forward()
        cavity = self.cavity_pose(physics)
        for index, pose_cavity in {self._active: pose, **fillers}.items():
            self._pool.entities[index].place(physics, cavity @ pose_cavity)
