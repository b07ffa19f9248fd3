"""The refiner learns to turn and to shift frames, which a loss that small errors rule never taught it."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from manipose_mj.poses import rotation_angle
from manipose_mj.ppf_jax.points.clouds import batch_clouds
from manipose_mj.ppf_jax.points.rotations import from_vector, to_vector
from manipose_mj.ppf_jax.points.symmetry import common_symmetry, nearest_equivalent
from manipose_mj.ppf_jax.rigid.features import normalised
from manipose_mj.ppf_jax.rigid.refinement import (
    LEVELS,
    Reading,
    RefinementConfig,
    Refiner,
    canonicalised,
    corrected,
    free_space,
)
from manipose_mj.ppf_jax.rigid.voting import Hypotheses
from manipose_mj.ppf_jax.training.losses import refinement_losses
from tests.ppf_jax.half_visible import half_visible_clouds

CONFIG = RefinementConfig(widths=(32, 64), hidden=64, steps=2, free_points=8)
FRAMES, STEPS = 4, 300


def _batch(category):
    clouds = half_visible_clouds(category, [0, 1], 8, points=64)
    batch = batch_clouds(clouds, rng=np.random.default_rng(0), points=64)
    return jax.tree.map(jnp.asarray, batch), common_symmetry(c.symmetry for c in clouds)


def _cloud(sample):
    return normalised(sample.points, sample.normals, sample.mask)


def _truth(sample, cloud):
    origin = (sample.pose[:3, 3] - cloud.centre) / cloud.scale
    return Hypotheses(
        jnp.broadcast_to(sample.pose[:3, :3], (FRAMES, 3, 3)), jnp.broadcast_to(origin, (FRAMES, 3))
    )


def _off_by(truth, radians, shift, key):
    vectors = jax.random.normal(key, (2, FRAMES, 3))
    vectors = vectors / jnp.linalg.norm(vectors, axis=-1, keepdims=True)
    return Hypotheses(
        truth.rotation @ from_vector(radians * vectors[0]), truth.origin + shift * vectors[1]
    )


def _angles(frames, sample):
    def angle(rotation):
        nearest = nearest_equivalent(rotation, sample.pose[:3, :3], sample.symmetry)
        return rotation_angle(rotation, nearest)

    return jax.vmap(angle)(frames.rotation)


def _read(refiner, cloud, frames, key):
    free = free_space(cloud, CONFIG, key=key)
    return refiner.read(cloud, free, jnp.full(3, 0.7), frames, jnp.zeros((FRAMES, 4)))


@pytest.mark.sample(1)
@pytest.mark.parametrize("category", ["hammer", "box", "bowl"])
def test_the_reading_that_costs_nothing_corrects_the_frame(category):
    batch, symmetry = _batch(category)

    def one(sample, key):
        cloud = _cloud(sample)
        truth = _truth(sample, cloud)
        frames = canonicalised(_off_by(truth, 0.5, 0.3, key), cloud, symmetry)
        nearest = jax.vmap(lambda r: nearest_equivalent(r, sample.pose[:3, :3], sample.symmetry))(
            frames.rotation
        )
        inverse = jnp.swapaxes(frames.rotation, 1, 2)
        best = Reading(
            turn=to_vector(inverse @ nearest),
            shift=jnp.einsum("hij,hj->hi", inverse, truth.origin - frames.origin),
            log_extents=jnp.broadcast_to(jnp.log(sample.extents / cloud.scale), (FRAMES, 3)),
            logits=jnp.zeros((FRAMES, len(LEVELS))),
        )
        after = corrected(frames, best)
        cost = refinement_losses(best, frames, cloud, sample)["refine"]
        return cost, _angles(after, sample), after.origin - truth.origin

    keys = jax.random.split(jax.random.key(0), len(batch))
    costs, angles, shifts = jax.jit(jax.vmap(one))(batch, keys)
    assert np.max(costs) < 1e-3 and np.max(angles) < 1e-3 and np.max(np.abs(shifts)) < 1e-5


@pytest.mark.full
def test_the_refiner_learns_to_turn_and_to_shift():
    batch, symmetry = _batch("hammer")
    optimizer = optax.adam(2e-3)

    def losses(refiner, sample, key):
        cloud = _cloud(sample)
        size_key, frame_key, free_key = jax.random.split(key, 3)
        # Evenly in the logarithm, as in training: most frames are nearly right.
        turn, shift = jnp.exp(
            jax.random.uniform(
                size_key, (2,), minval=jnp.log(jnp.array([0.005, 0.005])), maxval=jnp.log(0.7)
            )
        )
        frames = canonicalised(
            _off_by(_truth(sample, cloud), turn, shift, frame_key), cloud, symmetry
        )
        reading = _read(refiner, cloud, frames, free_key)
        return refinement_losses(reading, frames, cloud, sample)["refine"]

    @eqx.filter_jit
    def trained(refiner, batch, key):
        arrays, rest = eqx.partition(refiner, eqx.is_array)

        def step(state, key):
            arrays, memory = state
            keys = jax.random.split(key, len(batch))
            gradient = jax.grad(
                lambda a: jnp.mean(
                    jax.vmap(lambda s, k: losses(eqx.combine(a, rest), s, k))(batch, keys)
                )
            )(arrays)
            updates, memory = optimizer.update(gradient, memory)
            return (eqx.apply_updates(arrays, updates), memory), None

        state = (arrays, optimizer.init(arrays))
        (arrays, _), _ = jax.lax.scan(step, state, jax.random.split(key, STEPS))
        return eqx.combine(arrays, rest)

    refiner = trained(Refiner(CONFIG, rng=np.random.default_rng(0)), batch, jax.random.key(1))

    def measured(sample, key):
        cloud = _cloud(sample)
        truth = _truth(sample, cloud)
        after = _off_by(truth, 0.5, 0.4, key)
        for _ in range(CONFIG.steps):
            after = corrected(after, _read(refiner, cloud, after, key))
        return _angles(after, sample), jnp.linalg.norm(after.origin - truth.origin, axis=-1)

    keys = jax.random.split(jax.random.key(2), len(batch))
    angles, shifts = jax.jit(jax.vmap(measured))(batch, keys)
    assert np.median(angles) < 0.5 * 0.5, np.median(angles)
    assert np.median(shifts) < 0.7 * 0.4, np.median(shifts)
