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
from manipose_mj.mjcf.panda.servos import Servos
from manipose_mj.tasks.core.simulation_state import (
    read_simulation,
    unflatten,
    write_simulation,
)

# What MuJoCo warns of when a simulation diverges, as dm_control asks for it.
_DIVERGED = tuple(
    getattr(mujoco.mjtWarning, f"mjWARN_{name}")
    for name in ("INERTIA", "BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
)


@dataclass
class _World:
    """Attributes: scene, its model's number; data; servos; words, its state as last returned."""

    scene: int
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
        for i, (world, row) in enumerate(zip(worlds, rows.tolist(), strict=True)):
            states[i], diverged[i], now = self._advance(world, words[i], row, targets[i])
            measured.append(now)
        stacked = Measurement(*(np.stack(field) for field in zip(*measured, strict=True)))
        return states, diverged, stacked

    def _advance(
        self,
        world: int,
        words: UInt32[np.ndarray, " words"],
        row: int,
        targets: Float[np.ndarray, "substeps 8"],
    ) -> tuple[UInt32[np.ndarray, " words"], bool, Measurement]:
        start = self._pool.starts[row]
        model = self._models.at(row)
        now = self._at(world, words, row, model)
        data, follow = now.data, now.servos.follow
        for target in targets:
            follow(target)
            # The second half of a step, then the first of the next, as the CPU's environment steps.
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)
        diverged = any(data.warning[kind].number for kind in _DIVERGED)
        if diverged:
            del self._worlds[world]
            return words, True, start.measurement
        after = packed(read_simulation(model, data).flat(), self._size)
        now.words = after.tobytes()
        return after, False, measure(model, data, start.addresses)

    def _at(
        self, world: int, words: UInt32[np.ndarray, " words"], row: int, model: mujoco.MjModel
    ) -> _World:
        """The world with its data in this state."""
        start = self._pool.starts[row]
        known = self._worlds.get(world)
        if known is None or known.scene != start.scene:
            data = mujoco.MjData(model)
            servos = Servos.of(model, data, start.addresses.servos)
            known = self._worlds[world] = _World(start.scene, data, servos, b"")
        if known.words != words.tobytes():
            write_simulation(model, known.data, unflatten(model, known.data, words.view(float)))
        return known


def state_words(pool: StartPool) -> int:
    """How many 32-bit words hold the state of any world."""
    return 2 * max(len(start.simulation) for start in pool.starts)


def packed(state: Float[np.ndarray, "n"], words: int) -> UInt32[np.ndarray, " words"]:
    """Double precision as 32-bit words, which JAX leaves as they are; the rest is zero."""
    room = np.zeros(words // 2)
    room[: len(state)] = state
    return room.view(np.uint32)
