"""`articulated/store_*`: open a drawer or door, put an object behind it, shut it.

`store_chips_can_middle_drawer` is the paper's headline experiment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.tasks.articulated.cavity_placement import starts_to_store
from manipose_mj.tasks.articulated.cavity_task import CavityTask, placed_objects
from manipose_mj.tasks.articulated.placement import Standing
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.goals import InsideGoal, ShutGoal
from manipose_mj.tasks.scene.resting import pose_on_table


@dataclass(frozen=True)
class StoreConfig(TaskConfig):
    """Attributes: standing: where the furniture stands; x_range, y_range: where the object's label
    origin may start [m], y mirrored for doors hinged on the right; max_fillers: how many other
    objects may lie in the cavity already; shut: by which fraction of its range a door must be shut
    in the end; None: to within the tolerance, as a drawer."""

    horizon: float = 90.0
    standing: Standing = Standing(objects=True)
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
        furniture: Asset,
        part: MovingPart,
        env_config: EnvConfig,
        config: StoreConfig | None = None,
    ) -> None:
        """Raises InputError where an object does not fit the cavity of the part."""
        self.task_config = config or StoreConfig()
        super().__init__(
            objects,
            furniture,
            part,
            self.task_config,
            env_config,
            standing=self.task_config.standing,
            max_fillers=self.task_config.max_fillers,
            taken=False,
        )

    def sample(
        self, rng: np.random.RandomState, spec: EpisodeSpec, preview: Preview
    ) -> EpisodeStart:
        config = self.task_config
        furniture, mount = self.pieces.sample(rng, 0)
        asset = self.pool.entities[0].asset
        possible = starts_to_store(asset, self.part)
        rest = possible[rng.randint(len(possible))]
        xy = self.sample_place(rng, config.x_range, config.y_range)
        pose = pose_on_table(asset, rest, xy, rng.uniform(-np.pi, np.pi))
        fillers = self.sample_fillers(rng)
        cavity = self.cavity_of(preview, furniture)
        part = self.part.name
        return EpisodeStart(
            goals=(InsideGoal("object", part), ShutGoal(part, config.shut)),
            objects=placed_objects(pose, fillers, cavity),
            furniture=(furniture,),
            mount=mount,
        )
