"""What a user may choose about any task, and what a task fixes about itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from asset_pipeline.assets import Asset
from asset_pipeline.catalogue import Split
from manipose_mj.errors import unknown_name
from manipose_mj.tasks.action_mode import ActionMode, JointPositions
from manipose_mj.tasks.observations import SensorConfig
from manipose_mj.tasks.success import Tolerance

Reward = Literal["sparse", "dense"]
REWARDS: tuple[str, ...] = ("sparse", "dense")


@dataclass(frozen=True)
class TaskOptions:
    """What a user may choose about any task.

    Attributes:
      observations: Any `+` combination of the observation modes.
      sensors: Cameras, images, clouds and their noise.
      action_mode: What actions mean.
      reward: `"sparse"`, 1 while the goals are met; or `"dense"`, in [0, 1].
      objects: Assets to use instead of the built-in ones.
      split: Which built-in objects; train and test objects have nothing in common.
      randomisation: Name of a strength of domain randomisation.
    """

    observations: str = "state+pose"
    sensors: SensorConfig = SensorConfig()
    action_mode: ActionMode = field(default_factory=JointPositions)
    reward: Reward = "sparse"
    objects: tuple[Asset, ...] | None = None
    split: Split = "train"
    randomisation: str = "none"

    def __post_init__(self) -> None:
        if self.reward not in REWARDS:
            raise unknown_name("reward mode", self.reward, REWARDS)
        if self.split not in ("train", "test"):
            raise unknown_name("split", self.split, ("train", "test"))


@dataclass(frozen=True)
class TaskConfig:
    """What every task fixes; its own configuration adds to this.

    Attributes:
      tolerance: What counts as success.
      horizon: Time limit of an episode [s].
      settle: Time that things have to come to rest before an episode starts [s].
    """

    tolerance: Tolerance = Tolerance()
    horizon: float = 60.0
    settle: float = 0.3
