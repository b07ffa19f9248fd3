"""What a learnt policy sees of an object, and where it goes, does not depend on where the object lies."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.actions.tcp_motion import euler_rotation
from manipose_mj.learning import object_frame
from manipose_mj.poses import compose, pose_to_vector, rotation_about

UP = np.array([0.0, 0.0, 1.0])
DOWN = np.diag([1.0, -1.0, -1.0])
LYING = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])  # X level
STANDING = np.array([[0.0, 0.6, 0.8], [0.0, 0.8, -0.6], [-1.0, 0.0, 0.0]])  # X down


def scene(label: np.ndarray, yaw: float = 0.0, *, axial: bool = False) -> dict[str, np.ndarray]:
    """A thing on the table and a hand above it, both turned about the robot's base."""
    turn = compose(rotation_about(UP, yaw), np.zeros(3))
    hand = turn @ compose(rotation_about(UP, 0.2) @ DOWN, np.array([0.45, 0.05, 0.3]))
    return {
        "pose/robot/object": (turn @ compose(label, np.array([0.5, 0.1, 0.04])))[None],
        "pose/bounds/object": np.array([[[-0.10, -0.02, -0.03], [0.06, 0.02, 0.03]]]),
        "pose/axial/object": np.array([[int(axial)]]),
        "panda/tcp_pose": pose_to_vector(hand)[None],
        "panda/gripper_opening": np.array([[0.04]]),
        "panda/joint_positions": np.zeros((1, 7)),
        "panda/joint_velocities": np.ones((1, 7)),
    }


@pytest.mark.parametrize("label", [LYING, STANDING])
@pytest.mark.parametrize("yaw", [0.5, -0.9])
def test_features_stay_and_targets_turn_with_the_scene(label, yaw):
    there, turned = scene(label), scene(label, yaw)
    np.testing.assert_allclose(
        object_frame.features(turned), object_frame.features(there), atol=2e-5
    )
    action = jnp.asarray([[0.3, -0.2, -0.8, 0.1, 0.5, -0.4, 0.2]])
    targets = []
    for seen in (there, turned):
        command = np.asarray(object_frame.command(seen, action), float)[0]
        targets.append(compose(np.asarray(euler_rotation(command[3:6])), command[:3]))
    around = compose(rotation_about(UP, yaw), np.zeros(3))
    np.testing.assert_allclose(targets[1], around @ targets[0], atol=2e-5)


@pytest.mark.parametrize(("label", "across"), [(LYING, [-0.8, 0.6, 0]), (STANDING, [0.6, 0.8, 0])])
def test_fingers_close_across_the_long_axis_or_the_narrower_side_from_above(label, across):
    grip = np.asarray(object_frame.grip_frame(scene(label)))[0]
    np.testing.assert_allclose(grip[:3, 2], [0, 0, -1], atol=1e-6)
    assert abs(grip[:3, 1] @ across) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(np.linalg.det(grip[:3, :3]), 1.0, atol=1e-6)
    np.testing.assert_allclose(grip[:3, 3], [0.5, 0.1, 0.04], atol=1e-6)


@pytest.mark.parametrize(
    ("label", "axial", "half"),
    [
        (LYING, False, [0.08, 0.02, 0.03]),
        (STANDING, False, [0.03, 0.02, 0.08]),
        (LYING, True, [0.08, 0.03, 0.03]),
    ],
)
def test_features_hold_the_room_that_the_object_takes(label, axial, half):
    seen = scene(label, axial=axial)
    features = np.asarray(object_frame.features(seen))[0]
    places = [
        i for i in range(len(features) - 2) if np.allclose(features[i : i + 3], half, atol=1e-6)
    ]
    assert len(places) == 1
    center = features[places[0] - 3 : places[0]]
    grip = np.asarray(object_frame.grip_frame(seen))[0]
    expected = grip[:3, :3].T @ label @ np.array([-0.02, 0.0, 0.0])
    np.testing.assert_allclose(center, expected, atol=1e-6)
