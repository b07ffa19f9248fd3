"""`single_object/orientation`: turn one object from any stable pose to a goal orientation."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.poses import pose_error
from manipose_mj.tasks.core.config import EnvConfig, TaskConfig
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.goals import OrientationGoal
from manipose_mj.tasks.scene.overhang import edge_pairs
from manipose_mj.tasks.scene.resting import placements_between, pose_on_table, usable_poses
from manipose_mj.tasks.single_object.task import SingleObjectTask, shown_beside, single_object_start

_YAWS = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)


@dataclass(frozen=True)
class OrientationConfig(TaskConfig):
    """Attributes: horizon as in TaskConfig; x_range, y_range: where the object's label origin may
    start [m]; min_turn: the least angle between start and goal, up to symmetry [rad]."""

    horizon: float = 120.0
    x_range: tuple[float, float] = (0.38, 0.60)
    y_range: tuple[float, float] = (-0.28, 0.28)
    min_turn: float = radians(30)


class Orientation(SingleObjectTask):
    """Turn the object so that it rests as the three axes show, anywhere on the table.

    Start and goal are different stable poses, turned freely about the vertical. Some pairs no single
    grasp can serve: the object then has to be set down on the way, once or twice, and taken anew.
    """

    def __init__(
        self,
        assets: tuple[Asset, ...],
        env_config: EnvConfig,
        config: OrientationConfig | None = None,
    ) -> None:
        self.task_config = config or OrientationConfig()
        super().__init__(assets, self.task_config, env_config)
        self._pairs = [orientation_pairs(asset, self.task_config.min_turn) for asset in assets]

    def sample_object(self, rng: np.random.RandomState, index: int) -> EpisodeStart:
        config, asset, pairs = self.task_config, self.assets[index], self._pairs[index]
        xy = np.array([rng.uniform(*config.x_range), rng.uniform(*config.y_range)])
        while True:
            start, goal = pairs[rng.randint(len(pairs))]
            start_pose = pose_on_table(asset, start, xy, rng.uniform(-np.pi, np.pi))
            goal_pose = pose_on_table(asset, goal, xy, rng.uniform(-np.pi, np.pi))
            goal_label = goal_pose @ asset.label.pose
            turn = pose_error(start_pose @ asset.label.pose, goal_label, asset.label.symmetry)[1]
            if turn > config.min_turn:
                rotation = goal_label[:3, :3]
                requested = OrientationGoal("object", rotation.copy())
                return single_object_start(index, start_pose, requested, shown_beside(rotation))


def orientation_pairs(asset: Asset, min_turn: float) -> list[tuple[int, int]]:
    """Start and goal: stable poses of real use, a few placements apart at the most; two different
    ones if there are such.

    Args:
      asset: The object.
      min_turn: Which some turn about the vertical must leave between them [rad].

    Raises:
      InputError: There is none.
    """
    usable, needed = usable_poses(asset), placements_between(asset)
    pairs = [
        (i, j)
        for i in usable
        for j in usable
        if needed[i, j] >= 0 and _largest_turn(asset, i, j) > min_turn
    ]
    # What lies on one side only is turned about the vertical.
    pairs = [(i, j) for i, j in pairs if i != j] or pairs
    # What lies on its rim is set down over the edge of the table.
    pairs = pairs or edge_pairs(asset)
    if not pairs:
        raise InputError(
            f"{asset.place}: has no stable pose that the gripper can turn it to "
            "from another, or about the vertical; an orientation task needs one"
        )
    return pairs


def _largest_turn(asset: Asset, start: int, goal: int) -> float:
    """The angle between two stable poses, up to symmetry, at the yaw that makes it largest [rad]."""
    xy = np.zeros(2)
    poses = [
        np.stack([pose_on_table(asset, stable, xy, yaw) @ asset.label.pose for yaw in yaws])
        for stable, yaws in ((start, _YAWS[:1]), (goal, _YAWS))
    ]
    return float(pose_error(poses[0], poses[1], asset.label.symmetry)[1].max())
