"""Estimators that are asked about all cameras' clouds at once, and when they are asked again."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.control.grasping.candidates import reachable
from manipose_mj.control.perception.camera_rig import HAND_CAMERA
from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.objects.known_shapes import known_shapes
from manipose_mj.control.perception.objects.shape_fits import KnownShapes
from manipose_mj.control.perception.pose_sensing import sense_pose
from manipose_mj.mjcf.panda.kinematics import HOME
from manipose_mj.poses import compose
from manipose_mj.ppf_jax.estimator import PoseEstimate
from tests.control.perception.recalled import Recalled, perception_of


class OfViews(Recalled):
    """Is asked once about all views."""

    def estimate_views(self, clouds: Any, T_common_camera: np.ndarray, *, key: Any) -> PoseEstimate:
        self.asked += 1
        self.cameras = tuple(cloud.camera for cloud in clouds)
        np.testing.assert_array_equal(T_common_camera, [cloud.T_world_camera for cloud in clouds])
        return PoseEstimate(self.pose_world, self.extents, self.confidence)


@pytest.mark.parametrize(("confidence", "asked"), [(1.0, 1), (0.2, 2)])
def test_an_estimator_of_views_is_asked_once_a_look(cup, truth, confidence, asked):
    estimator = OfViews(*truth, confidence=confidence)
    perception = perception_of(cup, estimator)
    perception.reset(0)
    assert estimator.asked == asked
    assert len(estimator.cameras) > (3 if asked == 2 else 1)
    known = perception._known["object"]
    np.testing.assert_allclose(known.pose, truth[0], atol=1e-9)
    assert known.camera.split("+")[0] == "front"


def test_what_lies_in_furniture_is_seen_by_all_cameras_at_once(cup, truth, monkeypatch):
    estimator = OfViews(*truth)
    perception = perception_of(cup, estimator)
    monkeypatch.setattr(EstimatedPerception, "_enclosed", frozenset({"object"}))
    perception.reset(0)
    assert estimator.asked == 1
    assert len(estimator.cameras) > 3


def test_the_hand_s_camera_counts_where_it_was_brought_to_look(cup, truth, monkeypatch):
    pose, extents = truth
    estimator = OfViews(pose, 1.2 * extents)
    perception = perception_of(cup, estimator)
    monkeypatch.setattr(EstimatedPerception, "_enclosed", frozenset({"object"}))
    perception.reset(0)
    assert HAND_CAMERA not in estimator.cameras
    standing, grasps = len(estimator.cameras), perception._grasps["object"]
    # So that it sees the cup: above it, further than a depth camera's least distance.
    above = pose[:3, 3] + [0.0, 0.0, 0.40]
    reach = reachable(compose(np.diag([1.0, -1.0, -1.0]), above)[None], HOME)
    cup.task.robot.set_configuration(cup.physics, reach.joints[0], MAX_OPENING)
    cup.step(np.append(reach.joints[0], MAX_OPENING))
    estimator.extents = extents
    perception.look_closely()
    assert HAND_CAMERA in estimator.cameras
    assert len(estimator.cameras) >= standing
    np.testing.assert_allclose(
        perception.observe().objects["object"].label.extents, extents, atol=1e-9
    )
    assert perception._grasps["object"] is not grasps


@pytest.mark.parametrize(
    ("first", "then", "replaced"), [(0.5, 0.9, True), (0.5, 0.4, False), (0.7, 0.9, False)]
)
def test_between_plans_what_is_uncertain_is_looked_at_anew(cup, truth, first, then, replaced):
    pose, extents = truth
    wrong = pose @ compose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    estimator = OfViews(wrong, 1.2 * extents, confidence=first)
    perception = perception_of(cup, estimator)
    perception.reset(0)
    grasps = perception._grasps["object"]
    asked = estimator.asked
    perception.look_around()  # nothing has happened since
    assert estimator.asked == asked
    cup.step(np.append(cup.task.robot.configuration(cup.physics)[0], 0.08))
    # Of another shape, which the old one would not fit.
    estimator.pose_world, estimator.extents, estimator.confidence = pose, extents, then
    perception.look_around()
    obj = perception.observe().objects["object"]
    np.testing.assert_allclose(obj.label_pose, pose if replaced else wrong, atol=1e-9)
    np.testing.assert_allclose(obj.label.extents, extents if replaced else 1.2 * extents)
    assert (perception._grasps["object"] is not grasps) == replaced


@pytest.mark.parametrize(("known_by", "anew"), [(0.4, True), (0.9, False)])
def test_a_shape_found_by_few_points_is_found_anew(cup, truth, known_by, anew):
    pose, extents = truth
    estimator = OfViews(pose, 1.2 * extents, confidence=0.9)
    perception = perception_of(cup, estimator)
    perception.reset(0)
    known = perception._known["object"]
    perception._known["object"] = replace(known, points=int(known_by * known.points))
    cup.step(np.append(cup.task.robot.configuration(cup.physics)[0], 0.08))
    estimator.extents, estimator.confidence = extents, 0.8
    perception.look_around()
    label = perception.observe().objects["object"].label
    np.testing.assert_allclose(label.extents, extents if anew else 1.2 * extents)


@pytest.mark.parametrize(("counts", "seen"), [((40, 7, 0), True), ((25, 7, 7), False)])
def test_slivers_do_not_count_among_views(cup, truth, counts, seen):
    perception = perception_of(cup, OfViews(*truth))
    views = perception._views.of(cup.physics, "object")
    few = [
        replace(view, points=view.points[:n], normals=view.normals[:n])
        for view, n in zip(views, counts, strict=True)
    ]
    estimator = OfViews(*truth)
    sensed = sense_pose(estimator, few, KnownShapes(known_shapes("cup")), lambda: None)
    assert (sensed is not None) == seen
    if sensed is not None:
        assert estimator.cameras == (views[0].camera,)
