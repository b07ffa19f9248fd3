"""The engine `c`: MuJoCo on the CPU, in this process or in several; bit for bit the CPU task's physics."""

from __future__ import annotations

from concurrent.futures import Future, ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from manipose_mj.batch.measurement import Measurement
from manipose_mj.batch.simulator import Simulator, packed, state_words
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import InputError
from manipose_mj.poses import Array

_simulator: Simulator | None = None  # of a worker's process

Words = UInt32[np.ndarray, "worlds words"]
Advanced = tuple[Words, Bool[np.ndarray, " worlds"], Measurement]


class CEngine:
    """Worlds are split evenly over processes, each of which keeps the data of its own."""

    name = "c"

    def __init__(self, pool: StartPool, worlds: int, *, processes: int = 1) -> None:
        """Starts the processes.

        Args:
          pool: Of starts.
          worlds: How many there are.
          processes: That step them; one: this one.

        Raises:
          InputError: There would be none.
        """
        if processes < 1:
            raise InputError(f"processes is {processes}; expected at least 1")
        self._pool, self._worlds = pool, worlds
        processes = min(processes, worlds)
        bounds = np.linspace(0, worlds, processes + 1).astype(int)
        self._chunks = [range(a, b) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        self._local = Simulator(pool) if processes == 1 else None
        self._workers: list[ProcessPoolExecutor] = []
        if self._local is None:
            # One executor a process: a world stays with the process that has its data.
            make = partial(
                ProcessPoolExecutor,
                max_workers=1,
                mp_context=get_context("spawn"),
                initializer=_begin,
                initargs=(pool,),
            )
            self._workers = [make() for _ in self._chunks]
        measurement = pool.starts[0].measurement
        words = state_words(pool)
        self._shapes = (
            jax.ShapeDtypeStruct((worlds, words), jnp.uint32),
            jax.ShapeDtypeStruct((worlds,), jnp.bool_),
            Measurement(
                *(
                    jax.ShapeDtypeStruct(
                        (worlds, *field.shape), field.dtype if field.dtype == bool else jnp.float32
                    )
                    for field in measurement
                )
            ),
        )

    def starts(self) -> UInt32[Array, "starts words"]:
        words = state_words(self._pool)
        return jnp.asarray(np.stack([packed(s.simulation, words) for s in self._pool.starts]))

    def advance(
        self,
        physics: UInt32[Array, "worlds words"],
        rows: Int[Array, " worlds"],
        targets: Float[Array, "worlds substeps 8"],
    ) -> tuple[UInt32[Array, "worlds words"], Bool[Array, " worlds"], Measurement]:
        return jax.pure_callback(self._advance, self._shapes, physics, rows, targets)

    def overflowed(self, physics: UInt32[Array, "worlds words"]) -> Bool[Array, " worlds"]:
        return jnp.zeros(len(physics), bool)

    def close(self) -> None:
        for worker in self._workers:
            worker.shutdown(cancel_futures=True)
        self._workers = []

    def _advance(self, physics: Array, rows: Array, targets: Array) -> Advanced:
        words, rows = np.asarray(physics), np.asarray(rows)
        targets = np.asarray(targets, float)
        if self._local is not None:
            return _single(self._local.advance(self._chunks[0], words, rows, targets))
        waiting: list[Future[Advanced]] = [
            worker.submit(
                _step, chunk, *(a[chunk.start : chunk.stop] for a in (words, rows, targets))
            )
            for worker, chunk in zip(self._workers, self._chunks, strict=True)
        ]
        parts = [future.result() for future in waiting]
        return jax.tree.map(lambda *each: np.concatenate(each), *parts)


def _single(advanced: Advanced) -> Advanced:
    """Measurements in the precision that JAX has."""
    words, diverged, measured = advanced
    return words, diverged, Measurement(*map(_as_single, measured))


def _as_single(field: np.ndarray) -> np.ndarray:
    return field if field.dtype == bool else field.astype(np.float32)


def _begin(pool: StartPool) -> None:
    global _simulator
    _simulator = Simulator(pool)


def _step(chunk: range, words: Words, rows: np.ndarray, targets: np.ndarray) -> Advanced:
    assert _simulator is not None
    return _single(_simulator.advance(chunk, words, rows, targets))
