"""The task `example/lift`: one object of a few is picked up and held 15 cm higher. Not one of the benchmark's own.

MANIPOSE_TASKS=lift_task PYTHONPATH=benchmarks/batch manipose train ppo example/lift --objects NAME ... --out lift
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.poses import Array, namespace
from manipose_mj.tasks import (
    EnvConfig,
    EpisodeSpec,
    EpisodeStart,
    Goal,
    ManipulationTask,
    PlacedObject,
    Preview,
    SceneState,
    TaskConfig,
    Tolerance,
    register_task,
)
from manipose_mj.tasks.core.candidates import rigid_rows
from manipose_mj.tasks.core.one_object import one_object
from manipose_mj.tasks.core.scene_objects import SceneObjects
from manipose_mj.tasks.goals.stages import reach
from manipose_mj.tasks.scene.resting import pose_on_table, require_graspable

HEIGHT = 0.15  # above where it lay [m]
FROM_ABOVE, FEWEST = 0.8, 5  # cosine of a grasp's angle to the vertical; such grasps
X_RANGE, Y_RANGE = (0.38, 0.60), (-0.28, 0.28)


@dataclass(frozen=True)
class LiftedGoal(Goal):
    """Both fingers shall hold the object, its label's origin `HEIGHT` above `rest` [m]."""

    kind = "lifted"
    object: str
    rest: Array

    def met(self, state: SceneState, tolerance: Tolerance) -> Array:
        """Whether it holds in this state."""
        return (self._lifted(state) >= 1.0) & state.objects[self.object].held

    def progress(self, state: SceneState, tolerance: Tolerance) -> Array:
        """Reach (to 0.2), hold (to 0.4), lift (to 1); what is held has been reached."""
        obj, lifted = state.objects[self.object], self._lifted(state)
        xp = namespace(lifted)
        held = xp.asarray(obj.held, dtype=lifted.dtype)
        reached = xp.maximum(reach(state, obj.label_pose[..., :3, 3]), held)
        return 0.2 * reached + 0.2 * held + 0.6 * held * xp.clip(lifted, 0.0, 1.0)

    def _lifted(self, state: SceneState) -> Array:
        """Share of the way up."""
        pose = state.objects[self.object].label_pose
        return (pose[..., 2, 3] - namespace(pose).asarray(self.rest, dtype=pose.dtype)) / HEIGHT


class Lift(ManipulationTask):
    """One object in any stable pose in which it can be taken from above, turned freely about the vertical."""

    def __init__(self, assets: tuple[Asset, ...], env_config: EnvConfig) -> None:
        super().__init__(TaskConfig(horizon=20.0), env_config)
        self.assets = assets
        self._held = [poses_held_from_above(asset) for asset in assets]
        self.pool = self.scene.add_objects(assets)

    def sample(
        self, rng: np.random.RandomState, spec: EpisodeSpec, preview: Preview
    ) -> EpisodeStart:
        index = self.pool.choose(rng, spec.object)
        asset, held = self.assets[index], self._held[index]
        place = rng.uniform([X_RANGE[0], Y_RANGE[0]], [X_RANGE[1], Y_RANGE[1]])
        pose = pose_on_table(asset, held[rng.randint(len(held))], place, rng.uniform(-np.pi, np.pi))
        rest = np.asarray((pose @ asset.label.pose)[2, 3])
        return EpisodeStart(
            goals=(LiftedGoal("object", rest),), objects={"object": PlacedObject(index, pose)}
        )


def poses_held_from_above(asset: Asset) -> list[int]:
    """The stable poses with enough grasps that come from above.

    Raises:
      InputError: There is none.
    """
    require_graspable(asset)
    assert asset.grasps is not None
    down = np.stack(
        [-asset.grasps.poses[:, :3, 2] @ rest.rotation[2] for rest in asset.stable_poses]
    )
    count = (asset.grasps.clear.T & (down > FROM_ABOVE)).sum(axis=1)
    held = np.flatnonzero(count >= FEWEST)
    if not len(held):
        raise InputError(f"{asset.place}: has no stable pose with {FEWEST} grasps from above")
    return held.tolist()


@register_task(
    "example", "lift", tags=("rigid",), draws=one_object(poses_held_from_above, rigid_rows())
)
def lift(env_config: EnvConfig, objects: SceneObjects) -> Lift:
    """Pick one object up and hold it 15 cm above where it lay."""
    return Lift(objects.assets, env_config)
