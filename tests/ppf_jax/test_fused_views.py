"""What several cameras see becomes one cloud in one frame, and one estimate in the cameras' common one."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jax
import numpy as np
import pytest

from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, invert, pose_error, rotation_about, transform
from manipose_mj.ppf_jax.data.rendering import render_clouds
from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds, catalogue_subject
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_predictions import predict
from manipose_mj.ppf_jax.fused_views import FusedViewEstimator, fused_cloud
from manipose_mj.ppf_jax.multi_view import score_together
from manipose_mj.ppf_jax.points.cloud_input import Cloud
from manipose_mj.ppf_jax.points.clouds import MAX_POINTS
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from manipose_mj.ppf_jax.two_network_fusion import TwoNetworkFusion

KEY = jax.random.key(0)
COMMON = compose(rotation_about(np.array([0.0, 0, 1]), 0.7), np.array([0.3, -0.2, 0.1]))
FOLDER = Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights" / "several"


@pytest.fixture(scope="module")
def views():
    subject = catalogue_subject("cup", 4, resting=False)  # a test object
    return render_clouds(subject, view_setting("anywhere"), 3, np.random.default_rng(1))


@pytest.fixture(scope="module")
def frames(views):
    """Of the cameras, where the label's frame is `COMMON`."""
    return np.stack([COMMON @ invert(view.pose.astype(float)) for view in views])


def test_all_points_are_in_the_frame_of_the_camera_that_sees_most(views, frames):
    cloud, T_common_camera = fused_cloud(views, frames, rng=np.random.default_rng(0))
    assert len(cloud.points) == sum(min(len(view), 256) for view in views)
    most = int(np.argmax([min(len(view), 256) for view in views]))
    np.testing.assert_allclose(T_common_camera, frames[most])
    # The cup's points, by its own label, whoever saw them.
    local = transform(invert(COMMON) @ T_common_camera, cloud.points.astype(float))
    for view in views:
        seen = transform(invert(view.pose.astype(float)), view.points.astype(float))
        nearest = np.linalg.norm(local[:, None] - seen, axis=2).min(axis=0)
        assert np.median(nearest) < 0.005
    eyes = transform(T_common_camera, np.unique(cloud.eyes, axis=0).astype(float))
    assert sorted(map(tuple, eyes.round(4))) == sorted(map(tuple, frames[:, :3, 3].round(4)))
    assert (np.sum(cloud.normals * (cloud.eyes - cloud.points), axis=1) > 0).all()


def test_normals_are_found_where_none_are_given(views, frames):
    given, _ = fused_cloud(views, frames, rng=np.random.default_rng(0))
    points = [view.points for view in views]
    found, _ = fused_cloud(points, frames, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(found.points, given.points)
    assert np.median(np.sum(found.normals * given.normals, axis=1)) > 0.9


@pytest.mark.full
def test_three_views_give_the_pose_in_the_common_frame(views, frames):
    estimator = FusedViewEstimator.load("cup")
    found = estimator.estimate_views(views, frames, key=KEY)
    shift, turn = pose_error(found.pose, COMMON, SymmetryGroup.about_x())
    assert shift < 0.01 and turn < np.deg2rad(3.0)
    assert found.confidence > 0.9
    np.testing.assert_allclose(found.extents[0], views[0].extents[0], rtol=0.1)
    again = estimator.estimate_views(views, frames, key=KEY)
    np.testing.assert_array_equal(again.pose, found.pose)
    one = estimator.estimate(views[0], key=KEY)
    shift, turn = pose_error(one.pose, views[0].pose.astype(float), SymmetryGroup.about_x())
    assert shift < 0.01 and turn < np.deg2rad(3.0)


def test_what_cannot_be_fused_is_told(views, frames):
    estimator = FusedViewEstimator.load("cup")
    with pytest.raises(InputError, match="3 clouds and camera frames of shape"):
        estimator.estimate_views(views, frames[:1], key=KEY)
    with pytest.raises(InputError, match="none of 8 points"):
        estimator.estimate_views([view.points[:7] for view in views], frames, key=KEY)
    with pytest.raises(InputError, match="cloud of 30 points; expected at least 32"):
        estimator.estimate_views([view.points[:10] for view in views], frames, key=KEY)
    for value, row in ((np.nan, 0), (0.1, 0), (0.1, 3)):
        wrong = np.array(frames)
        wrong[1, row, 0] += value
        with pytest.raises(InputError, match="camera frame 1 is no rigid transform"):
            estimator.estimate_views(views, wrong, key=KEY)
    with pytest.raises(InputError, match="learnt from one camera"):
        FusedViewEstimator(PoseEstimator.load("cup")).estimate_views(views, frames, key=KEY)


@pytest.mark.usefixtures("wrong_arrays")
def test_a_fused_cloud_that_cannot_be_used_is_one_line(views, frames):
    estimator = FusedViewEstimator.load("cup")
    cloud, _ = fused_cloud(views, frames, rng=np.random.default_rng(0))
    wrong = {
        "without normals or eyes": Cloud(cloud.points, cloud.normals),
        "points are not finite": replace(cloud, points=cloud.points * np.nan),
        "eyes of shape": replace(cloud, eyes=cloud.eyes[:-1]),
        "expected at least 32": replace(
            cloud, points=cloud.points[:9], normals=cloud.normals[:9], eyes=cloud.eyes[:9]
        ),
    }
    for words, each in wrong.items():
        with pytest.raises(InputError, match=words):
            estimator.estimate_fused(each, key=KEY)
    bad = views[2].points.copy()
    bad[0] = np.nan
    with pytest.raises(InputError, match="cloud 2: 1 of .* points are not finite"):
        estimator.estimate_views([*views[:2], bad], frames, key=KEY)


@pytest.mark.parametrize("cameras", ["one", "several"])
def test_clouds_of_several_cameras_are_for_their_estimator(views, frames, cameras):
    """Without the cameras' places they would be taken for what one sees."""
    cloud, _ = fused_cloud(views, frames, rng=np.random.default_rng(0))
    labelled = replace(views[0], points=cloud.points, normals=cloud.normals, eyes=cloud.eyes)
    single = PoseEstimator.load("cup", cameras=cameras)
    words = "cloud of several cameras .*: FusedViewEstimator takes it"
    with pytest.raises(InputError, match=words):
        single.estimate(cloud, key=KEY)
    for estimator in (single, TwoNetworkFusion(single, single)):
        with pytest.raises(InputError, match=words):
            predict(estimator, [labelled])
    with pytest.raises(InputError, match=f"cloud 0: {words}"):
        score_together(single, [labelled, views[0]], frames[:2], key=KEY)


def test_clouds_of_more_points_than_one_camera_keeps_are_evaluated_and_timed(
    views, monkeypatch, capsys
):
    """Seven cameras see up to 1,792 points, more than `MAX_POINTS`."""
    rng = np.random.default_rng(0)
    points, normals = (np.tile(rows, (9, 1)) for rows in (views[0].points, views[0].normals))
    points = points + rng.normal(0, 1e-4, points.shape).astype(np.float32)
    large = replace(views[0], points=points, normals=normals, eyes=np.zeros_like(points))
    assert len(large) > MAX_POINTS
    asked = []

    def found(self, cloud, *, key):
        asked.append(cloud)
        return PoseEstimate(np.asarray(cloud.pose), np.ones(3), 0.5)

    monkeypatch.setattr(FusedViewEstimator, "estimate_fused", found)
    monkeypatch.setattr("manipose_mj.cli.pose.clouds.catalogue_clouds", lambda *_, **__: [large])
    words = ["--setting", "several_tasks", "--views", "1", "--jobs", "1", "--json"]
    assert main(["pose", "evaluate", "cup", *words]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["n"] == 1 and row["ms_per_object"] >= 0
    assert len(asked) == 3 and all(each is large for each in asked)  # once, compiled and timed


def test_what_one_camera_sees_once_counts_once(views, frames):
    """A view of one repeated point counts as one of too few points."""
    points = [view.points for view in views]
    few = [np.repeat(points[0][:1], len(points[0]), axis=0), *points[1:]]
    found, _ = fused_cloud(few, frames, rng=np.random.default_rng(0))
    assert len(found.points) == sum(min(len(each), 256) for each in points[1:])


@pytest.mark.parametrize("object_type", ["axial", "mirror", "functional"])
def test_weights_are_those_of_the_type_and_say_what_they_learnt_from(object_type):
    path = FOLDER / f"{object_type}.npz"
    assert path.stat().st_size < 2e6
    estimator = PoseEstimator.load(object_type, cameras="several")
    assert estimator.trained.cameras == "several" and estimator.calibration is not None
    assert PoseEstimator.load(object_type).trained.cameras == "one"
    for category in estimator.trained.categories:
        assert PoseEstimator.load(category, cameras="several").trained is estimator.trained


@pytest.mark.full
@pytest.mark.parametrize(
    ("category", "deg", "flipped"), [("can", 0.64, 1), ("camera", 1.9, 2), ("spatula", 1.04, 0)]
)
def test_shipped_weights_reproduce_a_published_figure(category, deg, flipped):
    """As docs/experiments/fused_views.md has it, 40 test clouds each."""
    clouds = catalogue_clouds(category, "test", view_setting("several"), views=4, jobs=1)
    estimator = FusedViewEstimator.load(category)
    turns = []
    for number, cloud in enumerate(clouds):
        found = estimator.estimate_fused(cloud, key=jax.random.key(number))
        turns.append(pose_error(found.pose.astype(float), cloud.pose, cloud.symmetry)[1])
    assert len(clouds) == 40
    assert np.degrees(np.median(turns)) == pytest.approx(deg, abs=0.15)
    assert np.sum(np.degrees(turns) > 90) == pytest.approx(flipped, abs=1)
