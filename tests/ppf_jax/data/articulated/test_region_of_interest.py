"""Regions of interest: what is drawn around supposed handles, and that training draws alike."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.ppf_jax.data.articulated.clouds import FurnitureScene, batch_furniture, fused_cloud
from manipose_mj.ppf_jax.data.articulated.furniture_view import thinned
from manipose_mj.ppf_jax.data.articulated.region_of_interest import (
    RegionOfInterest,
    region_rows,
    region_training_rows,
)
from manipose_mj.ppf_jax.data.articulated.subject import catalogue_furniture
from manipose_mj.ppf_jax.data.articulated.views import FURNITURE_SETTINGS, render_furniture

REGION = RegionOfInterest()
WAYS = np.tile([0.0, 0.0, -1.0], (3, 1)).astype(np.float32)
resampled = jax.jit(region_rows, static_argnums=(5, 6))
PLACES = np.array([[0.3, 0.0, 0.97], [-0.3, 0.0, 0.97], [0.0, 0.6, 0.97]], np.float32)


@pytest.fixture(scope="module")
def wall():
    """A wall 1 m away with two knobs, of 300 and of 40 points, 3 cm before it."""
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.uniform(-0.7, 0.7, (60_000, 2)), np.ones(60_000)])
    knobs = [
        place + rng.uniform(-0.01, 0.01, (n, 3))
        for place, n in zip(PLACES, (300, 40), strict=False)
    ]
    points = np.concatenate([flat, *knobs]).astype(np.float32)
    return points[rng.permutation(len(points))]


def test_a_region_of_interest_shows_small_handles(wall):
    padded = np.concatenate([wall, np.zeros((500, 3), np.float32)])
    mask = jnp.arange(len(padded)) < len(wall)
    likely = jnp.array([True, True, False])
    rows = np.asarray(
        resampled(padded, mask, PLACES, WAYS, likely, 2048, REGION, key=jax.random.key(0))
    )
    assert len(np.unique(rows)) == 2048 and rows.max() < len(wall)
    seen = padded[rows]
    near = np.linalg.norm(seen[:, None] - PLACES, axis=-1) < REGION.radius
    # Four groups, of which one has 40 points and another 300; the others share the rest.
    on = seen[:, 2] < 0.99
    assert (on & near[:, 1]).sum() == 40
    assert (on & near[:, 0]).sum() == pytest.approx(240, abs=30)
    assert near[:, :2].any(axis=1).sum() == pytest.approx(1024, abs=60)
    assert near[:, 2].sum() < 40  # an unlikely place is like any other
    # In random order.
    assert near[:512, :2].any() and not near[:8, :2].all()


def test_few_points_are_all_taken(wall):
    mask = jnp.arange(1000) < 700
    likely = jnp.ones(3, bool)
    rows = np.asarray(
        resampled(wall[:1000], mask, PLACES, WAYS, likely, 800, REGION, key=jax.random.key(1))
    )
    assert set(rows[:700]) == set(range(700)) and (rows[700:] >= 700).all()


def test_training_draws_as_inference_does(wall):
    """From a cloud that is kept whole only around some places."""
    rng = np.random.default_rng(1)
    spots = np.stack([PLACES, WAYS], axis=1)
    kept, count = thinned(wall, spots, 4096, REGION, rng)
    assert count == 4096 and len(np.unique(kept)) == len(kept) < 0.2 * len(wall)
    even = np.arange(len(kept)) < count
    rows = region_training_rows(wall[kept], even, PLACES, WAYS, 2048, REGION, rng)
    ours = wall[kept][rows]
    theirs = wall[
        np.asarray(
            resampled(
                wall,
                np.ones(len(wall), bool),
                PLACES,
                WAYS,
                jnp.ones(3, bool),
                2048,
                REGION,
                key=jax.random.key(2),
            )
        )
    ]
    for place in PLACES:
        for out in (False, True):

            def share(points, place=place, out=out):
                near = np.linalg.norm(points - place, axis=1) < REGION.radius
                return int(np.sum(near & ((points[:, 2] < 0.98) == out)))

            assert share(ours) == pytest.approx(share(theirs), abs=45)


def test_views_for_training_keep_all_of_the_handles():
    cabinet = catalogue_furniture("cabinet", 0)
    openings = np.zeros(len(cabinet.joints))
    views = []
    for dense in (False, True):
        setting = dataclasses.replace(
            FURNITURE_SETTINGS["training"], image_heights=(240,), dense_regions=dense, points=1024
        )
        rng = np.random.default_rng(5)
        views.append(render_furniture(cabinet, openings, setting, rng))
    plain, dense = views
    assert plain.even == len(plain.points) == dense.even == 1024
    assert plain.pixels == dense.pixels > 4 * 1024
    assert dense.handle.sum() > 3 * plain.handle.sum() > 0
    assert dense.handle.sum() >= 0.9 * dense.handle_pixels.sum() / 4
    np.testing.assert_allclose(np.linalg.norm(dense.normals, axis=1), 1.0, atol=1e-5)
    scene = FurnitureScene("a/0", "cabinet", cabinet.label.pose, cabinet.joints, openings, (dense,))
    cloud = fused_cloud(scene, [0])
    rng = np.random.default_rng(0)
    even = batch_furniture([cloud], rng=rng, points=1024, focus=0.0)
    closer = batch_furniture([cloud], rng=rng, points=1024, focus=1.0)
    assert even.mask.all() and closer.mask.all()
    assert closer.handle.sum() > 2 * even.handle.sum()
