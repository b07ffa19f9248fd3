"""MuJoCo on the CPU, many worlds one after the other: what the engine `c` runs.

A world's simulation stays in its own data from step to step. Its whole state is also returned, and where the
caller goes on from another one, it is put back first: stepping is a function of the state, bit for bit.
"""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise
from operator import attrgetter

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from manipose_mj.batch.kernels.cpu_loops import (
    begin_putting_back,
    end_putting_back,
    measure,
    read,
    step,
)
from manipose_mj.batch.measurement import FlatMeasurement, flat_values
from manipose_mj.batch.starts import RowModels, StartPool
from manipose_mj.batch.world_tables import constants, empty_tables, enter, enter_contacts
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.servos import Servos
from manipose_mj.tasks.core.simulation_state import AWAKE_COUNTS

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
        self._pool, self._constants = pool, constants()
        self._lock, self._closed = threading.Lock(), False
        self._models, self._tables = RowModels(pool), empty_tables(pool, worlds)
        self._servos: list[Servos | None] = [None] * worlds
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

        Raises:
          InputError: The simulator is closed.
        """
        # One call at a time, as there is one set of data.
        with self._lock:
            if self._closed:
                raise InputError("these worlds were closed")
            for i in np.flatnonzero(self._rows != rows).tolist():
                self._begin(i, int(rows[i]))
            others = np.flatnonzero((self._words != words).any(axis=1))
            self._rows[:] = -1  # if the rest is interrupted, all worlds begin anew
            if len(others):
                self._put_back(others, np.ascontiguousarray(words).view(float))
            self._step(targets)
            states, diverged, measured = self._seen(rows)
            self._words[:] = states
            self._rows[:] = np.where(diverged, -1, rows)
            return states, diverged, measured

    def held(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The model and data of a world that has made a step and did not diverge in it."""
        servos = self._at(world)
        return servos.model, servos.data

    def close(self) -> None:
        """Ends the threads and forgets all worlds."""
        with self._lock:
            self._closed = True
            if self._threads is not None:
                self._threads.shutdown()
            self._rows[:] = -1
            self._servos[:] = [None] * len(self._rows)

    def _step(self, targets: Float[np.ndarray, "worlds substeps 8"]) -> None:
        robots = self._tables.robots
        if self._threads is None:
            step(self._constants, robots, targets, 0, len(targets))
            return
        running = [
            self._threads.submit(step, self._constants, robots, targets, first, end)
            for first, end in pairwise(self._bounds)
        ]
        try:
            wait(running)
        finally:
            wait(running)  # for what goes on after an interruption, and has the data
        for each in running:
            each.result()

    def _put_back(self, worlds: Int[np.ndarray, " n"], states: Float[np.ndarray, "m k"]) -> None:
        """What `write_simulation` does, in some of the worlds; only Python knows where the counts are."""
        tables, size = self._tables, len(AWAKE_COUNTS)
        begin_putting_back(self._constants, tables, worlds, states)
        firsts = tables.states[worlds] + tables.wholes[worlds].sum(axis=1)
        counts = states[worlds[:, None], firsts[:, None] + np.arange(size)].astype(int).tolist()
        for world, values in zip(worlds.tolist(), counts, strict=True):
            data = self._at(world).data
            for name, count in zip(AWAKE_COUNTS, values, strict=True):
                setattr(data, name, count)
        end_putting_back(self._constants, tables, worlds, states, size)

    def _begin(self, number: int, row: int) -> None:
        """Give a world new data, of another start."""
        self._rows[number] = -1
        model = self._models.at(row)
        start = self._pool.starts[row]
        servos = Servos.of(model, mujoco.MjData(model), start.addresses.servos)
        self._servos[number] = servos
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
        tables, datas = self._tables, [self._at(i).data for i in range(len(rows))]
        states = np.zeros_like(self._words)
        counts = np.array(list(map(_COUNTS, datas)))
        contacts = counts[:, 0]
        read(self._constants, tables, counts[:, 1:], states.view(float))
        for i in np.flatnonzero((contacts > 0) & (tables.contacts == 0)).tolist():
            enter_contacts(tables, i, datas[i])
        measured = FlatMeasurement(
            np.empty((len(rows), self._values)),
            np.zeros((len(rows), *self._touched), bool),
        )
        diverged = np.empty(len(rows), bool)
        measure(self._constants, tables, contacts, *measured, diverged)
        for i in np.flatnonzero(diverged).tolist():
            states[i] = 0
            start = self._pool.starts[rows[i]].measurement
            measured.values[i], measured.contacts[i] = flat_values(start), start.contacts
        return states, diverged, measured


def state_words(pool: StartPool) -> int:
    """How many 32-bit words hold the state of any world."""
    return 2 * max(len(start.simulation) for start in pool.starts)


def packed(state: Float[np.ndarray, "n"], words: int) -> UInt32[np.ndarray, " words"]:
    """Double precision as 32-bit words, which JAX leaves as they are; the rest is zero."""
    room = np.zeros(words // 2)
    room[: len(state)] = state
    return room.view(np.uint32)
