"""Corrupted clouds make estimates worse bit by bit, and always give one."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.augmentation.corruption import partly_hidden, with_outliers
from manipose_mj.ppf_jax.data.rendering import render_clouds
from manipose_mj.ppf_jax.data.view_cache import catalogue_subject
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_metrics import pose_errors
from manipose_mj.ppf_jax.points.outlier_removal import not_alone

COUNT = 16


@pytest.fixture(scope="module")
def cups():
    """Rendered views of four cups."""
    rng = np.random.default_rng(0)
    subjects = [catalogue_subject("cup", index, resting=False) for index in (4, 9, 14, 19)]
    each = [render_clouds(s, view_setting("anywhere"), COUNT // 4, rng) for s in subjects]
    return [cloud for clouds in each for cloud in clouds]


@pytest.fixture(scope="module")
def estimate():
    """Estimates of `COUNT` clouds by the weights that ship."""
    estimator = PoseEstimator.load("cup")
    return lambda clouds: estimator.estimate_many(clouds, key=jax.random.key(0))


def _errors(found, clouds):
    """Medians [deg, m]."""
    errors = pose_errors(np.stack([each.pose for each in found]), clouds)
    return np.degrees(np.median(errors.rotation)), np.median(errors.origin)


def test_outliers_are_the_share_that_was_asked_for():
    rng = np.random.default_rng(0)
    points = rng.normal(scale=0.03, size=(200, 3)).astype(np.float32) + [0, 0, 0.7]
    worse = with_outliers(points, 0.3, rng)
    moved = np.any(worse != points, axis=1)
    assert worse.shape == points.shape and moved.sum() == 60
    assert np.linalg.norm(worse - np.median(points, axis=0), axis=1).max() < 0.3
    np.testing.assert_array_equal(with_outliers(points, 0.0, rng), points)


def test_an_edge_hides_one_side_of_the_image():
    rng = np.random.default_rng(1)
    points = rng.normal(scale=0.03, size=(200, 3)) + [0, 0, 0.7]
    left = partly_hidden(points, 0.5, np.random.default_rng(2))
    assert left.shape == (100, 3)
    gone = points[~np.isin(points[:, 0], left[:, 0])]
    angle = np.random.default_rng(2).uniform(0, 2 * np.pi)
    edge = np.array([np.cos(angle), np.sin(angle)])
    assert (left[:, :2] / left[:, 2:] @ edge).max() <= (gone[:, :2] / gone[:, 2:] @ edge).min()
    assert len(partly_hidden(points, 1.0, rng)) == 3


@pytest.mark.parametrize("corrupt", [with_outliers, partly_hidden])
def test_a_share_beyond_all_is_one_line(corrupt):
    with pytest.raises(InputError, match="share 1.5; expected one from 0 to 1"):
        corrupt(np.ones((40, 3)), 1.5, np.random.default_rng(0))


def test_outliers_lie_alone_and_a_surface_does_not(cups):
    rng = np.random.default_rng(0)
    for cloud in cups:
        worse = with_outliers(cloud.points, 0.3, rng)
        added, kept = np.any(worse != cloud.points, axis=1), not_alone(worse)
        assert kept[~added].mean() > 0.9 and kept[added].mean() < 0.35
    assert not_alone(np.ones((40, 3))).all()  # no surface at all: nothing is left out


@pytest.mark.full
def test_degradation_is_gradual_and_always_an_answer(cups, estimate):
    rng = np.random.default_rng(0)
    clean = _errors(estimate([cloud.points for cloud in cups]), cups)
    few, many = (
        _errors(estimate([with_outliers(cloud.points, share, rng) for cloud in cups]), cups)
        for share in (0.1, 0.3)
    )
    hidden = _errors(estimate([partly_hidden(cloud.points, 0.5, rng) for cloud in cups]), cups)
    assert clean[0] < 2 and clean[1] < 0.002, clean
    assert few[0] < 2 and few[1] < 0.002, few
    assert many[0] < 4 and many[1] < 0.004, many
    assert hidden[0] < 8 and hidden[1] < 0.015, hidden


@pytest.mark.full
@pytest.mark.usefixtures("wrong_arrays")
def test_nothing_makes_an_answer_that_is_no_number(cups, estimate):
    rng = np.random.default_rng(0)
    noise = with_outliers(cups[0].points, 1.0, rng)
    line = np.linspace([0, 0, 0.5], [0.1, 0, 0.6], 60).astype(np.float32)
    plane = line * 0
    plane[:, 2], plane[:, :2] = 0.5, rng.uniform(-0.05, 0.05, (60, 2))
    twice = np.repeat(cups[0].points[:40], 3, axis=0)
    apart = np.concatenate([cups[0].points[:30], cups[0].points[:30] + np.float32(0.4)])
    unusual = [noise, line, plane, twice, apart, partly_hidden(cups[1].points, 0.8, rng)]
    found = estimate(unusual + [cups[0].points] * (COUNT - len(unusual)))
    for each in found:
        for answer in (each, *each.hypotheses):
            assert np.isfinite(answer.pose).all() and np.isfinite(answer.extents).all()
            assert 0 <= answer.confidence <= 1
            turn = answer.pose[:3, :3].astype(float)
            np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-3)
