"""Many worlds of one task behind pure functions: `reset`, `step`, `rollout`, for `jax.jit` and `jax.lax.scan`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, PRNGKeyArray

from manipose_mj.batch.commands import Controller, action_array
from manipose_mj.batch.engine import Engine
from manipose_mj.batch.goals import EpisodeGoals, stack_trees, take
from manipose_mj.batch.measurement import Measurement, scene_state
from manipose_mj.batch.observations import Observation, Observer
from manipose_mj.batch.starts import StartPool
from manipose_mj.batch.state import (
    Identity,
    State,
    Transition,
    check_state,
    read_state,
    write_state,
)
from manipose_mj.errors import InputError, brief, check_count
from manipose_mj.poses import Array
from manipose_mj.tasks.core.config import check_seed
from manipose_mj.tasks.core.task import CONTROL_TIMESTEP, SUCCESS_HELD

_HELD = round(SUCCESS_HELD / CONTROL_TIMESTEP)  # control steps

Policy = Callable[[Observation, PRNGKeyArray], Float[Array, "worlds n"]]


class _Unseen(NamedTuple):
    """A state whose observations are still to be made, and what those after the last step are of.

    Attributes: state, without observations; ended, the measurement after the step; ended_row, the starts in it.
    """

    state: State
    ended: Measurement
    ended_row: Int[Array, " worlds"]


class Worlds:
    """Worlds of one task on one engine.

    Attributes:
      pool: Of starts.
      engine: Of the physics.
      count: How many worlds.
      lower, upper: Limits of an action.
    """

    def __init__(self, pool: StartPool, engine: Engine, count: int) -> None:
        """Prepares; the engine has to be of the same pool and number of worlds."""
        self.pool, self.engine, self.count = pool, engine, count
        self._goals = EpisodeGoals([start.goals for start in pool.starts])
        self._shapes = stack_trees([start.shapes for start in pool.starts])
        self._measurements = stack_trees([start.measurement for start in pool.starts])
        self._simulations = engine.starts()
        self._observer, self._controller = Observer(pool), Controller(pool)
        self.lower, self.upper = self._controller.lower, self._controller.upper
        self._closed = False
        self._begin_jit, self._replay_jit = jax.jit(self._begin), jax.jit(self._replayed)
        self._step_jit, self._unseen_jit = (
            jax.jit(step, static_argnums=2) for step in (self._step, self._unseen_step)
        )

    @cached_property
    def identity(self) -> Identity:
        """What their states carry; equal for worlds of the same pool on the same engine."""
        return Identity.of(self.pool, self.engine.name)

    def reset(self, key: PRNGKeyArray) -> State:
        """Begin an episode in every world, each start of the pool equally often.

        Raises:
          InputError: The key is none, or several; or the worlds were closed.
        """
        self._require_open()
        _check_key(key)
        rows = jax.random.permutation(key, len(self.pool.starts))
        return self._begin_jit(jnp.resize(rows, (self.count,)))

    def at(self, seeds: Sequence[int]) -> State:
        """Begin the episodes that the CPU task begins with these seeds.

        Args:
          seeds: One a world.

        Raises:
          InputError: They are more or fewer, one is none, or the pool has no such start.
        """
        self._require_open()
        seeds = seeds.tolist() if isinstance(seeds, np.ndarray | jax.Array) else seeds
        if np.ndim(seeds) != 1:
            raise InputError(f"seeds is {seeds!r}; expected a sequence with one a world")
        if len(seeds) != self.count:
            raise InputError(f"{len(seeds)} seeds for {self.count} worlds; expected one a world")
        for seed in seeds:
            check_seed(seed)
        return self._begin_jit(
            jnp.asarray(self.pool.rows([int(seed) for seed in seeds]), jnp.int32)
        )

    def step(self, state: State, action: Float[Array, "worlds n"], hold: int = 1) -> State:
        """Go on by one control step; where an episode ends, the next start of the pool follows.

        A world whose action is not finite diverges.

        Args:
          state: Of all worlds.
          action: Of each.
          hold: Control steps for which the servos go where the action sent them, as in evaluations of policies with
            fewer actions a second; no longer than to the horizon. The reward is the last one's.

        Raises:
          InputError: The state is none or of other worlds, actions are no numbers or have another shape, `hold` is no
            positive whole number, or the worlds were closed.
        """
        self._require_open()
        check_count("hold", hold, least=1)
        check_state(state, self.identity, self.count)
        return self._step_jit(state, self.checked_actions(action), hold)

    def rollout(
        self,
        policy: Policy | Float[Array, "steps worlds n"],
        state: State,
        steps: int | None = None,
        *,
        key: PRNGKeyArray | None = None,
    ) -> tuple[State, Transition]:
        """Many control steps in one `scan`.

        Outside `jax.jit` a policy is compiled in every call.

        Args:
          policy: A pure function of the observation and a key, or recorded actions.
          state: To begin with.
          steps: How many; all of recorded actions by default.
          key: For the policy.

        Raises:
          InputError: A policy is given without `steps`, there are fewer actions, they are no numbers or have another
            shape; the state is none or of other worlds; steps is no whole number, or key no key.
        """
        self._require_open()
        if steps is not None:
            check_count("steps", steps)
        if key is not None:
            _check_key(key)
        check_state(state, self.identity, self.count)
        if callable(policy):
            if steps is None:
                raise InputError("a rollout of a policy needs the number of steps")
            keys = jax.random.split(jax.random.key(0) if key is None else key, steps)

            def act_and_step(state: State, own: Array) -> tuple[State, Transition]:
                action = self.checked_actions(policy(state.observation, own))
                after = self._step_jit(state, action, 1)
                return after, Transition.of(action, after)

            return jax.lax.scan(act_and_step, state, keys)

        recorded = jnp.asarray(self.checked_actions(policy, recorded=True))
        if steps is not None and steps > len(recorded):
            raise InputError(f"steps is {steps}; the recording has {len(recorded)} actions")
        # Nobody looks before the last step.
        blind = _Unseen(_without_observations(state), state.measurement, state.row)
        last, seen = self._replay_jit(blind, recorded[:steps])
        return (self._seen(last) if len(seen.reward) else state), seen

    def seeds(self, state: State) -> Int[np.ndarray, " worlds"]:
        """Of the present episodes."""
        return np.asarray(self.pool.seeds)[np.asarray(state.row)]

    def save(self, state: State, path: Path | str) -> None:
        """Write a state to a file (`.npz`).

        Raises:
          InputError: It is none, or of other worlds.
        """
        check_state(state, self.identity, self.count)
        write_state(Path(path), self._in_file(), state)

    def restore(self, path: Path | str) -> State:
        """The state that was saved, by worlds of the same task, options, starts and number.

        Raises:
          InputError: There is none, or it is of other worlds.
        """
        shapes = jax.eval_shape(self._begin, jnp.zeros(self.count, jnp.int32))
        return read_state(path, self._in_file(), shapes)

    def close(self) -> None:
        """Free what the engine holds; nothing can be stepped afterwards."""
        self._closed = True
        self.engine.close()

    def checked_actions(self, actions: Any, *, recorded: bool = False) -> Any:
        """The actions of a step, or those of several that are `recorded`, as an array.

        Raises:
          InputError: They are no real numbers, or not one action a world.
        """
        return action_array(actions, (self.count, len(self.lower)), recorded=recorded)

    def _require_open(self) -> None:
        if self._closed:
            raise InputError("these worlds were closed; make new ones")

    def _in_file(self) -> dict[str, Any]:
        """The same as `identity`, and the number of worlds, in parts that can be told apart."""
        return {
            "options": np.array([repr(self.pool.layout), self.engine.name]),
            "seeds": np.array(self.pool.seeds),
            "starts": np.array(self.pool.digest),
            "worlds": np.array(self.count),
        }

    def _begin(self, rows: Int[Array, " worlds"]) -> State:
        begun = self._unseen_begin(rows)
        return self._seen(_Unseen(begun, begun.measurement, begun.row))

    def _unseen_begin(self, rows: Int[Array, " worlds"]) -> State:
        """Without observations."""
        rows = rows.astype(jnp.int32)
        now = take(self._measurements, rows)
        never = jnp.zeros(len(rows), bool)
        return State(
            observation={},
            final_observation={},
            reward=jnp.zeros(len(rows), jnp.float32),
            terminated=never,
            truncated=never,
            success=never,
            success_once=never,
            overflowed=never,
            row=rows,
            count=jnp.zeros(len(rows), jnp.int32),
            succeeded=never,
            streak=jnp.zeros(len(rows), jnp.int32),
            held_at=jnp.zeros(len(rows), jnp.int32),
            simulation=take(self._simulations, rows),
            measurement=now,
            commands=self._controller.begin(rows, now.joints, now.fingers.sum(-1)),
            identity=self.identity,
        )

    def _step(self, state: State, action: Float[Array, "worlds n"], hold: int) -> State:
        return self._seen(self._unseen_step(_without_observations(state), action, hold))

    def _seen(self, unseen: _Unseen) -> State:
        """With observations."""
        state = unseen.state
        final = self._observer.observe(unseen.ended, unseen.ended_row)
        first = self._observer.observe(state.measurement, state.row)
        return state._replace(
            observation=_choose(state.done, first, final), final_observation=final
        )

    def _replayed(
        self, begun: _Unseen, actions: Float[Array, "steps worlds n"]
    ) -> tuple[_Unseen, Transition]:
        """The end of recorded actions, and what was on the way."""

        def step(going: _Unseen, action: Array) -> tuple[_Unseen, Transition]:
            after = self._unseen_jit(going.state, action, 1)
            return after, Transition.of(action, after.state)

        return jax.lax.scan(step, begun, actions)

    def _unseen_step(self, state: State, action: Float[Array, "worlds n"], hold: int) -> _Unseen:
        """One control step of states without observations."""
        layout, rows = self.pool.layout, state.row
        action = jnp.asarray(action, jnp.float32)
        valid = jnp.isfinite(action).all(-1)
        action = jnp.where(valid[:, None], action, 0.0)
        commands, targets = self._controller.command(
            state.commands, rows, action, state.measurement.joints
        )
        held_at = jnp.where(state.done, 0, state.held_at)
        begun = state._replace(commands=commands, terminated=~valid, held_at=held_at)
        going_on = self._advanced(begun, targets)
        if hold > 1:

            def held(state: State, _: None) -> tuple[State, None]:
                commands, targets = self._controller.hold(state.commands, rows)
                after = self._advanced(state._replace(commands=commands), targets)
                # Of a world at its horizon the simulation is not needed any more.
                told = (each._replace(simulation={}) for each in (state, after))
                kept = _choose(state.count >= layout.horizon, *told)
                return kept._replace(simulation=after.simulation), None

            going_on, _ = jax.lax.scan(held, going_on, length=hold - 1)
        diverged = going_on.terminated
        truncated = (going_on.count >= layout.horizon) & ~diverged
        done = diverged | truncated
        # Where no episode ended, rows are read that are not used: a gather costs less than a branch.
        fresh = self._unseen_begin(jnp.where(done, (rows + 1) % len(self.pool.starts), rows))
        after = going_on._replace(
            reward=jnp.where(diverged, 0.0, going_on.reward).astype(jnp.float32),
            truncated=truncated,
            success_once=going_on.succeeded,
            overflowed=self.engine.overflowed(going_on.simulation),
            row=fresh.row,
            count=jnp.where(done, 0, going_on.count),
            succeeded=going_on.succeeded & ~done,
            streak=jnp.where(done, 0, going_on.streak),
            simulation=_choose(done, fresh.simulation, going_on.simulation),
            measurement=_choose(done, fresh.measurement, going_on.measurement),
            commands=_choose(done, fresh.commands, going_on.commands),
        )
        return _Unseen(after, going_on.measurement, rows)

    def _advanced(self, state: State, targets: Float[Array, "worlds substeps 8"]) -> State:
        """One control step later, before anything begins anew; `terminated` says which diverged so far."""
        layout, rows = self.pool.layout, state.row
        simulation, broken, now = self.engine.advance(state.simulation, rows, targets)
        diverged: Any = broken | state.terminated
        now = _choose(diverged, state.measurement, now)
        scene = scene_state(layout.objects, layout.parts, take(self._shapes, rows), now)
        success = self._goals.success(rows, scene, layout.tolerance) & ~diverged
        streak = jnp.where(success, state.streak + 1, 0)
        count = state.count + 1
        held_now = (streak >= _HELD) & (state.held_at == 0)
        return state._replace(
            reward=self._goals.reward(rows, scene, layout.tolerance, layout.reward_mode),
            terminated=diverged,
            success=success,
            count=count,
            succeeded=state.succeeded | success,
            streak=streak,
            held_at=jnp.where(held_now, count, state.held_at),
            simulation=simulation,
            measurement=now,
        )


def keys_shape(keys: Any) -> tuple[int, ...]:
    """The shape of an array of keys, of either kind that JAX has; of one key, ().

    Raises:
      InputError: They are no keys.
    """
    try:
        typed = jnp.issubdtype(keys.dtype, jax.dtypes.prng_key)
        return np.shape(keys if typed else jax.random.wrap_key_data(keys))
    except (AttributeError, TypeError):
        raise InputError(
            f"key is {brief(keys)}; expected a key such as jax.random.key(0)"
        ) from None


def _check_key(key: Any) -> None:
    shape = keys_shape(key)
    if shape:
        raise InputError(
            f"key is an array of {shape} keys; expected one, such as jax.random.key(0)"
        )


def _without_observations(state: State) -> State:
    return state._replace(observation={}, final_observation={})


def _choose(which: Bool[Array, " worlds"], yes: Any, no: Any) -> Any:
    """Of each world the one tree or the other."""

    def chosen(a: Array, b: Array) -> Array:
        return jnp.where(which.reshape(-1, *(1,) * (a.ndim - 1)), a, b)

    return jax.tree.map(chosen, yes, no)
