"""Several views of one object give one pose in their common frame, and any of them may settle it."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, invert, pose_error, rotation_about
from manipose_mj.ppf_jax.data.rendering import render_clouds
from manipose_mj.ppf_jax.data.view_cache import catalogue_subject
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.multi_view import MultiViewEstimator, score_together

KEY = jax.random.key(0)


@pytest.fixture(scope="module")
def estimator() -> MultiViewEstimator:
    return MultiViewEstimator.load("cup")


@pytest.fixture(scope="module")
def views():
    subject = catalogue_subject("cup", 4, resting=False)  # a test object
    return render_clouds(subject, view_setting("anywhere"), 3, np.random.default_rng(1))


@pytest.mark.full
def test_three_views_agree_in_the_common_frame(estimator, views):
    common = compose(rotation_about(np.array([0.0, 0, 1]), 0.7), np.array([0.3, -0.2, 0.1]))
    frames = np.stack([common @ invert(view.pose.astype(float)) for view in views])
    found = estimator.estimate_views(views, frames, key=KEY)
    shift, turn = pose_error(found.pose, common, SymmetryGroup.about_x())
    assert shift < 0.01 and turn < np.deg2rad(5.0)
    assert found.confidence > 0.9
    np.testing.assert_allclose(found.extents[0], views[0].extents[0], rtol=0.1)
    again = estimator.estimate_views(views, frames, key=KEY)
    np.testing.assert_array_equal(again.pose, found.pose)
    # A camera that is not where it is said to be contradicts the others.
    frames[2] = frames[2] @ compose(rotation_about(np.array([0.0, 1, 0]), np.pi), np.zeros(3))
    assert estimator.estimate_views(views, frames, key=KEY).confidence < found.confidence


@pytest.mark.full
def test_hypotheses_of_all_views_are_ranked(estimator, views):
    frames = np.stack([invert(view.pose.astype(float)) for view in views[:2]])
    found = score_together(estimator.single, views[:2], frames, key=KEY)
    one = score_together(estimator.single, views[:1], frames[:1], key=KEY)
    assert len(found.poses) == 2 * len(one.poses) == len(found.log_odds)
    assert found.scores.views == 2 and one.scores.views == 1
    assert not found.scores.elsewhere[0]


def test_a_camera_without_a_frame_is_told(estimator, views):
    with pytest.raises(InputError, match="expected one or more, and a 4x4 frame each"):
        estimator.estimate_views(views, np.eye(4)[None], key=KEY)
    with pytest.raises(InputError, match="0 clouds"):
        estimator.estimate_views([], np.zeros((0, 4, 4)), key=KEY)
