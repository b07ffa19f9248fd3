"""The engine `c`: MuJoCo on the CPU, in this process or in several; bit for bit the CPU task's physics."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from manipose_mj.batch.measurement import FlatMeasurement, Measurement, flat_values
from manipose_mj.batch.simulator import Simulator, packed, state_words
from manipose_mj.batch.starts import RowModels, StartPool
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_camera import RayCamera
from manipose_mj.poses import Array
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation

_simulator: Simulator | None = None  # of a worker's process

Words = UInt32[np.ndarray, "worlds words"]
Advanced = tuple[Words, Bool[np.ndarray, " worlds"], FlatMeasurement]


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
          InputError: They do not start.
        """
        self._pool, self._worlds = pool, worlds
        processes = min(processes, worlds)
        bounds = np.linspace(0, worlds, processes + 1).astype(int)
        self._chunks = [range(a, b) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        self._local = Simulator(pool, worlds) if processes == 1 else None
        self._workers: list[ProcessPoolExecutor] = []
        if self._local is None:
            # One executor a process: a world stays with the process that has its data.
            self._workers = [
                ProcessPoolExecutor(max_workers=1, mp_context=get_context("spawn"))
                for _ in self._chunks
            ]
            _begin_all(self._workers, pool, self._chunks)
        self._one = pool.starts[0].measurement
        shapes = jax.ShapeDtypeStruct
        self._shapes = (
            shapes((worlds, state_words(pool)), jnp.uint32),
            shapes((worlds,), jnp.bool_),
            FlatMeasurement(
                shapes((worlds, len(flat_values(self._one))), jnp.float32),
                shapes((worlds, *self._one.contacts.shape), jnp.bool_),
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
        after, diverged, measured = jax.pure_callback(
            self._advance, self._shapes, physics, rows, targets
        )
        return after, diverged, measured.split(self._one)

    def overflowed(self, physics: UInt32[Array, "worlds words"]) -> Bool[Array, " worlds"]:
        return jnp.zeros(len(physics), bool)

    def renderer(
        self, cameras: tuple[str, ...], height: int, width: int, rgb: bool
    ) -> Callable[[Array, Array], tuple[Array, Array, None]]:
        if rgb:
            raise InputError(
                "engine 'c' renders depth and segmentation; colours need engine 'warp'"
            )
        models, camera = RowModels(self._pool), RayCamera(height, width)
        pixels = (self._worlds, len(cameras), height, width)
        shapes = (
            jax.ShapeDtypeStruct(pixels, jnp.float32),
            jax.ShapeDtypeStruct(pixels, jnp.int32),
        )

        def render(physics: Array, rows: Array) -> tuple[np.ndarray, np.ndarray]:
            depth, geoms = np.zeros(pixels, np.float32), np.zeros(pixels, np.int32)
            for world, (words, row) in enumerate(
                zip(np.asarray(physics), np.asarray(rows), strict=True)
            ):
                model = models.at(int(row))
                data = mujoco.MjData(model)
                write_simulation(model, data, unflatten(model, data, words.view(float)))
                for i, name in enumerate(cameras):
                    seen = camera.render(model, data, name)
                    depth[world, i], geoms[world, i] = seen.depth, seen.geom_id
            return depth, geoms

        def call(physics: Array, rows: Array) -> tuple[Array, Array, None]:
            return *jax.pure_callback(render, shapes, physics, rows), None

        return call

    def scene_geoms(self, row: int) -> Int[np.ndarray, " geoms"]:
        return np.arange(len(self._pool.starts[row].instances))

    def close(self) -> None:
        for worker in self._workers:
            worker.shutdown(cancel_futures=True)
        self._workers = []

    def _advance(self, physics: Array, rows: Array, targets: Array) -> Advanced:
        words, rows = np.asarray(physics), np.asarray(rows)
        targets = np.asarray(targets, float)
        if self._local is not None:
            return _single(self._local.advance(words, rows, targets))
        waiting: list[Future[Advanced]] = [
            worker.submit(_step, *(a[chunk.start : chunk.stop] for a in (words, rows, targets)))
            for worker, chunk in zip(self._workers, self._chunks, strict=True)
        ]
        parts = [future.result() for future in waiting]
        return jax.tree.map(lambda *each: np.concatenate(each), *parts)


def _begin_all(workers: list[ProcessPoolExecutor], pool: StartPool, chunks: list[range]) -> None:
    """Gives every process its worlds.

    Raises:
      InputError: One does not start.
    """
    # Not as the executors' initialisers: the whole pool would be written to a process that may be gone by then.
    begun = [
        worker.submit(_begin, pool, len(chunk))
        for worker, chunk in zip(workers, chunks, strict=True)
    ]
    try:
        for each in begun:
            each.result()
    except BrokenProcessPool:
        for worker in workers:
            worker.shutdown(wait=False, cancel_futures=True)
        raise InputError(
            "processes: they do not start; each runs your script anew, whose own work has to stand under "
            'if __name__ == "__main__":'
        ) from None


def _single(advanced: Advanced) -> Advanced:
    """Measurements in the precision that JAX has."""
    words, diverged, measured = advanced
    return words, diverged, measured._replace(values=measured.values.astype(np.float32))


def _begin(pool: StartPool, worlds: int) -> None:
    global _simulator
    _simulator = Simulator(pool, worlds)


def _step(words: Words, rows: np.ndarray, targets: np.ndarray) -> Advanced:
    assert _simulator is not None
    return _single(_simulator.advance(words, rows, targets))
