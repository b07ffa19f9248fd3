"""The hand and object of `build.grasp_trial`, for trials that differ in friction and in the hand's place."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.build.grasp_trial import Outcome, Trial, TrialConfig
from asset_pipeline.grasp_survival.grid import TrialGrid
from manipose_mj.assets.asset import GraspSet, StablePose
from manipose_mj.poses import invert, pose_to_vector

BODY, HAND, FINGERS = slice(0, 7), slice(7, 10), slice(10, 12)  # of qpos


class GridTrial(Trial):
    """A trial whose pads have the friction that is asked for, and whose model can be had."""

    @property
    def model(self) -> mujoco.MjModel:
        """The object's free joint first, then the hand's three slides and the two fingers'."""
        return self._model

    @property
    def config(self) -> TrialConfig:
        """Of the trial."""
        return self._config

    @property
    def hand_geoms(self) -> Int[np.ndarray, " n"]:
        """The hand's: their friction counts in every contact."""
        return np.flatnonzero(self._model.geom_priority > 0)

    def outcome(self, grid: TrialGrid, row: int) -> Outcome:
        """Close, lift and shake in one trial of a grid."""
        self._model.geom_friction[self.hand_geoms, 0] = grid.frictions[row]
        width = self._width(grid.openings[row])
        one = GraspSet(invert(grid.starts[row])[None], np.array([width]), np.ones((1, 1), bool))
        return self.run(one, 0, self._supports(grid, row))

    def first_positions(self, grid: TrialGrid) -> Float[np.ndarray, "n 12"]:
        """`qpos` at the beginning of each trial."""
        qpos = np.zeros((len(grid), self._model.nq))
        qpos[:, BODY] = pose_to_vector(grid.starts)
        qpos[:, FINGERS] = grid.openings[:, None] / 2
        return qpos

    def _width(self, opening: float) -> float:
        """What the hand opens so far for."""
        return opening - 2 * self._gripper.clearance

    @staticmethod
    def _supports(grid: TrialGrid, row: int) -> Sequence[StablePose]:
        """One pose of the object, with this way up."""
        up = grid.starts[row][:3, :3].T @ grid.ups[row]
        rotation = np.zeros((3, 3))
        rotation[2] = up
        return (StablePose(rotation, 0.0, 1.0),)


def motion(config: TrialConfig) -> tuple[Float[np.ndarray, " t"], Float[np.ndarray, "t 3"]]:
    """Where the hand goes once it has closed: by how much up, and along x, y, z beside that [m].

    As in `build.grasp_trial`: up by a smooth ramp, then to and fro along each axis.
    """
    share = np.arange(1, round(config.lift_time / config.timestep) + 1)
    share = share * config.timestep / config.lift_time
    ramp = config.lift * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
    count = round(1 / config.frequency / config.timestep)
    times = np.arange(1, count + 1) * config.timestep
    wave = config.shake * np.sin(2 * np.pi * config.frequency * times)
    aside = np.kron(np.eye(3), wave[:, None])
    up = np.concatenate([ramp, np.full(len(aside), config.lift)])
    return up, np.concatenate([np.zeros((len(ramp), 3)), aside])
