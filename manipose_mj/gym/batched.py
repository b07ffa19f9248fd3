"""Batched worlds as one of Gymnasium's vector environments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from gymnasium import spaces
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from manipose_mj.batch.state import State
from manipose_mj.batch.worlds import Worlds
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import check_seed

Infos = dict[str, Any]
Seed = int | Sequence[int | None] | np.ndarray | jax.Array


class BatchedEnv(VectorEnv):
    """Worlds that step together; observations, rewards and infos are JAX arrays and stay where they are.

    An episode that ends is followed by the next within the same step; `infos["final_obs"]` then holds what was
    last seen of it, for the worlds that `infos["_final_obs"]` marks. `torch.from_dlpack` reads the arrays without a
    copy. `infos` also holds `success`, `success_once`, `failure`, whether the simulation diverged, and `overflowed`, whether
    the engine had too little room for the episode's contacts.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(self, worlds: Worlds) -> None:
        """Closing the environment closes the worlds."""
        self.worlds, self.num_envs = worlds, worlds.count
        self._state: State | None = None
        self._key = jax.random.key(0)
        self._device = jax.devices()[0]
        low, high = worlds.lower, worlds.upper
        self.single_action_space = spaces.Box(low, high, low.shape, np.float32)
        first = worlds.at([worlds.pool.seeds[0]] * worlds.count).observation
        self.single_observation_space = spaces.Dict(
            {name: _space(values) for name, values in first.items()}
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def reset(
        self, *, seed: Seed | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, jax.Array], Infos]:
        """Begin an episode in every world.

        Args:
          seed: A number chooses starts for all; a list, tuple or array, the episode of each world, of those in the
            pool; None, or a None for each world, goes on from the last.
          options: None are known.

        Raises:
          InputError: An option is given, or a seed is none or not in the pool.
        """
        self._require_open()
        if options:
            raise InputError(f"batched worlds have no reset options; got {sorted(options)}")
        chosen = _chosen(seed)
        if isinstance(chosen, list):
            state = self.worlds.at(chosen)
            self._key = jax.random.key(0)
            for each in chosen:  # what follows, follows from these
                self._key = jax.random.fold_in(self._key, each)
        else:
            if chosen is not None:
                self._key = jax.random.key(chosen)
            self._key, own = jax.random.split(self._key)
            state = self.worlds.reset(own)
        # Like every action: arrays that are bound to a device and others would each compile a step.
        self._state = state = jax.device_put(state, self._device)
        return state.observation, {}

    def step(
        self, actions: Any
    ) -> tuple[dict[str, jax.Array], jax.Array, jax.Array, jax.Array, Infos]:
        """Go on by one control step.

        Args:
          actions: `(worlds, n)`, of NumPy, JAX, or what speaks DLPack; lists of numbers too.

        Raises:
          InputError: No episode was begun, or the actions are no numbers or have another shape.
        """
        self._require_open()
        if self._state is None:
            raise InputError("no episode was begun: call reset first")
        given = _array(actions)
        if given.shape != self.action_space.shape:
            raise InputError(
                f"actions have shape {given.shape}; expected {self.action_space.shape}"
            )
        self._state = state = self.worlds.step(self._state, jax.device_put(given, self._device))
        infos = {
            "success": state.success,
            "success_once": state.success_once,
            "failure": state.terminated,
            "overflowed": state.overflowed,
            "final_obs": state.final_observation,
            "_final_obs": state.done,
        }
        return state.observation, state.reward, state.terminated, state.truncated, infos

    def _require_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("these worlds were closed; make new ones")

    def close_extras(self, **kwargs: Any) -> None:
        """Close the worlds."""
        self.worlds.close()


def _chosen(seed: Any) -> int | list[int] | None:
    """A seed for all worlds, one for each, or none."""
    given = seed.tolist() if isinstance(seed, np.ndarray | np.generic | jax.Array) else seed
    if isinstance(given, list | tuple):
        if given and all(each is None for each in given):
            return None
        for each in given:
            check_seed(each)
        return list(given)
    if given is not None:
        check_seed(given)
    return given


def _array(actions: Any) -> np.ndarray | jax.Array:
    """Numbers, where they are."""
    if isinstance(actions, jax.Array):
        return actions
    if hasattr(actions, "__dlpack__") and not isinstance(actions, np.ndarray):
        return jax.numpy.from_dlpack(actions)
    try:
        given = np.asarray(actions)
        if given.dtype.kind in "cO":  # None would become no number
            raise TypeError
        return given.astype(np.float32)
    except (TypeError, ValueError):
        raise InputError(f"actions are no numbers in equal rows: {actions!r:.80}") from None


def _space(values: jax.Array) -> spaces.Box:
    """Of one world: any value of the type."""
    kind = np.dtype(values.dtype)
    if np.issubdtype(kind, np.floating):
        return spaces.Box(-np.inf, np.inf, values.shape[1:], kind.type)
    limits = np.iinfo(kind)
    return spaces.Box(limits.min, limits.max, values.shape[1:], kind.type)
