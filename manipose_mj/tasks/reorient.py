"""`single_object/reorient_mug`: set a mug upright that lies or stands upside down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import Asset
from manipose_mj.errors import InputError
from manipose_mj.tasks.goals import UprightGoal
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.resting import (
    label_ups,
    placements_between,
    pose_on_table,
    upright_poses,
    usable_poses,
)
from manipose_mj.tasks.single_object import SingleObjectTask, shown_beside

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
        config: ReorientConfig | None = None,
        options: TaskOptions | None = None,
    ) -> None:
        self.task_config = config or ReorientConfig()
        super().__init__(assets, self.task_config, options or TaskOptions())
        self._starts = [tipped_poses(asset) for asset in assets]
        self._finish_build()

    @property
    def goals(self) -> tuple[UprightGoal]:
        return (UprightGoal("object"),)

    def _draw(
        self, physics: mjcf.Physics, random_state: np.random.RandomState
    ) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "4 4"]]:
        config, asset = self.task_config, self.object.asset
        starts = self._starts[self._active]
        inverted = [index for index in starts if label_ups(asset)[index, 0] < -_INVERTED]
        lying = [index for index in starts if index not in inverted]
        # An object lies in more ways than it stands on its head: each kind gets half the episodes.
        if inverted and lying:
            starts = inverted if random_state.uniform() < 0.5 else lying
        start = starts[random_state.randint(len(starts))]
        xy = np.array(
            [random_state.uniform(*config.x_range), random_state.uniform(*config.y_range)]
        )
        pose = pose_on_table(asset, start, xy, random_state.uniform(-np.pi, np.pi))
        upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
        return pose, shown_beside(upright)


def tipped_poses(asset: Asset) -> list[int]:
    """Stable poses upside down or on a side from which the gripper can set the object upright.

    Raises:
      InputError: The object has no upright, cannot stand, or cannot be tipped so.
    """
    if asset.label.object_type not in ("axial", "mirror"):
        raise InputError(
            f"{asset.folder}: {asset.name} is a {asset.label.object_type} tool, which has no upright; "
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
        raise InputError(
            f"{asset.folder}: the gripper can set {asset.name} upright from no other stable pose"
        )
    return tipped
