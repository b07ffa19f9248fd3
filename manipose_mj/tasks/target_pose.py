"""`single_object/target_pose`: bring one object from a stable pose to a goal pose on the table."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable
from jaxtyping import Float

from asset_pipeline.assets import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.goal_marker import GoalMarker
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.goals import PoseGoal
from manipose_mj.tasks.object_pool import ObjectPool
from manipose_mj.tasks.options import TaskConfig, TaskOptions


@dataclass(frozen=True)
class TargetPoseConfig(TaskConfig):
    """Attributes: horizon as in TaskConfig; x_range, y_range: where the object's label origin may
    start and end [m]; min_distance: between start and goal [m]; min_shared_grasps: a start and a
    goal belong together when at least this many of the object's annotated grasps are clear of the
    table in both, so that one grasp may do; max_turn: largest change of the resting side [rad]."""

    horizon: float = 40.0
    x_range: tuple[float, float] = (0.38, 0.60)
    y_range: tuple[float, float] = (-0.28, 0.28)
    min_distance: float = 0.15
    min_shared_grasps: int = 5
    max_turn: float = radians(100)


class TargetPose(ManipulationTask):
    """Pick the object up and set it down at the goal, which is drawn as three axes.

    Start and goal are stable poses of the object, turned freely about the vertical. Objects that an
    episode does not use wait high above the scene, weightless: a change of object needs no new model.
    """

    def __init__(
        self,
        assets: tuple[Asset, ...],
        config: TargetPoseConfig | None = None,
        options: TaskOptions | None = None,
    ) -> None:
        self.task_config = config or TargetPoseConfig()
        super().__init__(self.task_config, options or TaskOptions())
        self._pairs = [_pose_pairs(asset, self.task_config) for asset in assets]
        self._pool = ObjectPool(assets, self._arena)
        self._instances.update({e.mjcf_model.model: e for e in self._pool.entities})
        self._marker = GoalMarker()
        self._arena.attach(self._marker)
        self._active = 0
        self._goal = np.eye(4)
        self._finish_build(
            {
                "object": observable.Generic(lambda physics: self.object.label_pose(physics)),
                "goal": observable.Generic(lambda _: self._goal.copy()),
            }
        )

    @property
    def object(self) -> RigidObject:
        """The object of this episode."""
        return self._pool.entities[self._active]

    @property
    def object_name(self) -> str:
        return self.object.asset.name

    @property
    def goals(self) -> tuple[PoseGoal]:
        return (PoseGoal("object", self._goal.copy()),)

    @property
    def movable(self) -> dict[str, RigidObject]:
        return {"object": self.object}

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self._active = int(random_state.randint(len(self._pool.entities)))
        self._pool.use(physics, (self._active,))
        asset = self.object.asset
        pairs = self._pairs[self._active]
        start, goal = pairs[random_state.randint(len(pairs))]
        start_xy, goal_xy = self._draw_places(random_state)
        start_pose = pose_on_table(asset, start, start_xy, random_state.uniform(-np.pi, np.pi))
        goal_pose = pose_on_table(asset, goal, goal_xy, random_state.uniform(-np.pi, np.pi))
        self.object.place(physics, start_pose)
        self._goal = goal_pose @ asset.label.pose
        self._marker.place(physics, self._goal)

    def _draw_places(self, random_state: np.random.RandomState) -> tuple[np.ndarray, np.ndarray]:
        """Start and goal of the label's origin, `(2,)` each [m]."""
        config = self.task_config
        low = np.array([config.x_range[0], config.y_range[0]])
        high = np.array([config.x_range[1], config.y_range[1]])
        while True:
            start, goal = random_state.uniform(low, high), random_state.uniform(low, high)
            if np.linalg.norm(start - goal) >= config.min_distance:
                return start, goal


def pose_on_table(
    asset: Asset, stable: int, label_xy: Float[np.ndarray, "2"], yaw: float
) -> Float[np.ndarray, "4 4"]:
    """`T_world_object` in this stable pose, turned by `yaw`, the label's origin over `label_xy`."""
    rest = asset.stable_poses[stable]
    rotation = rotation_about(np.array([0.0, 0.0, 1.0]), yaw) @ rest.rotation
    offset = rotation @ asset.label.origin
    return compose(rotation, np.array([*(label_xy - offset[:2]), rest.height]))


def _pose_pairs(asset: Asset, config: TargetPoseConfig) -> list[tuple[int, int]]:
    """Pairs of stable poses that one grasp may serve.

    Raises:
      InputError: There is none; the object cannot be grasped in any stable pose.
    """
    clear = np.zeros((0, len(asset.stable_poses)), bool)
    if asset.grasps is not None:
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
            f"{asset.folder}: has no stable pose with {config.min_shared_grasps} grasps for a gripper "
            "that opens 80 mm; choose an object that `manipose assets list` shows as graspable"
        )
    return pairs
