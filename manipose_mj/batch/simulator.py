"""MuJoCo on the CPU, many worlds one after the other: what the engine `c` runs.

A world's simulation stays in its own data from step to step. Its whole state is also returned, and where the
caller goes on from another one, it is put back first: stepping is a function of the state, bit for bit.
"""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor, wait

import mujoco
import numpy as np
from jaxtyping import Float, Int

from manipose_mj.batch.kernels.cpu_loops import Seen, advance
from manipose_mj.batch.measurement import flat_values
from manipose_mj.batch.starts import RowModels, StartPool
from manipose_mj.batch.world_tables import constants, empty_tables, enter
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.servos import Servos


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
        self._kept = np.zeros((worlds, state_size(pool)))  # states as last returned
        one = pool.starts[0].measurement
        self._values, self._touched = len(flat_values(one)), one.contacts.shape
        self._shares = min(threads, worlds)
        self._threads = ThreadPoolExecutor(self._shares) if threads > 1 else None

    def room(self) -> Seen:
        """For what is seen of these worlds after a step."""
        count = len(self._rows)
        return Seen(
            np.zeros_like(self._kept),
            np.zeros((count, self._values), np.float32),
            np.zeros((count, *self._touched), bool),
            np.zeros(count, bool),
        )

    def advance(
        self,
        states: Float[np.ndarray, "worlds n"],
        rows: Int[np.ndarray, " worlds"],
        targets: Float[np.ndarray, "worlds substeps 8"],
        seen: Seen,
    ) -> None:
        """One control step of all worlds.

        Args:
          states: That the worlds go on from, as `packed` gives them.
          rows: Their starts.
          targets: Of the servos in each physics step: joint angles [rad] and the opening [m].
          seen: Written: states, which may be those that were given, measurements, and whether each world diverged. The
            state of one that did has no meaning.

        Raises:
          InputError: The simulator is closed, or states or rows are of other worlds.
        """
        if states.shape != self._kept.shape or rows.shape != self._rows.shape:
            raise InputError(
                f"states of shape {states.shape} and rows of {rows.shape}; these worlds have {self._kept.shape} and "
                f"{self._rows.shape}"
            )
        # One call at a time, as there is one set of data.
        with self._lock:
            if self._closed:
                raise InputError("these worlds were closed")
            for i in np.flatnonzero(self._rows != rows).tolist():
                self._begin(i, int(rows[i]))
            self._rows[:] = -1  # if the rest is interrupted, all worlds begin anew
            self._step(states, targets, seen)
            for i in np.flatnonzero(seen.diverged).tolist():
                seen.states[i] = 0
                start = self._pool.starts[rows[i]].measurement
                seen.values[i], seen.contacts[i] = flat_values(start), start.contacts
            self._rows[:] = np.where(seen.diverged, -1, rows)

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

    def _step(
        self,
        states: Float[np.ndarray, "worlds n"],
        targets: Float[np.ndarray, "worlds substeps 8"],
        seen: Seen,
    ) -> None:
        taken = np.zeros(1, np.int64)
        given = self._constants, self._tables, states, targets, self._kept, seen, taken
        if self._threads is None:
            advance(*given)
            return
        running = [self._threads.submit(advance, *given) for _ in range(self._shares)]
        interruption: BaseException | None = None
        while not all(each.done() for each in running):
            try:
                wait(running)
            except BaseException as error:  # what goes on has the data, and writes to what is seen
                interruption = error
        if interruption is not None:
            raise interruption
        for each in running:
            each.result()

    def _begin(self, number: int, row: int) -> None:
        """Give a world new data, of another start."""
        self._rows[number] = -1
        model = self._models.at(row)
        start = self._pool.starts[row]
        try:
            data = mujoco.MjData(model)
        except mujoco.FatalError as error:
            raise InputError(
                f"world {number} of {len(self._rows)}: no memory for {model.narena / 1e6:.0f} MB more "
                "of addresses: make fewer worlds, or raise the process's limit"
            ) from error
        servos = Servos.of(model, data, start.addresses.servos)
        self._servos[number] = servos
        enter(self._tables, number, start, servos)
        self._rows[number] = row
        self._kept[number] = 0

    def _at(self, number: int) -> Servos:
        servos = self._servos[number]
        assert servos is not None, f"world {number} has not been begun"
        return servos


def state_size(pool: StartPool) -> int:
    """Length of a state that any world fits in, with a last value that says whether anything was left out."""
    return max(len(start.simulation) for start in pool.starts) + 1


def packed(state: Float[np.ndarray, "n"], size: int) -> Float[np.ndarray, " size"]:
    """With zeros behind."""
    return np.pad(state, (0, size - len(state)))
