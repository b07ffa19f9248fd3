"""Normals of bare clouds: of some rows the same as of all."""

from __future__ import annotations

import numpy as np

from manipose_mj.ppf_jax.points.cloud_normals import cloud_normals


def test_normals_of_some_rows_are_those_of_all():
    rng = np.random.default_rng(0)
    turn, height = rng.uniform(0, np.pi, 400), rng.uniform(-0.05, 0.05, 400)
    side = np.stack([0.04 * np.cos(turn), height, 0.8 - 0.04 * np.sin(turn)], axis=1)
    points = side.astype(np.float32)
    rows = rng.permutation(400)[:120]
    everything = cloud_normals(points)
    np.testing.assert_array_equal(cloud_normals(points, rows), everything[rows])
    outwards = np.stack([np.cos(turn), np.zeros(400), -np.sin(turn)], axis=1)
    steep = np.abs(everything[:, 2]) > 0.3
    assert np.median(np.sum(everything * outwards, axis=1)[steep]) > 0.99


def test_points_on_a_line_get_a_normal_to_it():
    along = np.array([1.0, 0.3, 0.2])
    line = (np.outer(np.linspace(0, 0.1, 40), along) + [0, 0, 1]).astype(np.float32)
    for points in (line, np.repeat(line[:1], 40, axis=0)):
        normals = cloud_normals(points)
        assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    assert np.abs(cloud_normals(line) @ along).max() < 1e-2


def test_normals_are_the_least_eigenvectors_of_neighbourhoods():
    points = np.random.default_rng(1).normal([0, 0, 1], [0.1, 0.05, 0.01], (16, 3))
    middle = points - points.mean(axis=0)
    least = np.linalg.eigh(middle.T @ middle)[1][:, 0]
    cosines = cloud_normals(points.astype(np.float32)) @ least
    np.testing.assert_allclose(np.abs(cosines), 1, atol=1e-6)
