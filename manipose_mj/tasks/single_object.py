"""What the tasks about one object share: a pool to draw it from, the goal's marker, observables."""

from __future__ import annotations

import abc

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import Asset
from manipose_mj.mjcf.goal_marker import GoalMarker
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import compose
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.object_pool import ObjectPool
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.resting import require_graspable

# Where the axes of a goal without a place of its own are shown: beyond the objects, in the air.
SHOWCASE = np.array([0.72, 0.25, 0.40])


class SingleObjectTask(ManipulationTask):
    """One object of several is on the table; the others wait high above the scene, weightless."""

    def __init__(self, assets: tuple[Asset, ...], config: TaskConfig, options: TaskOptions) -> None:
        """Build the scene but for what a subclass adds before it calls `_finish_build`.

        Raises:
          InputError: There is no object, or the gripper cannot hold one of them.
        """
        super().__init__(config, options)
        for asset in assets:
            require_graspable(asset)
        self._pool = ObjectPool(assets, self._arena)
        self._instances.update({e.mjcf_model.model: e for e in self._pool.entities})
        self._marker = GoalMarker()
        self._arena.attach(self._marker)
        self._active = 0
        self._goal = np.eye(4)

    @abc.abstractmethod
    def _draw(
        self, physics: mjcf.Physics, random_state: np.random.RandomState
    ) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "4 4"]]:
        """`T_world_object` at the start and the goal of the label as the marker shows it."""

    @property
    def object(self) -> RigidObject:
        """The object of this episode."""
        return self._pool.entities[self._active]

    @property
    def object_name(self) -> str:
        return self.object.asset.name

    @property
    def movable(self) -> dict[str, RigidObject]:
        return {"object": self.object}

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self._active = int(random_state.randint(len(self._pool.entities)))
        self._pool.use(physics, (self._active,))
        start, self._goal = self._draw(physics, random_state)
        self.object.place(physics, start)
        self._marker.place(physics, self._goal)


def shown_beside(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "4 4"]:
    """The marker's pose for a goal that is an orientation alone."""
    return compose(rotation, SHOWCASE)
