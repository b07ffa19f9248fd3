"""`articulated/store_*`: open a drawer or door, put an object behind it, shut it.

`store_chips_can_middle_drawer` is the paper's headline experiment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf

from asset_pipeline.assets import Asset
from manipose_mj.tasks.cavity_task import CavityTask
from manipose_mj.tasks.contents import starts
from manipose_mj.tasks.furniture import Standing
from manipose_mj.tasks.goals import Goal, InsideGoal, ShutGoal
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.part_choice import PartChoice
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


class Store(CavityTask):
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
        super().__init__(
            objects,
            furniture,
            choice,
            self.task_config,
            options or TaskOptions(),
            standing=self.task_config.standing,
            max_fillers=self.task_config.max_fillers,
            taken=False,
        )
        self._finish_build()

    @property
    def goals(self) -> tuple[Goal, ...]:
        name = self.part.name
        return (InsideGoal("object", name), ShutGoal(name, self.task_config.shut))

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        config = self.task_config
        self._draw_scene(physics, random_state)
        asset = self.object.asset
        possible = starts(asset)
        start = possible[random_state.randint(len(possible))]
        xy = self._draw_place(random_state, config.x_range, config.y_range)
        pose = pose_on_table(asset, start, xy, random_state.uniform(-np.pi, np.pi))
        fillers = self._draw_fillers(physics, random_state)
        self.object.place(physics, pose)
        self._lay_inside(physics, fillers)
