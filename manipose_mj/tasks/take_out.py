"""`articulated/take_out_*`: open a drawer or door, bring an object out onto the table, shut it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import Asset
from manipose_mj.mjcf.goal_area import GoalArea
from manipose_mj.poses import compose
from manipose_mj.tasks.cavity_task import CavityTask
from manipose_mj.tasks.furniture import Standing
from manipose_mj.tasks.goals import Goal, ShutGoal, TakenOutGoal
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.part_choice import PartChoice


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


class TakeOut(CavityTask):
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
        super().__init__(
            objects,
            furniture,
            choice,
            self.task_config,
            options or TaskOptions(),
            standing=self.task_config.standing,
            max_fillers=self.task_config.max_fillers,
            taken=True,
        )
        self._marker = GoalArea(half_sides=self.task_config.area)
        self._arena.attach(self._marker)
        self._center = np.zeros(2)
        self._finish_build()

    @property
    def goals(self) -> tuple[Goal, ...]:
        name = self.part.name
        half = np.array(self.task_config.area)
        return (
            TakenOutGoal("object", name, self._center.copy(), half),
            ShutGoal(name, self.task_config.shut),
        )

    def _goal_pose(self) -> Float[np.ndarray, "4 4"]:
        """A frame in the middle of the goal area, Z up."""
        return compose(np.eye(3), np.array([*self._center, 0.0]))

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        config = self.task_config
        self._draw_scene(physics, random_state)
        self._center = self._draw_place(random_state, config.x_range, config.y_range)
        self._marker.place(physics, self._goal_pose())
        lain, pose = self._contents.inside(
            random_state, self._piece, self._active, front=config.front, room=config.room
        )
        fillers = self._draw_fillers(physics, random_state, lain)
        self._lay_inside(physics, {self._active: pose, **fillers})
