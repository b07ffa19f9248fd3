"""`single_object/reorient_mug`: set a mug upright that lies or stands upside down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig, TaskConfig
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.goals import UprightGoal
from manipose_mj.tasks.scene.resting import (
    label_ups,
    placements_between,
    pose_on_table,
    upright_poses,
    usable_poses,
)
from manipose_mj.tasks.single_object.task import SingleObjectTask, shown_beside, single_object_start

# What starts less tilted than this is not worth setting upright [cosine].
_TILTED = 0.5
_INVERTED = 0.97


@dataclass(frozen=True)
class ReorientConfig(TaskConfig):
    """Attributes: horizon as in TaskConfig; x_range, y_range: where the object's label origin may
    start [m]."""

    horizon: float = 120.0
    x_range: tuple[float, float] = (0.38, 0.60)
    y_range: tuple[float, float] = (-0.28, 0.28)


class Reorient(SingleObjectTask):
    """Set the object upright: its label's X within 15 degrees of the vertical, turned as it likes.

    It starts upside down or on its side. The red axis of the marker points up.
    """

    def __init__(
        self,
        assets: tuple[Asset, ...],
        env_config: EnvConfig,
        config: ReorientConfig | None = None,
    ) -> None:
        self.task_config = config or ReorientConfig()
        super().__init__(assets, self.task_config, env_config)
        self._starts = [tipped_poses(asset) for asset in assets]

    def sample_object(self, rng: np.random.RandomState, index: int) -> EpisodeStart:
        config, asset = self.task_config, self.assets[index]
        starts = self._starts[index]
        inverted = [rest for rest in starts if label_ups(asset)[rest, 0] < -_INVERTED]
        lying = [rest for rest in starts if rest not in inverted]
        # An object lies in more ways than it stands on its head: each kind gets half the episodes.
        if inverted and lying:
            starts = inverted if rng.uniform() < 0.5 else lying
        start = starts[rng.randint(len(starts))]
        xy = np.array([rng.uniform(*config.x_range), rng.uniform(*config.y_range)])
        pose = pose_on_table(asset, start, xy, rng.uniform(-np.pi, np.pi))
        upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
        return single_object_start(index, pose, UprightGoal("object"), shown_beside(upright))


def tipped_poses(asset: Asset) -> list[int]:
    """Stable poses upside down or on a side from which the gripper can set the object upright.

    Raises:
      InputError: The object has no upright, cannot stand, or cannot be tipped so.
    """
    if asset.label.object_type not in ("axial", "mirror"):
        raise InputError(
            f"{asset.place}: is a {asset.label.object_type} tool, which has no upright; "
            "expected an axial or mirror-symmetric object"
        )
    upright, needed = upright_poses(asset), placements_between(asset)
    ups = label_ups(asset)[:, 0]
    tipped = [
        index
        for index in usable_poses(asset)
        if ups[index] < _TILTED and any(needed[index, goal] >= 0 for goal in upright)
    ]
    if not tipped:
        raise InputError(f"{asset.place}: the gripper can set it upright from no other stable pose")
    return tipped
