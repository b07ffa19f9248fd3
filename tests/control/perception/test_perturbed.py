"""Errors made on purpose: their size, that planner and scene agree on them, and what a held object keeps."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.perception.perturbed import PosePerturbation, standing
from manipose_mj.mjcf.panda.kinematics import HOME
from manipose_mj.poses import compose, invert, pose_error, rotation_about
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.observations.fixed_error import FixedError

ERROR = FixedError(0.02, 0.2)


@pytest.fixture(scope="module")
def cup():
    environment = suite.make(
        EnvConfig("single_object/target_pose", obs_mode="state", objects=("chips_can_000",)), 2
    )
    environment.reset()
    return environment


def perception(environment, errors: PosePerturbation):
    made = Baseline(environment, errors=errors).perception
    made.reset(0)
    return made


def true_pose(environment) -> np.ndarray:
    return environment.task.object.label_pose(environment.physics)


def test_an_estimate_is_off_by_the_error_and_so_is_the_scene(cup):
    perturbed = perception(cup, PosePerturbation(ERROR))
    estimate = perturbed.observe()
    obj = estimate.objects["object"]
    shift, turn = pose_error(obj.label_pose, true_pose(cup), obj.label.symmetry)
    assert (float(shift), float(turn)) == pytest.approx((0.02, 0.2))
    np.testing.assert_allclose(estimate.scene.body_pose(obj.body), obj.pose, atol=1e-9)
    assert [e.name for e in perturbed.last_estimates] == ["object"]
    np.testing.assert_array_equal(perturbed.last_estimates[0].pose, obj.label_pose)
    again = perception(cup, PosePerturbation(ERROR)).observe().objects["object"]
    np.testing.assert_array_equal(again.pose, obj.pose)


def test_without_errors_perception_is_the_plain_one(cup):
    assert type(perception(cup, PosePerturbation())).__name__ == "OraclePerception"


def test_what_lies_is_taken_to_stand_where_it_is(cup):
    lying = compose(rotation_about(np.array([0.0, 1.0, 0.0]), 0.0), np.array([0.5, 0.1, 0.04]))
    put(cup, lying)  # label X, up in its upright pose, lies along the world's x
    obj = perception(cup, PosePerturbation(upright=True)).observe().objects["object"]
    seen = obj.label_pose
    assert seen[2, 0] == pytest.approx(1.0, abs=1e-6), "does not stand"
    np.testing.assert_allclose(seen[:2, 3], lying[:2, 3], atol=1e-9)
    radius, length = obj.label.extents[1] / 2, obj.label.extents[0]
    assert seen[2, 3] - length / 2 == pytest.approx(0.04 - radius, abs=2e-3), "another foot"


def test_what_stands_is_where_it_is(cup):
    up = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]).T
    put(cup, compose(up @ rotation_about(np.array([1.0, 0.0, 0.0]), 0.7), np.array([0.5, 0, 0.2])))
    obj = perception(cup, PosePerturbation()).observe().objects["object"]
    assert obj.label_pose[2, 0] == pytest.approx(1.0)
    np.testing.assert_allclose(standing(obj), obj.label_pose, atol=1e-6)


def test_the_hand_keeps_the_error_of_what_it_holds(cup):
    put(cup, compose(np.eye(3), np.array([0.5, 0.1, 0.04])))
    perturbed = perception(cup, PosePerturbation(upright=True))
    first = invert(true_pose(cup)) @ perturbed.observe().objects["object"].label_pose
    perturbed.hold("object")
    turn = rotation_about(np.array([0.0, 1.0, 0.0]), 0.8)
    put(cup, compose(turn, np.array([0.45, 0.0, 0.3])))
    held = invert(true_pose(cup)) @ perturbed.observe().objects["object"].label_pose
    np.testing.assert_allclose(held, first, atol=1e-9)
    perturbed.hold(None)
    assert perturbed.observe().objects["object"].label_pose[2, 0] == pytest.approx(1.0, abs=1e-6)


def put(environment, label_pose: np.ndarray) -> None:
    obj = environment.task.object
    obj.place(environment.physics, label_pose @ invert(obj.asset.label.pose))
    environment.task.robot.set_configuration(environment.physics, HOME, 0.08)
    environment.physics.forward()
