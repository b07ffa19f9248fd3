"""Batched worlds in the shape that Brax's environments and MuJoCo Playground's have after their training wrappers.

Learners written for those call `reset(keys)` and `step(state, action)` on all worlds at once, look at `obs`, `reward`, `done`
and `info["truncation"]`, and leave restarting to the environment.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float, Int

from manipose_mj.batch.observations import Observation
from manipose_mj.batch.state import State
from manipose_mj.batch.worlds import Worlds, keys_shape
from manipose_mj.errors import InputError
from manipose_mj.poses import Array


class BraxState(NamedTuple):
    """As `brax.envs.State` and `mujoco_playground.State`.

    Attributes:
      data: The worlds' own state.
      obs: All observations of a world as one vector, in the order of their names.
      reward: Of the last step.
      done: 1 where an episode ended with it; `obs` is then the next one's first.
      metrics: `success` and `success_once` of the episode, as numbers.
      info: `truncation`, 1 where it ended at the horizon; `steps`, of the episode that the last step was of; `final_obs`, before it began;
        `overflowed`.
    """

    data: State
    obs: Float[Array, "worlds n"]
    reward: Float[Array, " worlds"]
    done: Float[Array, " worlds"]
    metrics: dict[str, Array]
    info: dict[str, Any]

    def replace(self, **changes: Any) -> BraxState:
        """The state with other values of some attributes, as of Brax's."""
        return self._replace(**changes)

    @property
    def pipeline_state(self) -> State:
        """What Brax calls the data."""
        return self.data


class BraxWorlds:
    """Pure functions of states, for `jax.jit` and `jax.lax.scan`; actions from -1 to 1.

    Attributes:
      worlds: What is behind it.
      action_size, observation_size: Numbers of an action and of an observation.
    """

    def __init__(self, worlds: Worlds) -> None:
        self.worlds = worlds
        self.action_size = len(worlds.lower)
        shape = jax.eval_shape(lambda: self.reset(jax.random.key(0)).obs)
        self.observation_size = shape.shape[-1]

    @property
    def unwrapped(self) -> BraxWorlds:
        """Itself: nothing is wrapped around it."""
        return self

    def reset(self, rng: Array) -> BraxState:
        """Begin an episode in every world.

        Args:
          rng: A key, or one for each world, of which the first is used.

        Raises:
          InputError: There are neither one key nor as many as worlds.
        """
        keys = keys_shape(rng)
        if keys not in ((), (self.worlds.count,)):
            raise InputError(
                f"keys of shape {keys} for {self.worlds.count} worlds; expected one, or one a world"
            )
        begun = self.worlds.reset(rng[0] if keys else rng)
        return _as_brax(begun, begun.count)

    def step(self, state: BraxState, action: Float[Array, "worlds n"]) -> BraxState:
        """Go on by one control step; where an episode ends, the next begins.

        Raises:
          InputError: The actions have another shape.
        """
        action = self.worlds.checked_actions(action)
        low, high = self.worlds.lower, self.worlds.upper
        bounded = jnp.clip(action, -1.0, 1.0)
        after = self.worlds.step(state.data, low + (bounded + 1) / 2 * (high - low))
        return _as_brax(after, state.data.count + 1)


def _as_brax(state: State, steps: Int[Array, " worlds"]) -> BraxState:
    return BraxState(
        data=state,
        obs=_flat(state.observation),
        reward=state.reward,
        done=state.done.astype(jnp.float32),
        metrics={
            "success": state.success.astype(jnp.float32),
            "success_once": state.success_once.astype(jnp.float32),
        },
        info={
            "truncation": state.truncated.astype(jnp.float32),
            "steps": steps,
            "final_obs": _flat(state.final_observation),
            "overflowed": state.overflowed,
        },
    )


def _flat(observation: Observation) -> Float[Array, "worlds n"]:
    rows = [jnp.asarray(values, jnp.float32) for _, values in sorted(observation.items())]
    return jnp.concatenate([row.reshape(len(row), -1) for row in rows], axis=-1)
