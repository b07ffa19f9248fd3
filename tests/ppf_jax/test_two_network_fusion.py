"""What is round in the catalogue and flat in someone's hand: which of two networks has the say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about
from manipose_mj.ppf_jax.estimator import PoseEstimate, PoseEstimator
from manipose_mj.ppf_jax.two_network_fusion import TwoNetworkFusion, agreed

X, Y, Z = np.eye(3)
WIDE, DEEP = np.array([0.2, 0.1, 0.06]), np.array([0.2, 0.06, 0.1])


def estimate(axis, degrees, extents, confidence, *hypotheses) -> PoseEstimate:
    pose = compose(rotation_about(axis, np.radians(degrees)), np.array([0.0, 0.0, 0.7]))
    return PoseEstimate(pose, extents, confidence, hypotheses)


def test_up_comes_first_then_lengths_then_the_network_s_own_word():
    upright = estimate(X, 70, WIDE, 0.9)
    lying, deep = estimate(Z, 90, WIDE, 0.9), estimate(X, 90, DEEP, 0.8)
    wide, leaning = estimate(X, 0, WIDE, 0.3), estimate(Y, 20, WIDE, 0.2)
    found = agreed(upright, replace(lying, hypotheses=(deep, wide, leaning)))
    assert np.array_equal(found.pose, wide.pose) and found.confidence == 0.3
    ranked = [each.confidence for each in found.hypotheses]
    assert ranked == [0.2, 0.8, 0.9]
    # Nothing is up: what the network says of lengths, then its best.
    down = agreed(estimate(Z, 180, WIDE, 0.9), replace(lying, hypotheses=(deep, wide)))
    assert np.array_equal(down.pose, lying.pose)
    assert agreed(upright, lying).hypotheses == ()


def test_a_hypothesis_much_like_a_likelier_one_comes_last():
    near, other = estimate(X, 5, WIDE, 0.5), estimate(X, 90, DEEP, 0.4)
    found = agreed(
        estimate(X, 0, WIDE, 1.0), replace(estimate(X, 0, WIDE, 0.6), hypotheses=(near, other))
    )
    assert [each.confidence for each in found.hypotheses] == [0.4, 0.5]


def test_only_of_round_categories():
    assert TwoNetworkFusion.load("can").sides.trained is PoseEstimator.load("mirror").trained
    with pytest.raises(InputError, match="mug is no axial category; PoseEstimator.load"):
        TwoNetworkFusion.load("mug")
    with pytest.raises(InputError, match="unknown axial category 'botle'.*bottle"):
        TwoNetworkFusion.load("botle")


@pytest.mark.usefixtures("wrong_arrays")
def test_one_cloud_or_many():
    class Says:
        def __init__(self, *answers):
            self.answers = answers

        def estimate(self, cloud, *, key):
            return self.answers[cloud]

        def estimate_many(self, clouds, *, key):
            return [self.answers[cloud] for cloud in clouds]

    lying, wide = estimate(Z, 90, WIDE, 0.9), estimate(X, 0, WIDE, 0.3)
    estimator = TwoNetworkFusion(
        Says(estimate(X, 70, WIDE, 0.9), estimate(Z, 90, WIDE, 0.9)),
        Says(replace(lying, hypotheses=(wide,)), replace(lying, hypotheses=(wide,))),
    )
    many = estimator.estimate_many([0, 1], key=None)
    assert [each.confidence for each in many] == [0.3, 0.9]
    for cloud in (0, 1):
        assert np.array_equal(estimator.estimate(cloud, key=None).pose, many[cloud].pose)
