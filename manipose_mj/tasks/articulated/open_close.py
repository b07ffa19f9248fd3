"""`articulated/open_*` and `articulated/close_*`: move one drawer or door, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from dm_control import mjcf

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.tasks.articulated.furniture import FurnitureInQuestion
from manipose_mj.tasks.articulated.furniture_task import FurnitureTask
from manipose_mj.tasks.articulated.placement import Standing
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart, NoStartError
from manipose_mj.tasks.goals import Goal, OpenGoal, ShutGoal
from manipose_mj.tasks.observations.frames import BodyFrame

_MOVED = 0.1  # of its range, by which a part that moved before the start is not where it was drawn


@dataclass(frozen=True)
class OpenCloseConfig(TaskConfig):
    """Attributes: requested: what shall become of the part; fraction: of its joint's range that counts
    as open, or as shut; start_open: how far open it is when it is to be closed, of its range;
    standing: where the furniture stands."""

    horizon: float = 40.0
    requested: Literal["open", "shut"] = "open"
    fraction: float = 0.9
    start_open: tuple[float, float] = (0.6, 1.0)
    standing: Standing = Standing()


class OpenClose(FurnitureTask):
    """Open a shut drawer or door, or shut an open one.

    Success: the joint is open, or shut, by the fraction of its range that the configuration says.
    """

    def __init__(
        self,
        furniture: Asset,
        part: MovingPart,
        env_config: EnvConfig,
        config: OpenCloseConfig | None = None,
    ) -> None:
        self.task_config = config or OpenCloseConfig()
        super().__init__(self.task_config, env_config)
        self.pieces = FurnitureInQuestion(
            self.scene, (furniture,), (part,), self.task_config.standing
        )

    def write(self, physics: mjcf.Physics, start: EpisodeStart) -> None:
        """Put a simulation where an episode starts.

        Raises:
          NoStartError: The part does not stay as it was drawn, or touches the arm at home: the arm is in its way.
        """
        super().write(physics, start)
        part, (now,) = self.part, self.pieces.opening(physics, self._piece)
        low, high = part.joint.range
        drawn = start.furniture[0].openings.get(part.name, low)
        if abs(now - drawn) > _MOVED * (high - low):
            raise NoStartError(
                f"{part.name} of {self.furniture.asset.name} moves from {drawn:.2f} to {now:.2f} before the episode starts"
            )
        if self.scene_state(physics).parts[part.name].touched:
            raise NoStartError(
                f"{part.name} of {self.furniture.asset.name}, at {now:.2f}, is in the way of the arm at home"
            )

    @property
    def extra_frames(self) -> Mapping[str, BodyFrame]:
        # Not every part has a cavity.
        frames = super().extra_frames
        return {name: frames[name] for name in ("handle", "joint")}

    def sample(
        self, rng: np.random.RandomState, spec: EpisodeSpec, preview: Preview
    ) -> EpisodeStart:
        config = self.task_config
        opening = float(rng.uniform(*config.start_open)) if config.requested == "shut" else 0.0
        part = self.part.name
        goal: Goal = (
            OpenGoal(part, config.fraction)
            if config.requested == "open"
            else ShutGoal(part, config.fraction)
        )
        furniture, mount = self.pieces.sample(rng, 0, opening)
        return EpisodeStart(goals=(goal,), furniture=(furniture,), mount=mount)
