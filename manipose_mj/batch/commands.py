"""From actions to what the servos are sent in every physics step: control modes and latency of many worlds."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from manipose_mj.actions import Arm, Memory, PureTcpSolver, control_law
from manipose_mj.batch.goals import stack_trees
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import InputError, brief
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.poses import Array

_REAL = (jnp.floating, jnp.integer, jnp.bool_)


class Commands(NamedTuple):
    """What controllers remember.

    Attributes:
      memory: Of the control law.
      sent: The targets of the last physics steps, which may be under way still.
    """

    memory: Memory
    sent: Float[Array, "worlds steps 8"]


class Controller:
    """One control mode for all worlds.

    Attributes:
      lower, upper: Limits of an action.
    """

    def __init__(self, pool: StartPool) -> None:
        layout = pool.layout
        self._law = control_law(layout.control_mode)
        self._timestep, self._substeps = layout.timestep, layout.substeps
        self._kinematics = PureTcpSolver() if self._law.moves_tcp else None
        self._lag = stack_trees([start.servo_lag for start in pool.starts])
        self._latency = jnp.asarray([start.latency for start in pool.starts], jnp.int32)
        self._longest = max(start.latency for start in pool.starts)
        self.lower = np.append(self._law.lower, 0.0).astype(np.float32)
        self.upper = np.append(self._law.upper, MAX_OPENING).astype(np.float32)

    def begin(
        self,
        rows: Int[Array, " worlds"],
        joints: Float[Array, "worlds 7"],
        opening: Float[Array, " worlds"],
    ) -> Commands:
        """At the start of episodes: the robots rest where they are.

        Args:
          rows: Of the starts.
          joints: Measured angles [rad].
          opening: Between the pads [m].
        """

        def one(joints: Array, opening: Array, lag: Array) -> Memory:
            return self._law.start(opening, Arm(joints, lag, self._kinematics))

        memory = jax.vmap(one)(joints, opening, self._lag[rows])
        home = jnp.asarray(np.append(HOME, MAX_OPENING), jnp.float32)
        return Commands(_single(memory), jnp.broadcast_to(home, (len(rows), self._longest, 8)))

    def command(
        self,
        commands: Commands,
        rows: Int[Array, " worlds"],
        action: Float[Array, "worlds n"],
        joints: Float[Array, "worlds 7"],
    ) -> tuple[Commands, Float[Array, "worlds substeps 8"]]:
        """What arrives at the servos in the physics steps of this control step.

        Args:
          commands: As the last step left them.
          rows: Of the starts.
          action: Of the control mode.
          joints: Measured angles [rad].
        """

        def one(memory: Memory, action: Array, joints: Array, lag: Array) -> Memory:
            return _single(self._law.begin(memory, action, Arm(joints, lag, self._kinematics)))

        memory = jax.vmap(one)(commands.memory, action, joints, self._lag[rows])
        return self.hold(commands._replace(memory=memory), rows)

    def hold(
        self, commands: Commands, rows: Int[Array, " worlds"]
    ) -> tuple[Commands, Float[Array, "worlds substeps 8"]]:
        """What arrives in another control step if there is no new action.

        Args:
          commands: As the last step left them.
          rows: Of the starts.
        """

        def one(memory: Memory) -> tuple[Memory, Array]:
            def send(memory: Memory, _: None) -> tuple[Memory, Array]:
                targets, memory = self._law.targets(memory, self._timestep)
                return _single(memory), jnp.append(targets, memory.opening).astype(jnp.float32)

            return jax.lax.scan(send, memory, length=self._substeps, unroll=True)

        memory, targets = jax.vmap(one)(commands.memory)
        if not self._longest:
            return Commands(memory, commands.sent), targets
        sent = jnp.concatenate([commands.sent, targets], axis=1)
        late = self._longest - self._latency[rows][:, None] + jnp.arange(self._substeps)
        arriving = jnp.take_along_axis(sent, late[..., None], axis=1)
        return Commands(memory, sent[:, -self._longest :]), arriving


def action_array(actions: Any, shape: tuple[int, int], *, recorded: bool = False) -> Any:
    """The actions of a step as an array, traced or not.

    Args:
      actions: An array, or numbers in equal rows.
      shape: That they shall have, `(worlds, n)`.
      recorded: Whether they are of several steps, one after the other.

    Raises:
      InputError: They are no real numbers, or have another shape.
    """
    array = _array(actions)
    if not any(jnp.issubdtype(array.dtype, kind) for kind in _REAL):
        found = f"of type {array.dtype}" if array is actions else brief(actions)
        raise InputError(f"the actions of a step are {found}; expected real numbers")
    found = array.shape[1:] if recorded else array.shape
    if found != shape:
        raise InputError(f"the actions of a step have shape {found}; expected {shape}")
    return array


def _array(actions: Any) -> Any:
    if isinstance(actions, np.ndarray | jax.Array):
        return actions
    try:
        return np.asarray(actions)
    except jax.errors.TracerArrayConversionError:
        return jnp.asarray(actions)
    except (TypeError, ValueError):
        raise InputError(
            f"the actions of a step are {brief(actions)}; expected numbers in equal rows"
        ) from None


def _single(memory: Memory) -> Memory:
    return Memory(*(jnp.asarray(field, jnp.float32) for field in memory))
