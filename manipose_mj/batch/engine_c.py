"""The engine `c`: MuJoCo on the CPU, in one thread or in several; bit for bit the CPU task's physics."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from manipose_mj.batch.kernels.cpu_loops import Seen
from manipose_mj.batch.kernels.direct_call import DirectCall
from manipose_mj.batch.measurement import FlatMeasurement, Measurement, flat_values
from manipose_mj.batch.simulator import Simulator, packed, state_size
from manipose_mj.batch.starts import RowModels, StartPool
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_camera import RayCamera
from manipose_mj.poses import Array
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation

# Of a world, times the values of its data: what MuJoCo and XLA write beside these.
_SCRATCH = 10


class CEngine:
    """Threads share the worlds, of which each steps the next that nobody has begun with."""

    name = "c"

    def __init__(self, pool: StartPool, worlds: int, *, threads: int = 1) -> None:
        """Prepares the worlds.

        Args:
          pool: Of starts.
          worlds: How many there are.
          threads: That step them.

        Raises:
          InputError: This machine has too little memory.
        """
        self._pool, self._worlds = pool, worlds
        self._require_room()
        self._simulator = Simulator(pool, worlds, threads=threads)
        self._one = pool.starts[0].measurement
        shapes = jax.ShapeDtypeStruct
        self._physics = shapes((worlds, 2 * state_size(pool)), jnp.uint32)
        self._call = DirectCall(
            self._advance,
            (
                self._physics,
                shapes((worlds,), jnp.bool_),
                shapes((worlds, len(flat_values(self._one))), jnp.float32),
                shapes((worlds, *self._one.contacts.shape), jnp.bool_),
            ),
        )

    def _require_room(self) -> None:
        """Raises InputError where this machine has less memory than the worlds take."""
        if not hasattr(os, "sysconf"):
            return
        one = max(mujoco.MjData(model).nbuffer for model in self._pool.scenes)
        model = max(mujoco.mj_sizeModel(model) for model in self._pool.scenes)
        needed = _SCRATCH * one * self._worlds + model * min(self._worlds, len(self._pool.starts))
        there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        if needed > there:
            raise InputError(
                f"{self._worlds} worlds of this task take about {needed / 1e9:.0f} GB of memory; "
                f"this machine has {there / 1e9:.0f} GB: make fewer"
            )

    def starts(self) -> UInt32[Array, "starts words"]:
        size = state_size(self._pool)
        states = np.stack([packed(start.simulation, size) for start in self._pool.starts])
        # Double precision as words, which JAX leaves as they are.
        return jax.device_put(states.view(np.uint32))

    def advance(
        self,
        physics: UInt32[Array, "worlds words"],
        rows: Int[Array, " worlds"],
        targets: Float[Array, "worlds substeps 8"],
    ) -> tuple[UInt32[Array, "worlds words"], Bool[Array, " worlds"], Measurement]:
        expected = self._physics.shape
        if physics.shape != expected:
            raise InputError(
                f"the state is of other worlds: its simulation has shape {physics.shape}, expected {expected}"
            )
        after, diverged, values, contacts = self._call(physics, rows.astype(jnp.int32), targets)
        return after, diverged, FlatMeasurement(values, contacts).split(self._one)

    def overflowed(self, physics: UInt32[Array, "worlds words"]) -> Bool[Array, " worlds"]:
        return (physics[:, -2:] != 0).any(axis=1)  # the words of a state's last value

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
        # Of steps that are still to be made the results may be needed; who asks for them learns of errors.
        with suppress(jax.errors.JaxRuntimeError):
            jax.effects_barrier()
        self._simulator.close()

    def _advance(
        self,
        words: UInt32[np.ndarray, "worlds words"],
        rows: Int[np.ndarray, " worlds"],
        targets: Float[np.ndarray, "worlds substeps 8"],
        *written: np.ndarray,
    ) -> None:
        after, diverged, values, contacts = written
        seen = Seen(after.view(float), values, contacts, diverged)
        self._simulator.advance(words.view(float), rows, targets, seen)
