"""Noise, normals and clouds of many images against those of the CPU's cameras."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.batch.perception.cameras import Images
from manipose_mj.batch.perception.clouds import (
    fitted_normals,
    incidence,
    noisy_images,
    object_clouds,
)
from manipose_mj.mjcf.cameras.depth_noise import KINECT, Draws, StructuredLight, measure_with
from manipose_mj.mjcf.cameras.depth_normals import depth_normals
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics

HEIGHT, WIDTH = 48, 64
PINHOLE = Intrinsics(WIDTH, HEIGHT, 60.0, 60.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
EXACT = StructuredLight(disparity_step=0.0, noise=0.0)
NUMBERS = np.array([PINHOLE.fx, PINHOLE.fy, PINHOLE.cx, PINHOLE.cy], np.float32)


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A slanted floor with a nearer slanted plate on it: depth, instances, cosines of incidence."""
    x, y = np.moveaxis(PINHOLE.slopes(), -1, 0)
    ray = np.stack([x, y, np.ones_like(x)], axis=-1)

    def plane(normal, away):
        normal = np.asarray(normal) / np.linalg.norm(normal)
        depth = away / (ray @ normal)
        return depth, (ray @ normal) / np.linalg.norm(ray, axis=-1)

    floor, over_floor = plane((0.1, 0.4, 1.0), 1.0)
    plate, over_plate = plane((-0.5, 0.1, 1.0), 0.75)
    on = (np.abs(x) < 0.25) & (np.abs(y) < 0.2)
    depth, cosine = np.where(on, plate, floor), np.where(on, over_plate, over_floor)
    depth[:3] = 0.0
    return depth, np.where(on, 2, 0).astype(np.int32), cosine


def images(worlds: int) -> Images:
    depth, instance, _ = scene()
    return Images(
        jnp.asarray(np.tile(depth, (worlds, 1, 1, 1)), jnp.float32),
        jnp.asarray(np.tile(instance, (worlds, 1, 1, 1))),
        None,
        jnp.asarray(np.tile(np.eye(4), (worlds, 1, 1, 1)), jnp.float32),
        jnp.asarray(np.tile(NUMBERS, (worlds, 1, 1))),
    )


def test_incidence_is_that_of_the_surfaces():
    depth, _, cosine = scene()
    found = jax.jit(incidence)(jnp.asarray(depth, jnp.float32), jnp.asarray(NUMBERS))
    np.testing.assert_allclose(np.asarray(found)[depth > 0], cosine[depth > 0], atol=2e-3)


@pytest.mark.parametrize("sensor", [KINECT, EXACT], ids=["noise", "none"])
def test_the_same_draws_give_the_same_noise_in_jax(sensor):
    depth, _, cosine = scene()
    rng = np.random.default_rng(0)
    shape = depth.shape
    drawn = rng.standard_normal((2, *shape)), rng.standard_normal(shape), rng.random(shape)
    expected = measure_with(depth, cosine, PINHOLE.fx, Draws(*drawn), sensor)
    ours = Draws(*(jnp.asarray(each, jnp.float32) for each in drawn))
    exact = jnp.asarray(depth, jnp.float32), jnp.asarray(cosine, jnp.float32)
    found = measure_with(*exact, PINHOLE.fx, ours, sensor)
    same = np.isclose(found.depth, expected.depth, atol=1e-5)
    assert same.mean() > 0.995  # the rest falls on the other side of a step
    assert (np.asarray(found.rows) == expected.rows).mean() > 0.999


@pytest.mark.full
def test_noise_has_the_spread_of_the_sensor():
    noisy = jax.jit(noisy_images)(images(40), jax.random.key(0))
    depth, instance, _ = scene()
    middle = (np.s_[HEIGHT // 2 - 4 : HEIGHT // 2 + 4], np.s_[WIDTH // 2 - 4 : WIDTH // 2 + 4])
    measured = np.asarray(noisy.depth)[:, 0][:, *middle]
    spread = np.std(np.where(measured > 0, measured - depth[middle], 0.0))
    assert 0.0010 < spread < 0.0025  # 1.3 mm at 0.75 m, and the steps
    assert 0 < (measured == 0).mean() < 0.05
    assert (np.asarray(noisy.instance)[:, 0] != instance).mean() < 0.05


@pytest.mark.parametrize("noise", [True, pytest.param(False, marks=pytest.mark.full)])
def test_normals_are_those_of_the_cpu(noise):
    depth, instance, _ = scene()
    if noise:
        depth = depth * (1 + 0.002 * np.random.default_rng(1).standard_normal(depth.shape))
    mask = (instance == 2) & (depth > 0)
    pixels = np.argwhere(mask)[::5]
    expected = depth_normals(depth, mask, pixels, PINHOLE)
    row, column = (jnp.asarray(p, jnp.int32) for p in pixels.T)
    found = jax.jit(fitted_normals)(
        jnp.asarray(depth, jnp.float32), jnp.asarray(mask), row, column,
        jnp.ones(len(pixels), bool), jnp.asarray(NUMBERS),
    )  # fmt: skip
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.full
def test_clouds_hold_points_of_the_instance_alone():
    # The last world has no such object, whose instance is that of the surroundings.
    wanted = jnp.asarray([2, 2, 7, 0], jnp.int32)
    clouds = jax.jit(object_clouds, static_argnums=(1, 3))(
        images(4), 0, wanted, 128, jax.random.key(0)
    )
    assert clouds.points.shape == (4, 128, 3)
    mask = np.asarray(clouds.mask)
    assert mask[:2].all() and not mask[2:].any()
    points, normals = np.asarray(clouds.points), np.asarray(clouds.normals)
    normal = np.array([-0.5, 0.1, 1.0]) / np.linalg.norm([-0.5, 0.1, 1.0])
    np.testing.assert_allclose(points[:2] @ normal, 0.75, atol=1e-4)
    inside = np.abs(points[:2, :, 0] / points[:2, :, 2]) < 0.2
    assert ((normals[:2] @ -normal)[inside] > 0.99).all()
    assert not points[2:].any() and not np.array_equal(points[0], points[1])
