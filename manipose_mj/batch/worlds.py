"""Many worlds of one task behind pure functions: `reset`, `step`, `rollout`, for `jax.jit` and `jax.lax.scan`."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, PRNGKeyArray

from manipose_mj.batch.commands import Commands, Controller
from manipose_mj.batch.engine import Engine, Physics
from manipose_mj.batch.goals import EpisodeGoals, stack_trees, take
from manipose_mj.batch.measurement import Measurement, scene_state
from manipose_mj.batch.observations import Observation, Observer
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import InputError
from manipose_mj.poses import Array
from manipose_mj.storage.cache_file import new_cache_file
from manipose_mj.tasks.core.config import check_seed

Policy = Callable[[Observation, PRNGKeyArray], Float[Array, "worlds n"]]


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
      simulation: The engine's.
      measurement: Of it.
      commands: What the controllers remember.
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
    simulation: Physics
    measurement: Measurement
    commands: Commands

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
        self._begin_jit = jax.jit(self._begin)
        self._step_jit, self._unseen_jit = (
            jax.jit(step, static_argnums=2) for step in (self._step, self._unseen_step)
        )

    def reset(self, key: PRNGKeyArray) -> State:
        """Begin an episode in every world, each start of the pool equally often."""
        rows = jax.random.permutation(key, len(self.pool.starts))
        return self._begin_jit(jnp.resize(rows, (self.count,)))

    def at(self, seeds: Sequence[int]) -> State:
        """Begin the episodes that the CPU task begins with these seeds.

        Args:
          seeds: One a world.

        Raises:
          InputError: They are more or fewer, one is none, or the pool has no such start.
        """
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
          InputError: Actions have another shape, or `hold` is no positive whole number.
        """
        if not isinstance(hold, int | np.integer) or hold < 1:
            raise InputError(
                f"hold is {hold!r}; expected a whole number of control steps from 1 on"
            )
        self.check_shape(jnp.shape(action))
        return self._step_jit(state, action, hold)

    def rollout(
        self,
        policy: Policy | Float[Array, "steps worlds n"],
        state: State,
        steps: int | None = None,
        *,
        key: PRNGKeyArray | None = None,
    ) -> tuple[State, Transition]:
        """Many control steps in one `scan`.

        Args:
          policy: A function of the observation and a key, or recorded actions.
          state: To begin with.
          steps: How many; all of recorded actions by default.
          key: For the policy.

        Raises:
          InputError: A policy is given without `steps`, there are fewer actions, or they have another shape.
        """
        if steps is not None and steps < 0:
            raise InputError(f"steps is {steps}; expected at least 0")
        if callable(policy):
            if steps is None:
                raise InputError("a rollout of a policy needs the number of steps")
            keys = jax.random.split(jax.random.key(0) if key is None else key, steps)

            def act_and_step(state: State, own: Array) -> tuple[State, Transition]:
                action: Any = policy(state.observation, own)
                self.check_shape(jnp.shape(action))
                after = self._step_jit(state, action, 1)
                return after, _transition(action, after)

            return jax.lax.scan(act_and_step, state, keys)

        def step(going: _Unseen, action: Array) -> tuple[_Unseen, Transition]:
            after = self._unseen_jit(going.state, action, 1)
            return after, _transition(action, after.state)

        recorded = jnp.asarray(policy)
        self.check_shape(recorded.shape[1:])
        if steps is not None and steps > len(recorded):
            raise InputError(f"steps is {steps}; the recording has {len(recorded)} actions")
        # Nobody looks before the last step.
        blind = _Unseen(_without_observations(state), state.measurement, state.row)
        last, seen = jax.lax.scan(step, blind, recorded[:steps])
        return (self._seen(last) if len(seen.reward) else state), seen

    def seeds(self, state: State) -> Int[np.ndarray, " worlds"]:
        """Of the present episodes."""
        return np.asarray(self.pool.seeds)[np.asarray(state.row)]

    def save(self, state: State, path: Path | str) -> None:
        """Write a state to a file (`.npz`)."""
        leaves: dict[str, Any] = {
            f"leaf_{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))
        }
        with new_cache_file(Path(path)) as scratch, scratch.open("wb") as file:
            np.savez(file, **self._identity(), **leaves)

    def restore(self, path: Path | str) -> State:
        """The state that was saved, by worlds of the same task, options, starts and number.

        Raises:
          InputError: There is none, or it is of other worlds.
        """
        try:
            with np.load(path) as file:
                saved = {name: file[name] for name in file.files}
        except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise InputError(f"{path}: no state of worlds can be read from it ({error})") from None
        for name, own in self._identity().items():
            if name not in saved or not np.array_equal(saved[name], own):
                raise InputError(
                    f"{path}: its {name} differ from these worlds'; make them with the same arguments"
                )
        shape = jax.eval_shape(self._begin, jnp.zeros(self.count, jnp.int32))
        names = [f"leaf_{i}" for i in range(len(jax.tree.leaves(shape)))]
        if not saved.keys() >= {*names}:
            raise InputError(f"{path}: no state of worlds can be read from it (parts are missing)")
        leaves = [jnp.asarray(saved[name]) for name in names]
        return jax.tree.unflatten(jax.tree.structure(shape), leaves)

    def close(self) -> None:
        """Free what the engine holds."""
        self.engine.close()

    def check_shape(self, shape: tuple[int, ...]) -> None:
        """Raises InputError where actions of this shape are not one a world."""
        expected = (self.count, len(self.lower))
        if shape != expected:
            raise InputError(f"the actions of a step have shape {shape}; expected {expected}")

    def _identity(self) -> dict[str, Any]:
        layout = self.pool.layout
        options = (layout.task, layout.obs_mode, layout.control_mode, layout.reward_mode)
        return {
            "options": np.array([*options, self.engine.name]),
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
            simulation=take(self._simulations, rows),
            measurement=now,
            commands=self._controller.begin(rows, now.joints, now.fingers.sum(-1)),
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

    def _unseen_step(self, state: State, action: Float[Array, "worlds n"], hold: int) -> _Unseen:
        """One control step of states without observations."""
        layout, rows = self.pool.layout, state.row
        action = jnp.asarray(action, jnp.float32)
        valid = jnp.isfinite(action).all(-1)
        action = jnp.where(valid[:, None], action, 0.0)
        commands, targets = self._controller.command(
            state.commands, rows, action, state.measurement.joints
        )
        going_on = self._advanced(state._replace(commands=commands, terminated=~valid), targets)
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
        return state._replace(
            reward=self._goals.reward(rows, scene, layout.tolerance, layout.reward_mode),
            terminated=diverged,
            success=success,
            count=state.count + 1,
            succeeded=state.succeeded | success,
            streak=jnp.where(success, state.streak + 1, 0),
            simulation=simulation,
            measurement=now,
        )


def _without_observations(state: State) -> State:
    return state._replace(observation={}, final_observation={})


def _transition(action: Array, after: State) -> Transition:
    return Transition(
        action,
        after.reward,
        after.terminated,
        after.truncated,
        after.success,
        after.success_once,
        after.overflowed,
    )


def _choose(which: Bool[Array, " worlds"], yes: Any, no: Any) -> Any:
    """Of each world the one tree or the other."""

    def chosen(a: Array, b: Array) -> Array:
        return jnp.where(which.reshape(-1, *(1,) * (a.ndim - 1)), a, b)

    return jax.tree.map(chosen, yes, no)
