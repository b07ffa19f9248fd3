"""`single_object/target_pose`: bring one object from a stable pose to a goal pose, also at a shelf."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.shelf import Shelf
from manipose_mj.tasks.core.config import EnvConfig, TaskConfig
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.goals import PoseGoal
from manipose_mj.tasks.observations.frames import BodyFrame
from manipose_mj.tasks.scene.resting import pose_on_table
from manipose_mj.tasks.single_object.shelf_places import ShelfPlaces, Zone
from manipose_mj.tasks.single_object.shelf_sampler import ShelfSampler
from manipose_mj.tasks.single_object.task import SingleObjectTask, single_object_start


@dataclass(frozen=True)
class TargetPoseConfig(TaskConfig):
    """Attributes: horizon as in TaskConfig; x_range, y_range: where the object's label origin may
    start and end [m]; min_distance: between start and goal [m]; min_shared_grasps: a start and a
    goal belong together when at least this many of the object's annotated grasps are clear of the
    table in both, so that one grasp may do; max_turn: largest change of the resting side [rad];
    places: a shelf and where things are at it, instead of `x_range` and `y_range`; starts, goals:
    zones of `places` that an episode draws from, where there is one."""

    horizon: float = 40.0
    x_range: tuple[float, float] = (0.38, 0.60)
    y_range: tuple[float, float] = (-0.28, 0.28)
    min_distance: float = 0.15
    min_shared_grasps: int = 5
    max_turn: float = radians(100)
    places: ShelfPlaces | None = None
    starts: tuple[Zone, ...] = ("table",)
    goals: tuple[Zone, ...] = ("table",)


class TargetPose(SingleObjectTask):
    """Pick the object up and set it down at the goal, which is drawn as three axes.

    Start and goal are stable poses of the object, turned freely about the vertical.
    """

    def __init__(
        self,
        assets: tuple[Asset, ...],
        env_config: EnvConfig,
        config: TargetPoseConfig | None = None,
    ) -> None:
        self.task_config = config = config or TargetPoseConfig()
        super().__init__(assets, config, env_config)
        self._pairs = [pose_pairs(asset, config) for asset in assets]
        self._at_shelf = None
        if config.places is not None:
            self.shelf = Shelf(config.places.shelf)
            self.scene.add_fixture("shelf", self.shelf, seen=True)
            self._at_shelf = ShelfSampler(
                config.places, config.starts, config.goals, config.min_distance
            )

    @property
    def extra_frames(self) -> dict[str, BodyFrame]:
        if self._at_shelf is None:
            return {}
        return {"shelf": BodyFrame(self.shelf.mjcf_model.find("body", "shelf"), np.eye(4), None)}

    def sample_object(self, rng: np.random.RandomState, index: int) -> EpisodeStart:
        asset, pairs = self.assets[index], self._pairs[index]
        fixtures = {}
        if self._at_shelf is not None:
            shelf_pose = self._at_shelf.places.draw_shelf(rng)
            fixtures["shelf"] = shelf_pose
            start_pose, goal_pose = self._at_shelf.draw(asset, pairs, shelf_pose, rng)
        else:
            start, goal = pairs[rng.randint(len(pairs))]
            start_xy, goal_xy = self._draw_places(rng)
            start_pose = pose_on_table(asset, start, start_xy, rng.uniform(-np.pi, np.pi))
            goal_pose = pose_on_table(asset, goal, goal_xy, rng.uniform(-np.pi, np.pi))
        label_pose = goal_pose @ asset.label.pose
        return single_object_start(
            index, start_pose, PoseGoal("object", label_pose), label_pose, **fixtures
        )

    def _draw_places(self, rng: np.random.RandomState) -> tuple[np.ndarray, np.ndarray]:
        """Start and goal of the label's origin, `(2,)` each [m]."""
        config = self.task_config
        low = np.array([config.x_range[0], config.y_range[0]])
        high = np.array([config.x_range[1], config.y_range[1]])
        while True:
            start, goal = rng.uniform(low, high), rng.uniform(low, high)
            if np.linalg.norm(start - goal) >= config.min_distance:
                return start, goal


def pose_pairs(asset: Asset, config: TargetPoseConfig) -> list[tuple[int, int]]:
    """Pairs of stable poses that one grasp may serve.

    Raises:
      InputError: There is none; the object cannot be grasped in any stable pose.
    """
    assert asset.grasps is not None
    clear = asset.grasps.clear
    pairs = []
    for i, start in enumerate(asset.stable_poses):
        for j, goal in enumerate(asset.stable_poses):
            # The turn that no yaw can undo: between the verticals seen from the object.
            turn = float(np.arccos(np.clip(start.rotation[2] @ goal.rotation[2], -1.0, 1.0)))
            shared = int((clear[:, i] & clear[:, j]).sum())
            if shared >= config.min_shared_grasps and turn <= config.max_turn:
                pairs.append((i, j))
    if not pairs:
        raise InputError(
            f"{asset.place}: has no stable pose with {config.min_shared_grasps} grasps clear of the "
            "table for a gripper that opens 80 mm; choose another object"
        )
    return pairs
