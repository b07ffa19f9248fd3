"""Normals of bare clouds: of some rows the same as of all."""

from __future__ import annotations

import numpy as np

from manipose_mj.ppf_jax.cloud_normals import cloud_normals


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
