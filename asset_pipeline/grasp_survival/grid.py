"""Which trials there are of an object's grasps: frictions, and hands that miss their place by a little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.asset import GraspSet, StablePose
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.errors import InputError, check_count
from manipose_mj.poses import compose, invert, rotation_about


@dataclass(frozen=True)
class GridConfig:
    """The trials of one grasp: every friction with every place of the hand.

    Attributes:
      frictions: Sliding friction of the pads.
      places: Of the hand; the first is the grasp itself, the others miss it.
      shift: Standard deviation of where they are, each way [m].
      turn: Of how they are turned, about each axis [rad].
      seed: Of these errors.

    Raises:
      InputError: A number cannot be.
    """

    frictions: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0)
    places: int = 4
    shift: float = 0.003
    turn: float = radians(3.0)
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.frictions or not all(0 < f < np.inf for f in self.frictions):
            raise InputError(f"frictions are {self.frictions}; expected one or more above 0")
        if self.places < 1 or self.shift < 0 or self.turn < 0:
            raise InputError("places: expected 1 or more; shift and turn: 0 or more")
        check_count("seed", self.seed)


@dataclass(frozen=True)
class TrialGrid:
    """Trials, those of one grasp in succession.

    Attributes:
      grasp: Which grasp each is of.
      starts: `T_tcp_object` with the hand at its place.
      openings: Of the hand before it closes [m].
      ups: Against gravity, in the hand's frame.
      frictions: Of the pads.
      exact: Whether the hand is at the grasp itself.
    """

    grasp: Int[np.ndarray, " n"]
    starts: Float[np.ndarray, "n 4 4"]
    openings: Float[np.ndarray, " n"]
    ups: Float[np.ndarray, "n 3"]
    frictions: Float[np.ndarray, " n"]
    exact: Bool[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.grasp)

    def part(self, rows: slice | Bool[np.ndarray, " n"] | Int[np.ndarray, " m"]) -> TrialGrid:
        """Some of the trials."""
        return TrialGrid(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def trial_grid(
    grasps: GraspSet, stable_poses: Sequence[StablePose], gripper: ParallelJaw, config: GridConfig
) -> TrialGrid:
    """The trials of every grasp.

    Gravity is that of the stable poses in which the grasp is clear of the support, which take turns from one place of
    the hand to the next; of the first of all where it is clear in none.

    Args:
      grasps: Of an object.
      stable_poses: Of it, as in `grasps.clear`.
      gripper: The hand.
      config: Which trials.
    """
    errors = _errors(config)
    frictions = np.array(config.frictions)
    rows: list[tuple[int, np.ndarray, np.ndarray, float, bool]] = []
    for k in range(len(grasps)):
        clear = np.flatnonzero(grasps.clear[k])
        poses = clear if len(clear) else np.zeros(1, int)
        for place, error in enumerate(errors):
            start = invert(grasps.poses[k] @ error)
            rest = stable_poses[int(poses[place % len(poses)])]
            up = start[:3, :3] @ rest.rotation[2]
            rows += [(k, start, up, float(friction), place == 0) for friction in frictions]
    if not rows:
        empty = np.empty(0)
        none = empty.astype(int), empty.reshape(0, 4, 4), empty, empty.reshape(0, 3), empty
        return TrialGrid(*none, empty.astype(bool))
    index, starts, ups, sliding, exact = (np.array(column) for column in zip(*rows, strict=True))
    openings = np.asarray(gripper.opening(grasps.widths))[index]
    return TrialGrid(index, starts, openings, ups, sliding, exact)


def _errors(config: GridConfig) -> list[np.ndarray]:
    """`T_tcp_tcp` of the places, the first without an error."""
    rng = np.random.default_rng(config.seed)
    errors = [np.eye(4)]
    for _ in range(config.places - 1):
        vector = rng.normal(0.0, config.turn, 3)
        angle = float(np.linalg.norm(vector))
        rotation = rotation_about(vector / angle, angle) if angle else np.eye(3)
        errors.append(compose(rotation, rng.normal(0.0, config.shift, 3)))
    return errors
