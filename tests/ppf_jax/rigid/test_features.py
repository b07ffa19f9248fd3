"""Pair features know shape and view, not pose; and tell a shape from its mirror image."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manipose_mj.poses import quaternion_to_rotation
from manipose_mj.ppf_jax.rigid.features import (
    PAIR_FEATURES,
    edge_features,
    neighbours,
    normalised,
    random_pairs,
    sampled,
)

COUNT, REAL = 48, 40


@pytest.fixture(scope="module")
def cloud():
    rng = np.random.default_rng(3)
    points = np.zeros((COUNT, 3), np.float32)
    normals = np.zeros((COUNT, 3), np.float32)
    points[:REAL] = rng.normal(scale=0.05, size=(REAL, 3)) + [0.1, 0.05, 0.7]
    normals[:REAL] = rng.normal(size=(REAL, 3))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    return points, normals, np.arange(COUNT) < REAL


def _all_edges(points, normals, mask):
    seen = normalised(points, normals, mask)
    everyone = np.broadcast_to(np.arange(len(points)), (len(points), len(points)))
    return np.asarray(edge_features(seen, everyone))[:REAL, :REAL]


@settings(max_examples=10, deadline=None)
@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_turning_the_scene_about_the_camera_changes_nothing(cloud, quaternion):
    points, normals, mask = cloud
    rotation = quaternion_to_rotation(np.array(quaternion)).astype(np.float32)
    turned = _all_edges(points @ rotation.T, normals @ rotation.T, mask)
    off_diagonal = ~np.eye(REAL, dtype=bool)
    assert np.allclose(turned[off_diagonal], _all_edges(*cloud)[off_diagonal], atol=2e-3)


def test_points_are_seen_from_where_their_cameras_are(cloud):
    points, normals, mask = cloud
    one = normalised(points, normals, mask)
    at_origin = normalised(points, normals, mask, np.zeros_like(points))
    np.testing.assert_array_equal(one.views, at_origin.views)
    eyes = np.where(np.arange(len(points))[:, None] % 2, 0.0, [1.0, 0.5, 0.2]).astype(np.float32)
    several = normalised(points, normals, mask, eyes)
    np.testing.assert_array_equal(several.points, one.points)
    metric = np.asarray(several.points) * float(several.scale) + np.asarray(several.centre)
    kept = np.asarray(several.mask)
    off = [
        np.linalg.norm(np.cross(several.views, eye - metric), axis=1)
        for eye in (np.zeros(3), np.array([1.0, 0.5, 0.2]))
    ]
    assert (np.minimum(*off)[kept] < 1e-4).all()
    assert 0 < (off[1] < 1e-4)[kept].mean() < 1


def test_strays_of_the_background_are_left_out(cloud):
    points, normals, mask = (leaf.copy() for leaf in cloud)
    strays = [3, 17]
    points[strays] += [0.0, 0.1, 0.9]  # a wall, seen beside the object
    seen = normalised(points, normals, mask)
    clean = normalised(*(np.delete(leaf, strays, axis=0) for leaf in (points, normals, mask)))
    assert int(seen.count) == REAL - 2
    assert np.all(np.asarray(seen.mask)[: REAL - 2])  # points first, padding last
    np.testing.assert_allclose(seen.centre, clean.centre, atol=1e-6)
    np.testing.assert_allclose(seen.points[: REAL - 2], clean.points[: REAL - 2], atol=1e-4)
    np.testing.assert_allclose(seen.normals[REAL - 2 :], 0.0)


def test_features_do_not_depend_on_size(cloud):
    points, normals, mask = cloud
    off_diagonal = ~np.eye(REAL, dtype=bool)
    larger = _all_edges(3 * points, normals, mask)
    assert larger.shape == (REAL, REAL, PAIR_FEATURES)
    assert np.allclose(larger[off_diagonal], _all_edges(*cloud)[off_diagonal], atol=2e-3)


def test_a_mirror_image_differs_in_the_triple_products_alone(cloud):
    points, normals, mask = cloud
    flip = np.array([-1, 1, 1], np.float32)
    own, mirrored = _all_edges(*cloud), _all_edges(points * flip, normals * flip, mask)
    off_diagonal = ~np.eye(REAL, dtype=bool)
    signs = np.array([1, 1, 1, 1, -1, 1, 1, 1, -1, -1])
    assert np.allclose(mirrored[off_diagonal], (own * signs)[off_diagonal], atol=2e-3)
    assert np.abs(own[off_diagonal][:, 4]).mean() > 0.1


def test_padding_is_no_neighbour_and_in_no_pair(cloud):
    seen = normalised(*cloud)
    rows, near = neighbours(seen, 5)
    assert np.all(np.asarray(near)[:REAL]) and np.all(np.asarray(rows)[:REAL] < REAL)
    points = np.asarray(seen.points)[:REAL]
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1) + 1e3 * np.eye(REAL)
    assert np.array_equal(
        np.sort(np.asarray(rows)[:REAL], axis=1), np.sort(np.argsort(distances, axis=1)[:, :5])
    )
    first, second = (np.asarray(r) for r in random_pairs(seen, 4000, key=jax.random.key(0)))
    assert max(first.max(), second.max()) < REAL and np.all(first != second)
    # Evenly: 100 are expected of each, with a standard deviation of 10.
    for drawn in (first, (second - first) % REAL):
        assert abs(np.bincount(drawn, minlength=REAL)[-(REAL - 1) :] - 100).max() < 50


def test_a_sample_has_its_points_first(cloud):
    points, normals, mask = cloud
    order = np.random.default_rng(0).permutation(COUNT)
    drawn, _, kept = sampled(
        points[order], normals[order], mask[order], count=44, key=jax.random.key(1)
    )
    kept = np.asarray(kept)
    assert kept[:REAL].all() and not kept[REAL:].any()
    assert len(np.unique(np.asarray(drawn)[:REAL], axis=0)) == REAL


def test_stray_points_hardly_move_the_scale(cloud):
    points, normals, mask = cloud
    before = float(normalised(points, normals, mask).scale)
    stray = points.copy()
    stray[:4] += [0.0, 0.0, 0.4]
    assert float(normalised(stray, normals, mask).scale) == pytest.approx(before, rel=0.5)
