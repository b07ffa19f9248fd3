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


def _with(frames, row, column, value):
    frames = frames.copy()
    frames[1, row, column] = value
    return frames


@pytest.mark.parametrize(
    "change",
    [
        lambda f: _with(f, 0, 3, np.nan),
        lambda f: _with(f, 3, 0, 0.1),
        lambda f: f * np.array([[[1.0]], [[1000.0]], [[1.0]]]),
        lambda f: np.stack([f[0], np.diag([-1.0, 1, 1, 1]), f[2]]),
    ],
)
def test_a_camera_frame_that_is_not_rigid_is_named(estimator, views, change):
    frames = np.stack([np.eye(4)] * 3)
    with pytest.raises(InputError, match="camera frame 1 is no rigid transform"):
        estimator.estimate_views(views, change(frames), key=KEY)


def test_a_cloud_that_cannot_be_used_is_named(estimator, views):
    clouds = [views[0].points[:10], *views[1:]]
    with pytest.raises(InputError, match="cloud 0: cloud of 10 points"):
        estimator.estimate_views(clouds, np.stack([np.eye(4)] * 3), key=KEY)
