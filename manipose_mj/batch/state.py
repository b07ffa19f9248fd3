"""What batched worlds are between two control steps, what a rollout keeps of a step, and files of states."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.batch.commands import Commands
from manipose_mj.batch.engine import Physics
from manipose_mj.batch.measurement import Measurement
from manipose_mj.batch.observations import Observation
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import InputError
from manipose_mj.poses import Array
from manipose_mj.storage.cache_file import new_cache_file


@jax.tree_util.register_static  # no array: part of the structure of a state
@dataclass(frozen=True)
class Identity:
    """By what a state knows its worlds: equal for worlds of one pool on one engine.

    Attributes:
      task: `"domain/name"`.
      engine: As users write it.
      digest: Of the options and starts.
    """

    task: str
    engine: str
    digest: str

    @classmethod
    def of(cls, pool: StartPool, engine: str) -> Identity:
        """That of worlds of a pool on an engine."""
        known = repr((pool.layout, pool.seeds, pool.digest)).encode()
        return cls(pool.layout.task, engine, hashlib.sha256(known).hexdigest())


class State(NamedTuple):
    """All worlds between two control steps.

    Where an episode ended with the last step, `observation` is already the next one's first; everything else
    about the step is of the episode that ended.

    Attributes:
      observation: By the names that the CPU task has.
      final_observation: The same after the last step, before a new episode began.
      reward: Of the last step.
      terminated: Whether the episode ended because the simulation diverged, which is the failure `physics`.
      truncated: Whether it ended at the horizon.
      success: Whether the goals were met after the last step.
      success_once: Whether they were after any step of the episode.
      overflowed: Whether the engine met a limit at any step of the episode, such as its room for contacts: its
        physics does not count.
      row: Of each world's start in the pool.
      count: Control steps of the present episode.
      succeeded: Whether its goals were met after any of them.
      streak: After how many of the last ones they were, without a break.
      held_at: Control step after which they had been met for `SUCCESS_HELD` for the first time, in the episode of the
        last step, also where it ended; 0: never yet.
      simulation: The engine's.
      measurement: Of it.
      commands: What the controllers remember.
      identity: Of the worlds that can step it.
    """

    observation: Observation
    final_observation: Observation
    reward: Float[Array, " worlds"]
    terminated: Bool[Array, " worlds"]
    truncated: Bool[Array, " worlds"]
    success: Bool[Array, " worlds"]
    success_once: Bool[Array, " worlds"]
    overflowed: Bool[Array, " worlds"]
    row: Int[Array, " worlds"]
    count: Int[Array, " worlds"]
    succeeded: Bool[Array, " worlds"]
    streak: Int[Array, " worlds"]
    held_at: Int[Array, " worlds"]
    simulation: Physics
    measurement: Measurement
    commands: Commands
    identity: Identity

    @property
    def done(self) -> Bool[Array, " worlds"]:
        """Whether an episode ended with the last step."""
        return self.terminated | self.truncated


class Transition(NamedTuple):
    """What a rollout keeps of each step; as in `State`."""

    action: Float[Array, "*steps worlds n"]
    reward: Float[Array, "*steps worlds"]
    terminated: Bool[Array, "*steps worlds"]
    truncated: Bool[Array, "*steps worlds"]
    success: Bool[Array, "*steps worlds"]
    success_once: Bool[Array, "*steps worlds"]
    overflowed: Bool[Array, "*steps worlds"]

    @classmethod
    def of(cls, action: Array, after: State) -> Transition:
        """That of an action and the state after it."""
        return cls(action, *(getattr(after, name) for name in cls._fields[1:]))


def check_state(state: Any, identity: Identity, count: int) -> None:
    """See that worlds can go on from a state; arrays may be traced.

    Args:
      state: What is taken for one.
      identity: Of the worlds.
      count: How many they are.

    Raises:
      InputError: It is none, or of other worlds.
    """
    if not isinstance(state, State):
        raise InputError(
            f"state is a {type(state).__name__}; expected a State, such as worlds.reset returns"
        )
    known = state.identity
    if known != identity:
        whose, own = (f"{each.task} on engine {each.engine!r}" for each in (known, identity))
        if whose == own:
            whose, own = f"{own} with other starts or options", "these worlds' own"
        raise InputError(f"the state is of other worlds: of {whose}; expected {own}")
    if jnp.shape(state.row) != (count,):
        worlds = " x ".join(map(str, jnp.shape(state.row))) or "one"
        raise InputError(f"the state is of {worlds} worlds; expected one of {count}")


def write_state(path: Path, identity: dict[str, np.ndarray], state: State) -> None:
    """Write a state to a file (`.npz`), with what its worlds are known by."""
    leaves: dict[str, Any] = {
        f"leaf_{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))
    }
    with new_cache_file(path) as scratch, scratch.open("wb") as file:
        np.savez(file, **identity, **leaves)


def read_state(path: Path | str, identity: dict[str, np.ndarray], shapes: State) -> State:
    """The state in a file, if it is of the worlds with this identity.

    Args:
      path: The file.
      identity: Of the worlds that ask.
      shapes: A state of theirs, or the shapes and types of its arrays.

    Raises:
      InputError: There is none, or it is of other worlds.
    """
    try:
        with np.load(path) as file:
            saved = {name: file[name] for name in file.files}
    except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: no state of worlds can be read from it ({error})") from None
    for name, own in identity.items():
        if name not in saved or not np.array_equal(saved[name], own):
            raise InputError(
                f"{path}: its {name} differ from these worlds'; make them with the same arguments"
            )
    own, structure = jax.tree.flatten(shapes)
    leaves = [saved.get(f"leaf_{i}") for i in range(len(own))]
    for leaf, array in zip(leaves, own, strict=True):
        if leaf is None or leaf.shape != array.shape or leaf.dtype != array.dtype:
            raise InputError(
                f"{path}: no state of such worlds can be read from it (arrays are missing or have other shapes)"
            )
    return jax.device_put(jax.tree.unflatten(structure, leaves))
