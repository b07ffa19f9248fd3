"""Confidence is a probability: of what ships, low for what looks alike after a half turn, and kept as it was written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import jax
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.poses import compose
from manipose_mj.ppf_jax.confidence import Calibration, Scores, shipped_calibration
from manipose_mj.ppf_jax.estimator import PoseEstimator, view_scores
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry

FREE = CommonSymmetry()
POSE = compose(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), np.array([0.02, 0.01, 0.7]))


def _seen_side(radius: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """What a camera in front of POSE sees of a body of revolution about X, `radius(x)` thick there."""
    rng = np.random.default_rng(0)
    x, angle = rng.uniform(-0.1, 0.1, 400), rng.uniform(-1.3, 1.3, 400)
    r = radius(x)
    label = np.stack([x, r * np.sin(angle), -r * np.cos(angle)], axis=1)
    return (label @ POSE[:3, :3].T + POSE[:3, 3]).astype(np.float32)


@pytest.fixture(scope="module")
def can() -> np.ndarray:
    """Both of its ends alike."""
    return _seen_side(lambda x: np.full_like(x, 0.03))


@pytest.fixture(scope="module")
def bottle() -> np.ndarray:
    """Its neck is a third as thick."""
    return _seen_side(lambda x: np.where(x > 0.03, 0.01, 0.03))


@pytest.mark.full
def test_what_looks_alike_upside_down_has_little_confidence_and_poses_stay(can, bottle):
    estimator, key = PoseEstimator.load("axial"), jax.random.key(0)
    unsure, sure = (estimator.estimate(points, key=key) for points in (can, bottle))
    assert unsure.confidence < 0.6 < 0.75 < sure.confidence
    plain = replace(estimator, calibration=None).estimate(can, key=key)
    np.testing.assert_array_equal(unsure.pose, plain.pose)
    assert unsure.confidence != plain.confidence
    with_scores, scores = view_scores(estimator, can, key=key)
    np.testing.assert_array_equal(with_scores, unsure.pose)
    assert scores.score == pytest.approx(plain.confidence)


def test_a_close_rival_takes_confidence():
    calibration = shipped_calibration()
    clear = Scores(0.99, 0.01, 0.06, 1.8, FREE, np.array([False, True]))
    close = replace(clear, rival=0.97, rival_error=0.1)
    assert calibration.probability(clear) > calibration.probability(close) + 0.05
    assert 0.0 < calibration.probability(replace(clear, score=0.0)) < 0.5


def test_rivals_have_at_most_what_the_best_leaves():
    calibration = shipped_calibration()
    scores = Scores(0.9, 0.8, 0.3, 0.5, FREE, np.array([False, False, True, True]))
    first, near, rival, other = calibration.of_all(np.array([0.9, 0.95, 0.8, 0.01]), scores)
    assert first == calibration.probability(scores) < 0.9
    assert near == first and rival <= 1 - first and other == 0.01
    assert not calibration.of_all(np.zeros(4), scores).any()


@pytest.mark.full
def test_many_at_once_are_calibrated_as_well(can, bottle):
    estimator = PoseEstimator.load("axial")
    unsure, sure = estimator.estimate_many([can, bottle], key=jax.random.key(0))
    assert unsure.confidence < 0.6 < 0.75 < sure.confidence


def test_a_calibration_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "confidence.json"
    shipped_calibration().write(path)
    assert Calibration.read(path) == shipped_calibration()
    path.write_text(path.read_text().replace('"lead"', '"distance"'))
    for each in (path, tmp_path / "none.json"):
        with pytest.raises(InputError, match="no calibration of this version's features"):
            Calibration.read(each)
