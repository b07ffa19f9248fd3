"""MuJoCo on the CPU, many worlds one after the other: what each process of the engine `c` runs.

A world's simulation stays in its own data from step to step. Its whole state is also returned, and where the
caller goes on from another one, it is put back first: stepping is a function of the state, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from manipose_mj.batch.measurement import Measurement, measure
from manipose_mj.batch.row_models import RowModels
from manipose_mj.batch.starts import StartPool
from manipose_mj.mjcf.panda.servos import Servos, follow_together
from manipose_mj.tasks.core.simulation_state import (
    read_simulation,
    unflatten,
    write_simulation,
)

_GROUP = 16  # worlds that step side by side; their data stay in the processor's cache
# What MuJoCo warns of when a simulation diverges, as dm_control asks for it.
_DIVERGED = tuple(
    getattr(mujoco.mjtWarning, f"mjWARN_{name}")
    for name in ("INERTIA", "BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
)


@dataclass
class _World:
    """Attributes: row, of its start; model, of it; data; servos; words, its state as last returned."""

    row: int
    model: mujoco.MjModel
    data: mujoco.MjData
    servos: Servos
    words: bytes


class Simulator:
    """Steps worlds of a pool of starts."""

    def __init__(self, pool: StartPool) -> None:
        self._pool = pool
        self._models = RowModels(pool)
        self._substeps = pool.layout.substeps
        self._size = state_words(pool)
        self._worlds: dict[int, _World] = {}

    def advance(
        self,
        worlds: range,
        words: UInt32[np.ndarray, "worlds words"],
        rows: Int[np.ndarray, " worlds"],
        targets: Float[np.ndarray, "worlds substeps 8"],
    ) -> tuple[UInt32[np.ndarray, "worlds words"], Bool[np.ndarray, " worlds"], Measurement]:
        """One control step of some worlds.

        Args:
          worlds: Their numbers, which tell whose data to go on from.
          words: Their states, as `packed` gives them.
          rows: Their starts.
          targets: Of the servos in each physics step: joint angles [rad] and the opening [m].

        Returns:
          Their states, whether each diverged (its state is then without meaning), and measurements.
        """
        states, diverged, measured = np.zeros_like(words), np.zeros(len(rows), bool), []
        for first in range(0, len(rows), _GROUP):
            group = range(first, min(first + _GROUP, len(rows)))
            now = [self._at(worlds[i], words[i], int(rows[i])) for i in group]
            self._step(now, targets[first : group.stop])
            for i, world in zip(group, now, strict=True):
                start = self._pool.starts[rows[i]]
                if any(world.data.warning[kind].number for kind in _DIVERGED):
                    del self._worlds[worlds[i]]
                    diverged[i] = True
                    measured.append(start.measurement)
                    continue
                flat = read_simulation(world.model, world.data).flat()
                states[i] = packed(flat, self._size)
                world.words = states[i].tobytes()
                measured.append(measure(world.model, world.data, start.addresses))
        stacked = Measurement(*(np.stack(field) for field in zip(*measured, strict=True)))
        return states, diverged, stacked

    def held(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The model and data of a world that has made a step and did not diverge in it."""
        return self._worlds[world].model, self._worlds[world].data

    def _step(self, worlds: list[_World], targets: Float[np.ndarray, "worlds substeps 8"]) -> None:
        """The physics steps of some worlds, side by side: NumPy is quicker with all of them at once."""
        servos = [world.servos for world in worlds]
        pairs = [(world.model, world.data) for world in worlds]
        for substep in range(self._substeps):
            follow_together(servos, targets[:, substep])
            for model, data in pairs:
                # The second half of a step, then the first of the next, as the CPU's environment steps.
                mujoco.mj_step2(model, data)
                mujoco.mj_step1(model, data)

    def _at(self, number: int, words: UInt32[np.ndarray, " words"], row: int) -> _World:
        """A world with its data in this state."""
        known = self._worlds.get(number)
        if known is None or known.row != row:
            start, model = self._pool.starts[row], self._models.at(row)
            data = mujoco.MjData(model)
            servos = Servos.of(model, data, start.addresses.servos)
            known = self._worlds[number] = _World(row, model, data, servos, b"")
        if known.words != words.tobytes():
            state = unflatten(known.model, known.data, words.view(float))
            write_simulation(known.model, known.data, state)
        return known


def state_words(pool: StartPool) -> int:
    """How many 32-bit words hold the state of any world."""
    return 2 * max(len(start.simulation) for start in pool.starts)


def packed(state: Float[np.ndarray, "n"], words: int) -> UInt32[np.ndarray, " words"]:
    """Double precision as 32-bit words, which JAX leaves as they are; the rest is zero."""
    room = np.zeros(words // 2)
    room[: len(state)] = state
    return room.view(np.uint32)
