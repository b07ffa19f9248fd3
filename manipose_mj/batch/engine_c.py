"""The engine `c`: MuJoCo on the CPU, in one thread or in several; bit for bit the CPU task's physics."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

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

Words = UInt32[np.ndarray, "worlds words"]
Advanced = tuple[Words, Bool[np.ndarray, " worlds"], FlatMeasurement]


class CEngine:
    """Worlds are split evenly over threads, each of which steps its own."""

    name = "c"

    def __init__(self, pool: StartPool, worlds: int, *, threads: int = 1) -> None:
        """Prepares the worlds.

        Args:
          pool: Of starts.
          worlds: How many there are.
          threads: That step them.
        """
        self._pool, self._worlds = pool, worlds
        self._simulator = Simulator(pool, worlds, threads=threads)
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
        # One array, since each costs JAX as much as the step of a world takes.
        parts = (physics, rows.astype(jnp.int32), targets)
        words = [jax.lax.bitcast_convert_type(part, jnp.uint32) for part in parts]
        given = jnp.concatenate([part.reshape(len(rows), -1) for part in words], axis=1)
        after, diverged, measured = jax.pure_callback(
            partial(self._advance, targets.dtype), self._shapes, given
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
        self._simulator.close()

    def _advance(self, real: np.dtype, given: Array) -> Advanced:
        words = np.asarray(given)
        size = self._shapes[0].shape[1]
        rows, targets = words[:, size].view(np.int32), words[:, size + 1 :].view(real)
        after, diverged, measured = self._simulator.advance(
            words[:, :size], rows, targets.reshape(len(words), -1, 8).astype(float)
        )
        # In the precision that JAX has.
        return after, diverged, measured._replace(values=measured.values.astype(np.float32))
