"""After an object slipped out of the hand, or where no grasp does, it is taken another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.baseline import Baseline
from manipose_mj.control.grasping.pick import pick_object
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.failures import StageFailure
from manipose_mj.poses import invert
from tests.few_objects import load


@pytest.fixture(scope="module")
def scene():
    environment = load(
        "single_object", "target_pose", seed=0, obs_mode="state", objects=["box_000"]
    )
    environment.reset()
    baseline = Baseline(environment)
    baseline.perception.reset(0)
    return baseline.perception.observe(), baseline.arm


def _taken(scene, slipped) -> np.ndarray:
    """`T_tcp_label` of the grasp that is picked."""
    estimate, arm = scene
    planner = MotionPlanner(estimate.scene, arm, 0.02, np.random.default_rng(0))
    obj = estimate.objects["object"]
    pick = pick_object(planner, estimate, obj, (), slipped)
    return invert(planner.tcp_pose(pick.approach[-1])) @ obj.label_pose


def test_a_grasp_that_slipped_is_not_taken_again(scene):
    first = _taken(scene, ())
    second = _taken(scene, (first,))
    assert np.linalg.norm(second[:3, 3] - first[:3, 3]) > 0.019


def test_where_all_slipped_the_first_is_taken_again(scene):
    first = _taken(scene, ())
    obj = scene[0].objects["object"]
    both = (np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0]))
    everything = [
        invert(pose @ turn) @ obj.label.pose for pose in obj.grasps.poses for turn in both
    ]
    np.testing.assert_allclose(_taken(scene, everything), first, atol=1e-6)


def test_where_no_grasp_does_more_are_sampled_if_there_is_time(scene):
    estimate, arm = scene
    planner = MotionPlanner(estimate.scene, arm, 0.02, np.random.default_rng(0))
    obj = estimate.objects["object"]
    wide = replace(obj.grasps, widths=np.ones(len(obj.grasps)))
    unsure = replace(obj, sample_grasps=lambda: wide, sample_more=obj.sample_grasps)
    assert pick_object(planner, estimate, unsure, (), thorough=True).width < 0.08
    with pytest.raises(StageFailure, match="none of 0 grasps"):
        pick_object(planner, estimate, unsure, ())
