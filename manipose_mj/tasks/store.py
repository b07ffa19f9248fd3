"""`articulated/store_chips_can_middle_drawer`: the paper's headline experiment."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable
from jaxtyping import Float

from asset_pipeline.assets import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.poses import rotation_about
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.goals import Goal, InsideGoal, ShutGoal
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.target_pose import pose_on_table

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class StoreConfig(TaskConfig):
    """Attributes: part: which drawer or door to store behind; furniture_x, furniture_y: where the
    handle of that part starts, in the world [m]; furniture_yaw: largest turn either way [rad];
    x_range, y_range: where the object's label origin may start [m]."""

    horizon: float = 90.0
    part: str = "middle_drawer"
    furniture_x: tuple[float, float] = (0.73, 0.77)
    furniture_y: tuple[float, float] = (0.05, 0.15)
    furniture_yaw: float = radians(6)
    x_range: tuple[float, float] = (0.32, 0.48)
    y_range: tuple[float, float] = (-0.42, -0.28)


class Store(ManipulationTask):
    """Open the drawer, lay the object inside, let go, shut the drawer.

    Success: the whole object is in the drawer's cavity, at rest and released, and
    the drawer is shut to within 1 cm.
    """

    def __init__(
        self,
        asset: Asset,
        furniture: Asset,
        config: StoreConfig | None = None,
        options: TaskOptions | None = None,
    ) -> None:
        self.task_config = config or StoreConfig()
        super().__init__(self.task_config, options or TaskOptions())
        self.part = furniture.part(self.task_config.part)
        if self.part.cavity is None or self.part.handle is None:
            raise InputError(
                f"{furniture.folder}: part {self.part.name!r} has no cavity or no handle; "
                "a store task needs both"
            )
        self.furniture = ArticulatedObject(furniture, name="cabinet")
        self.object = RigidObject(asset, name="object")
        self._arena.attach(self.furniture)
        self._arena.add_free_entity(self.object)
        self._instances.update(cabinet=self.furniture, object=self.object)
        poses: dict[str, observable.Observable] = {
            "object": observable.Generic(self.object.label_pose),
            "cavity": observable.Generic(self.cavity_pose),
        }
        for part in furniture.parts:
            if part.handle is not None:
                poses[f"handle_{part.name}"] = observable.Generic(
                    lambda physics, name=part.name: self.furniture.handle_pose(physics, name)
                )
            poses[f"opening_{part.name}"] = observable.Generic(
                lambda physics, name=part.name: np.array([self.furniture.opening(physics, name)])
            )
        self._finish_build(poses)

    @property
    def object_name(self) -> str:
        return self.object.asset.name

    @property
    def goals(self) -> tuple[Goal, ...]:
        return (InsideGoal("object", self.part.name), ShutGoal(self.part.name))

    @property
    def movable(self) -> dict[str, RigidObject]:
        return {"object": self.object}

    @property
    def furnishings(self) -> tuple[ArticulatedObject, ...]:
        return (self.furniture,)

    def cavity_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part that this task stores behind."""
        return self.furniture.cavity_pose(physics, self.part.name)

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        config = self.task_config
        assert self.part.handle is not None
        yaw = random_state.uniform(-config.furniture_yaw, config.furniture_yaw)
        turn = rotation_about(UP, yaw)
        handle_xy = (turn @ self.part.handle.origin)[:2]
        place = np.array(
            [random_state.uniform(*config.furniture_x), random_state.uniform(*config.furniture_y)]
        )
        frame = physics.bind(mjcf.get_attachment_frame(self.furniture.mjcf_model))
        frame.pos = [*(place - handle_xy), 0.0]
        frame.quat = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        for part in self.furniture.asset.parts:
            physics.bind(self.furniture.joint(part.name)).qpos = part.joint.range[0]
        start = random_state.randint(len(self.object.asset.stable_poses))
        xy = np.array(
            [random_state.uniform(*config.x_range), random_state.uniform(*config.y_range)]
        )
        pose = pose_on_table(self.object.asset, start, xy, random_state.uniform(-np.pi, np.pi))
        self.object.place(physics, pose)
