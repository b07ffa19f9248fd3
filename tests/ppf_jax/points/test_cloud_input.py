"""Clouds as they come: what is repeated counts once, normals that are unknown are estimated."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.fused_views import FusedViewEstimator
from manipose_mj.ppf_jax.multi_view import MultiViewEstimator
from manipose_mj.ppf_jax.points.cloud_input import Cloud, checked_cloud, distinct_rows
from manipose_mj.ppf_jax.points.cloud_normals import cloud_normals
from manipose_mj.ppf_jax.two_network_fusion import TwoNetworkFusion

LIMITS = {"fewest": 32, "shortest": 1e-3, "longest": 5.0, "what": "an object"}


@pytest.fixture
def plane():
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.uniform(-0.1, 0.1, (200, 2)), np.full((200, 1), 0.7)], axis=1)
    return points.astype(np.float32)


def test_points_that_differ_stay_as_they_are(plane):
    normals = np.tile(np.float32([0, 0.6, -0.8]), (200, 1))
    points, same = checked_cloud(Cloud(plane, normals), **LIMITS)
    np.testing.assert_array_equal(points, plane)
    assert same is normals


def test_the_first_of_repeated_points_is_kept_in_its_place(plane):
    rows = np.random.default_rng(1).integers(0, 200, 500)
    first = np.sort(np.unique(rows, return_index=True)[1])
    np.testing.assert_array_equal(np.flatnonzero(distinct_rows(plane[rows])), first)
    normals = np.random.default_rng(2).normal(size=(500, 3))
    points, own = checked_cloud(Cloud(plane[rows], normals), **LIMITS)
    np.testing.assert_array_equal(points, plane[rows][first])
    np.testing.assert_array_equal(own, normals[first])


def test_rows_of_zeros_are_padding_and_one_is_a_point(plane):
    one, many = np.zeros((1, 3), np.float32), np.zeros((60, 3), np.float32)
    assert distinct_rows(np.concatenate([one, plane])).all()
    padded = np.concatenate([many, plane, many])
    np.testing.assert_array_equal(plane, padded[distinct_rows(padded)])


@pytest.mark.usefixtures("wrong_arrays")
def test_masked_rows_are_refused(plane):
    """A depth picture's invalid pixels, say: a plain array would have them again."""
    masked = np.ma.masked_array(plane, np.zeros(plane.shape, bool))
    points, _ = checked_cloud(masked, **LIMITS)
    np.testing.assert_array_equal(points, plane)
    masked[3:5] = np.ma.masked
    masked[9, 2] = np.ma.masked
    for name, cloud in (
        ("points", masked),
        ("points", Cloud(masked, plane)),
        ("normals", Cloud(plane, masked)),
    ):
        with pytest.raises(InputError, match=f"3 of 200 {name} are masked; leave them out"):
            checked_cloud(cloud, **LIMITS)


@pytest.mark.usefixtures("wrong_arrays")
def test_many_clouds_are_anything_that_gives_them(plane):
    single = PoseEstimator.load("cup")
    frames, key, few = np.stack([np.eye(4)] * 2), jax.random.key(0), plane[:9]
    for ask in (
        lambda clouds: MultiViewEstimator(single).estimate_views(clouds, frames, key=key),
        lambda clouds: FusedViewEstimator(single).estimate_views(clouds, frames, key=key),
        lambda clouds: FusedViewEstimator(single).estimate_many(clouds, key=key),
        lambda clouds: single.estimate_many(clouds, key=key),
        lambda clouds: TwoNetworkFusion(single, single).estimate_many(clouds, key=key),
    ):
        # All are read, and the clouds themselves are what is wrong.
        with pytest.raises(InputError, match="9 points|18 points|learnt from one camera"):
            ask(each for each in (few, few))
        for none in (None, Cloud(plane, plane), 3):
            with pytest.raises(InputError, match="clouds are of type .*; expected a list"):
                ask(none)
    assert single.estimate_many(iter(()), key=key) == []


def test_normals_that_are_zero_are_estimated_and_others_stay(plane):
    normals = np.tile(np.float32([0, 0.6, -0.8]), (200, 1))
    normals[::3] = 0
    _, filled = checked_cloud(Cloud(plane, normals), **LIMITS)
    assert filled is not None
    np.testing.assert_array_equal(filled[1::3], normals[1::3])
    np.testing.assert_array_equal(filled[::3], cloud_normals(plane)[::3])
    assert checked_cloud(Cloud(plane, 0 * normals), **LIMITS)[1] is None
