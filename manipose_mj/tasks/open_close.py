"""`articulated/open_*` and `articulated/close_*`: move one drawer or door, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable

from asset_pipeline.assets import Asset, MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.furniture import FurniturePool, Standing
from manipose_mj.tasks.goals import Goal, OpenGoal, ShutGoal
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.part_choice import PartChoice
from manipose_mj.tasks.posed_things import Carried


@dataclass(frozen=True)
class OpenCloseConfig(TaskConfig):
    """Attributes: wanted: what shall become of the part; fraction: of its joint's range that counts
    as open, or as shut; start_open: how far open it is when it is to be closed, of its range;
    standing: where the furniture stands."""

    horizon: float = 40.0
    wanted: Literal["open", "shut"] = "open"
    fraction: float = 0.9
    start_open: tuple[float, float] = (0.6, 1.0)
    standing: Standing = Standing()


class OpenClose(ManipulationTask):
    """Open a shut drawer or door, or shut an open one.

    Success: the joint is open, or shut, by the fraction of its range that the configuration says.
    """

    def __init__(
        self,
        furniture: Sequence[Asset],
        choice: PartChoice,
        config: OpenCloseConfig | None = None,
        options: TaskOptions | None = None,
    ) -> None:
        self.task_config = config or OpenCloseConfig()
        super().__init__(self.task_config, options or TaskOptions())
        self._pool = FurniturePool(
            furniture, choice, self.task_config.standing, self._arena, hollow=False
        )
        self._instances.update({e.mjcf_model.model: e for e in self._pool.entities})
        self._active = 0
        self._finish_build(
            {"opening": observable.Generic(lambda p: self._pool.opening(p, self._active))}
        )

    @property
    def furniture(self) -> ArticulatedObject:
        """The piece of furniture of this episode."""
        return self._pool.entities[self._active]

    @property
    def part(self) -> MovingPart:
        """What is to be moved."""
        return self._pool.parts[self._active]

    @property
    def object_name(self) -> str:
        return self.furniture.asset.name

    @property
    def goals(self) -> tuple[Goal, ...]:
        config = self.task_config
        if config.wanted == "open":
            return (OpenGoal(self.part.name, config.fraction),)
        return (ShutGoal(self.part.name, config.fraction),)

    @property
    def landmarks(self) -> Mapping[str, Carried]:
        return self._pool.landmarks(self._active)

    @property
    def movable(self) -> dict[str, RigidObject]:
        return {}

    @property
    def furnishings(self) -> tuple[ArticulatedObject, ...]:
        return (self.furniture,)

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self._active = int(random_state.randint(len(self._pool.entities)))
        start = 0.0
        if self.task_config.wanted == "shut":
            start = float(random_state.uniform(*self.task_config.start_open))
        self._pool.place(physics, random_state, self._active, start)
