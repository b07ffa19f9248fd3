"""MuJoCo on the CPU, many worlds one after the other: what each process of the engine `c` runs.

A world's simulation stays in its own data from step to step. Its whole state is also returned, and where the
caller goes on from another one, it is put back first: stepping is a function of the state, bit for bit.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from manipose_mj.batch.measurement import FlatMeasurement, flat_values
from manipose_mj.batch.measurer import Measurer, read_views
from manipose_mj.batch.starts import RowModels, StartPool
from manipose_mj.mjcf.panda.servos import ServoAddresses, ServoGroup, Servos
from manipose_mj.tasks.core.simulation_state import FlatReader, unflatten, write_simulation

_GROUP = 64  # worlds that step side by side
# What MuJoCo warns of when a simulation diverges, as dm_control asks for it.
_DIVERGED = [
    int(getattr(mujoco.mjtWarning, f"mjWARN_{name}"))
    for name in ("INERTIA", "BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
]


class _World:
    """The data of one world, and views of it."""

    def __init__(self, model: mujoco.MjModel, addresses: ServoAddresses) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.servos = Servos.of(model, self.data, addresses)
        self.state = FlatReader(model, self.data)
        self.warnings = self.data.warning.number
        self.read = read_views(self.data)


class Simulator:
    """Steps worlds of a pool of starts."""

    def __init__(self, pool: StartPool, worlds: int) -> None:
        """Prepares so many worlds, of which each keeps its data."""
        self._pool = pool
        self._models, self._measurer = RowModels(pool), Measurer(pool)
        self._worlds: list[_World | None] = [None] * worlds
        self._rows = np.full(worlds, -1)
        self._words = np.zeros((worlds, state_words(pool)), np.uint32)  # as last returned
        firsts = range(0, worlds, _GROUP)
        self._groups = [slice(first, min(first + _GROUP, worlds)) for first in firsts]
        self._servos: list[ServoGroup | None] = [None] * len(self._groups)

    def advance(
        self,
        words: UInt32[np.ndarray, "worlds words"],
        rows: Int[np.ndarray, " worlds"],
        targets: Float[np.ndarray, "worlds substeps 8"],
    ) -> tuple[UInt32[np.ndarray, "worlds words"], Bool[np.ndarray, " worlds"], FlatMeasurement]:
        """One control step of all worlds.

        Args:
          words: Their states, as `packed` gives them.
          rows: Their starts.
          targets: Of the servos in each physics step: joint angles [rad] and the opening [m].

        Returns:
          Their states, whether each diverged (its state is then without meaning), and measurements.
        """
        for i in np.flatnonzero(self._rows != rows).tolist():
            self._begin(i, int(rows[i]))
        for i in np.flatnonzero((self._words != words).any(axis=1)).tolist():
            world = self._at(i)
            state = unflatten(world.model, world.data, words[i].view(float))
            write_simulation(world.model, world.data, state)
        worlds = [self._at(i) for i in range(len(self._worlds))]
        for number, group in enumerate(self._groups):
            self._step(number, worlds[group], targets[group])
        states = np.zeros_like(words)
        for world, flat in zip(worlds, states.view(float), strict=True):
            world.state.read_into(flat)
        measured = self._measurer.measure([w.data for w in worlds], [w.read for w in worlds], rows)
        warnings = np.array([world.warnings for world in worlds])
        diverged = np.asarray(warnings[:, _DIVERGED].any(axis=1))
        for i in np.flatnonzero(diverged).tolist():
            self._rows[i] = -1
            states[i] = 0
            start = self._pool.starts[rows[i]].measurement
            measured.values[i], measured.contacts[i] = flat_values(start), start.contacts
        self._words[:] = states
        return states, diverged, measured

    def held(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The model and data of a world that has made a step and did not diverge in it."""
        return self._at(world).model, self._at(world).data

    def _begin(self, number: int, row: int) -> None:
        """Give a world new data, of another start."""
        self._worlds[number] = _World(self._models.at(row), self._pool.starts[row].addresses.servos)
        self._rows[number] = row
        self._words[number] = 0
        self._servos[number // _GROUP] = None

    def _at(self, number: int) -> _World:
        world = self._worlds[number]
        assert world is not None, f"world {number} has not been begun"
        return world

    def _step(
        self, group: int, worlds: list[_World], targets: Float[np.ndarray, "worlds substeps 8"]
    ) -> None:
        """The physics steps of some worlds, side by side: NumPy is quicker with all of them at once."""
        servos = self._servos[group]
        if servos is None:
            servos = self._servos[group] = ServoGroup([world.servos for world in worlds])
        servos.read_set_points()
        pairs = [(world.model, world.data) for world in worlds]
        first_half, second_half = mujoco.mj_step1, mujoco.mj_step2
        for substep in range(targets.shape[1]):
            servos.follow(targets[:, substep])
            for model, data in pairs:
                # The second half of a step, then the first of the next, as the CPU's environment steps.
                second_half(model, data)
                first_half(model, data)


def state_words(pool: StartPool) -> int:
    """How many 32-bit words hold the state of any world."""
    return 2 * max(len(start.simulation) for start in pool.starts)


def packed(state: Float[np.ndarray, "n"], words: int) -> UInt32[np.ndarray, " words"]:
    """Double precision as 32-bit words, which JAX leaves as they are; the rest is zero."""
    room = np.zeros(words // 2)
    room[: len(state)] = state
    return room.view(np.uint32)
