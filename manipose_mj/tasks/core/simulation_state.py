"""All that the rest of a simulation depends on, read from MuJoCo's data and written back bit for bit."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
ASLEEP = (
    "tree_asleep",
    "tree_awake",
    "body_awake",
    "body_awake_ind",
    "parent_awake_ind",
    "dof_awake_ind",
)
AWAKE_COUNTS = ("ntree_awake", "nbody_awake", "nparent_awake", "nv_awake")
# What the second half of the last step computed, which observations show; and the servos' speeds, which
# dm_control leaves at zero when it resets.
LEFT_BEHIND = ("actuator_velocity", "actuator_force", "qacc", "sensordata")


@dataclass(frozen=True)
class SimulationState:
    """Arrays and plain values, so it can be pickled.

    Attributes:
      state: MuJoCo's integration state.
      asleep: Which bodies are asleep, and how long the others have rested.
      awake: How many are not.
      left_behind: What the last step computed on its way.
    """

    state: Float[np.ndarray, "n"]
    asleep: dict[str, np.ndarray]
    awake: dict[str, int]
    left_behind: dict[str, np.ndarray]

    def flat(self) -> Float[np.ndarray, "m"]:
        """All of it, one after the other; numbers that are whole stay so."""
        counts = list(self.awake.values())
        return np.concatenate(
            [self.state, *self.asleep.values(), counts, *self.left_behind.values()]
        )


def state_size(model: mujoco.MjModel) -> int:
    """Length of a simulation's `state`."""
    return mujoco.mj_stateSize(model, STATE)


def read_simulation(model: mujoco.MjModel, data: mujoco.MjData) -> SimulationState:
    """The present of a simulation, between two steps."""
    state = np.empty(state_size(model))
    mujoco.mj_getState(model, data, state, STATE)
    return SimulationState(
        state=state,
        asleep={name: np.array(getattr(data, name)) for name in ASLEEP},
        awake={name: int(getattr(data, name)) for name in AWAKE_COUNTS},
        left_behind={name: np.array(getattr(data, name)) for name in LEFT_BEHIND},
    )


def unflatten(
    model: mujoco.MjModel, data: mujoco.MjData, flat: Float[np.ndarray, "m"]
) -> SimulationState:
    """The reverse of `SimulationState.flat`; what is longer than the model needs is not looked at.

    Args:
      model: Of the simulation.
      data: Any of this model, for the sizes of its arrays.
      flat: Of this model.
    """
    place = 0

    def next_values(count: int) -> np.ndarray:
        nonlocal place
        place += count
        return flat[place - count : place]

    state = next_values(state_size(model))
    asleep = {}
    for name in ASLEEP:
        own = getattr(data, name)
        asleep[name] = next_values(own.size).astype(own.dtype)
    return SimulationState(
        state=state,
        asleep=asleep,
        awake={name: int(next_values(1)[0]) for name in AWAKE_COUNTS},
        left_behind={name: next_values(getattr(data, name).size) for name in LEFT_BEHIND},
    )


def write_simulation(
    model: mujoco.MjModel, data: mujoco.MjData, simulation: SimulationState
) -> None:
    """Put a simulation back; what follows is the same, bit for bit."""
    mujoco.mj_resetData(model, data)
    mujoco.mj_setState(model, data, simulation.state, STATE)
    # Who sleeps is no part of MuJoCo's state: bodies that do are not moved, so all are put in place first.
    mujoco.mj_forward(model, data)
    for name, values in simulation.asleep.items():
        getattr(data, name)[:] = values
    for name, count in simulation.awake.items():
        setattr(data, name, count)
    mujoco.mj_setState(model, data, simulation.state, STATE)
    # The first half of a step: what dm_control leaves behind after each.
    mujoco.mj_step1(model, data)
    for name, values in simulation.left_behind.items():
        getattr(data, name)[:] = values
