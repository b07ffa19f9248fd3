"""How an episode starts, as arrays: drawn from random numbers alone, then written into a simulation."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.mjcf.arena import TABLE_HEIGHT
from manipose_mj.tasks.goals import Goal

_Holder = TypeVar("_Holder")


class NoStartError(InputError):
    """No start can be drawn with the objects of a scene; with others there may be one."""


@dataclass(frozen=True)
class Mount:
    """What the robot stands on; its base is the world's origin either way.

    Attributes:
      table: Whether it stands at the edge of the table, whose top is the plane z = 0; on a pedestal
        otherwise, and there is no table.
      height: Of the robot's base above the floor [m].
      side_table: Beside the pedestal, as high as the base: 1 to the left, -1 to the right, 0 none.
    """

    table: bool = True
    height: float = TABLE_HEIGHT
    side_table: float = 0.0


@dataclass(frozen=True)
class PlacedObject:
    """A rigid object in play.

    Attributes:
      index: Which of the scene's objects.
      pose: `T_world_object`.
    """

    index: int
    pose: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class PlacedFurniture:
    """An articulated object in play.

    Attributes:
      index: Which of the scene's articulated objects.
      position: `(3,)`, of its frame in the world [m].
      quaternion: `(4,)`, `wxyz`.
      openings: Joint positions [m or rad] by the names of parts; all others are shut.
      raised: Whether it stands on a plinth, which reaches down to the floor.
    """

    index: int
    position: Float[np.ndarray, "3"]
    quaternion: Float[np.ndarray, "4"]
    openings: Mapping[str, float] = field(default_factory=dict)
    raised: bool = False


@dataclass(frozen=True)
class ModelChanges:
    """What domain randomisation makes of the compiled model for one episode.

    Attributes:
      fields: Arrays of `mujoco.MjModel` by name, whole; none: the model as it was compiled.
      latency: By how much servo targets come late [s].
    """

    fields: Mapping[str, np.ndarray] = field(default_factory=dict)
    latency: float = 0.0


@dataclass(frozen=True)
class EpisodeStart:
    """Everything that is random about an episode.

    Attributes:
      goals: What the episode wants, all of it.
      objects: Rigid objects in play, by the names that goals use; the first is what the episode is about.
      furniture: Articulated objects in play.
      fixtures: `T_world_fixture` of the scene's fixtures, goal markers among them, by name; those not
        named are out of sight.
      mount: What the robot stands on.
      model: Changes of the model.
      noise_seed: Of the sensors.
    """

    goals: tuple[Goal, ...]
    objects: Mapping[str, PlacedObject] = field(default_factory=dict)
    furniture: tuple[PlacedFurniture, ...] = ()
    fixtures: Mapping[str, Float[np.ndarray, "4 4"]] = field(default_factory=dict)
    mount: Mount = Mount()
    model: ModelChanges = ModelChanges()
    noise_seed: int = 0


def read_only(start: EpisodeStart) -> EpisodeStart:
    """The start with copies of its arrays that nobody can write to; changes of the model stay the arrays they are."""
    return replace(
        start,
        goals=tuple(_read_only(goal) for goal in start.goals),
        objects={name: _read_only(placed) for name, placed in start.objects.items()},
        furniture=tuple(_read_only(placed) for placed in start.furniture),
        fixtures={name: _copy(pose) for name, pose in start.fixtures.items()},
    )


def _read_only(holder: _Holder) -> _Holder:
    """A copy of a goal or of something placed, with copies of its arrays."""
    copied = copy.copy(holder)
    for name, value in getattr(holder, "__dict__", {}).items():
        if isinstance(value, np.ndarray):
            object.__setattr__(copied, name, _copy(value))
    return copied


def _copy(array: np.ndarray) -> np.ndarray:
    copied = np.array(array)
    copied.setflags(write=False)
    return copied
