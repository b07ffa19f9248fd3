"""What the tasks about one object share: a pool to draw it from, the goal's marker."""

from __future__ import annotations

import abc

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset
from manipose_mj.mjcf.markers.goal_marker import GoalMarker
from manipose_mj.poses import compose
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart, PlacedObject
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import Goal
from manipose_mj.tasks.scene.resting import require_graspable

# Where the axes of a goal without a place of its own are shown: beyond the objects, in the air.
SHOWCASE = np.array([0.72, 0.25, 0.40])


class SingleObjectTask(ManipulationTask):
    """One object of several is on the table; the others wait high above the scene, weightless."""

    def __init__(
        self, assets: tuple[Asset, ...], config: TaskConfig, env_config: EnvConfig
    ) -> None:
        """Build the scene but for what a subclass adds.

        Raises:
          InputError: There is no object, or the gripper cannot hold one of them.
        """
        super().__init__(config, env_config)
        for asset in assets:
            require_graspable(asset)
        self.assets = assets
        self.pool = self.scene.add_objects(assets)
        self.scene.add_fixture("goal", GoalMarker())

    @property
    def observed_goals(self) -> tuple[str, ...]:
        return ("goal",)

    def sample(
        self, rng: np.random.RandomState, spec: EpisodeSpec, preview: Preview
    ) -> EpisodeStart:
        return self.sample_object(rng, self.pool.choose(rng, spec.object))

    @abc.abstractmethod
    def sample_object(self, rng: np.random.RandomState, index: int) -> EpisodeStart:
        """Draw a start of an episode that is about this object of the pool."""


def single_object_start(
    index: int,
    pose: Float[np.ndarray, "4 4"],
    goal: Goal,
    shown: Float[np.ndarray, "4 4"],
    **fixtures: Float[np.ndarray, "4 4"],
) -> EpisodeStart:
    """The start with one object of the pool at `T_world_object`, and the goal's axes at `shown`."""
    return EpisodeStart(
        goals=(goal,),
        objects={"object": PlacedObject(index, pose)},
        fixtures={"goal": shown, **fixtures},
    )


def shown_beside(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "4 4"]:
    """The marker's pose for a goal that is an orientation alone."""
    return compose(rotation, SHOWCASE)
