"""MuJoCo on the CPU, many worlds one after the other: what the engine `c` runs.

A world's simulation stays in its own data from step to step. Its whole state is also returned, and where the
caller goes on from another one, it is put back first: stepping is a function of the state, bit for bit.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from operator import attrgetter

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from manipose_mj.batch.kernels.cpu_loops import measure, read, step
from manipose_mj.batch.measurement import FlatMeasurement, flat_values
from manipose_mj.batch.starts import RowModels, StartPool
from manipose_mj.batch.world_tables import empty_tables, enter, enter_contacts
from manipose_mj.mjcf.panda.servos import Servos
from manipose_mj.tasks.core.simulation_state import AWAKE_COUNTS, unflatten, write_simulation

_COUNTS = attrgetter("ncon", *AWAKE_COUNTS)


class Simulator:
    """Steps worlds of a pool of starts."""

    def __init__(self, pool: StartPool, worlds: int, *, threads: int = 1) -> None:
        """Prepares so many worlds, of which each keeps its data.

        Args:
          pool: Of starts.
          worlds: How many.
          threads: That step them.
        """
        self._pool = pool
        self._models, self._tables = RowModels(pool), empty_tables(pool, worlds)
        self._servos: list[Servos | None] = [None] * worlds
        self._datas: list[mujoco.MjData | None] = [None] * worlds
        self._rows = np.full(worlds, -1)
        self._words = np.zeros((worlds, state_words(pool)), np.uint32)  # as last returned
        one = pool.starts[0].measurement
        self._values, self._touched = len(flat_values(one)), one.contacts.shape
        self._bounds = np.linspace(0, worlds, min(threads, worlds) + 1).astype(int).tolist()
        self._threads = ThreadPoolExecutor(len(self._bounds) - 1) if threads > 1 else None

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
            model, data = self.held(i)
            write_simulation(model, data, unflatten(model, data, words[i].copy().view(float)))
        robots = self._tables.robots
        if self._threads is None:
            step(robots, targets, 0, len(rows))
        else:
            firsts, ends = self._bounds[:-1], self._bounds[1:]
            list(self._threads.map(lambda a, b: step(robots, targets, a, b), firsts, ends))
        return self._seen(rows)

    def held(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The model and data of a world that has made a step and did not diverge in it."""
        servos = self._at(world)
        return servos.model, servos.data

    def close(self) -> None:
        """Ends the threads."""
        if self._threads is not None:
            self._threads.shutdown()

    def _begin(self, number: int, row: int) -> None:
        """Give a world new data, of another start."""
        model = self._models.at(row)
        start = self._pool.starts[row]
        servos = Servos.of(model, mujoco.MjData(model), start.addresses.servos)
        self._servos[number] = servos
        self._datas[number] = servos.data
        enter(self._tables, number, start, servos)
        self._rows[number] = row
        self._words[number] = 0

    def _at(self, number: int) -> Servos:
        servos = self._servos[number]
        assert servos is not None, f"world {number} has not been begun"
        return servos

    def _seen(
        self, rows: Int[np.ndarray, " worlds"]
    ) -> tuple[UInt32[np.ndarray, "worlds words"], Bool[np.ndarray, " worlds"], FlatMeasurement]:
        """States after a step, who diverged, and measurements."""
        tables, datas = self._tables, self._datas
        states = np.zeros_like(self._words)
        counts = np.array(list(map(_COUNTS, datas)))
        contacts = counts[:, 0]
        read(tables, counts[:, 1:], states.view(float))
        for i in np.flatnonzero((contacts > 0) & (tables.contacts == 0)).tolist():
            enter_contacts(tables, i, datas[i])
        measured = FlatMeasurement(
            np.empty((len(rows), self._values)),
            np.zeros((len(rows), *self._touched), bool),
        )
        diverged = np.empty(len(rows), bool)
        measure(tables, contacts, *measured, diverged)
        for i in np.flatnonzero(diverged).tolist():
            self._rows[i] = -1
            states[i] = 0
            start = self._pool.starts[rows[i]].measurement
            measured.values[i], measured.contacts[i] = flat_values(start), start.contacts
        self._words[:] = states
        return states, diverged, measured


def state_words(pool: StartPool) -> int:
    """How many 32-bit words hold the state of any world."""
    return 2 * max(len(start.simulation) for start in pool.starts)


def packed(state: Float[np.ndarray, "n"], words: int) -> UInt32[np.ndarray, " words"]:
    """Double precision as 32-bit words, which JAX leaves as they are; the rest is zero."""
    room = np.zeros(words // 2)
    room[: len(state)] = state
    return room.view(np.uint32)
