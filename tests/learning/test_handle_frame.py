"""What a learnt policy sees and does does not depend on where the furniture stands."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.actions.tcp_motion import euler_rotation
from manipose_mj.learning import grip, handle_frame
from manipose_mj.poses import compose, pose_to_vector, rotation_about

UP = np.array([0.0, 0.0, 1.0])


def scene(yaw: float = 0.0, hand: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """A drawer's handle before the robot and a hand, both turned about the robot's base."""
    # The handle's Y points to the robot, its bar lies level.
    handle = compose(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.6, 0.1, 0.3]))
    joint = compose(np.eye(3), np.array([0.7, 0.1, 0.3]))
    if hand is None:
        down = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
        hand = compose(rotation_about(UP, 0.2) @ down, np.array([0.4, 0.0, 0.4]))
    turn = compose(rotation_about(UP, yaw), np.zeros(3))
    return {
        "pose/robot/handle": (turn @ handle)[None],
        "pose/robot/joint": (turn @ joint)[None],
        "pose/opening": np.array([[0.1]]),
        "panda/tcp_pose": pose_to_vector(turn @ hand)[None],
        "panda/gripper_opening": np.array([[0.04]]),
        "panda/joint_positions": np.zeros((1, 7)),
        "panda/joint_velocities": np.ones((1, 7)),
    }


def target(observation: dict[str, np.ndarray], action: np.ndarray) -> np.ndarray:
    """`T_base_tcp` that an action asks for."""
    command = np.asarray(handle_frame.command(observation, jnp.asarray(action)[None]))[0]
    return compose(np.asarray(euler_rotation(command[3:6].astype(float))), command[:3])


@pytest.mark.parametrize("yaw", [0.5, -1.3, 2.5])
def test_features_stay_and_targets_turn_with_the_scene(yaw):
    there, turned = scene(), scene(yaw)
    np.testing.assert_allclose(
        handle_frame.features(turned), handle_frame.features(there), atol=2e-5
    )
    action = np.array([0.3, -0.2, -0.8, 0.1, 0.5, -0.4, 0.2], np.float32)
    around = compose(rotation_about(UP, yaw), np.zeros(3))
    np.testing.assert_allclose(target(turned, action), around @ target(there, action), atol=2e-5)


def test_no_action_at_the_grip_keeps_the_hand_there():
    frame = np.asarray(handle_frame.grip_frame(scene()))[0]
    np.testing.assert_allclose(frame[:3, 2], [1, 0, 0], atol=1e-6)  # into the drawer
    held = scene(hand=frame)
    np.testing.assert_allclose(target(held, np.zeros(7, np.float32)), frame, atol=1e-5)
    pulled = target(held, np.array([0, 0, -0.5, 0, 0, 0, 0], np.float32))
    np.testing.assert_allclose(pulled[:3, 3] - frame[:3, 3], [-0.075, 0, 0], atol=1e-5)


def test_the_hand_takes_the_nearer_half_turn():
    frame = np.asarray(handle_frame.grip_frame(scene()))[0]
    half = frame @ compose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    np.testing.assert_allclose(
        np.asarray(handle_frame.grip_frame(scene(hand=half)))[0], half, atol=1e-6
    )


def test_targets_are_near_the_hand_and_actions_have_limits():
    observation = scene()
    hand = np.asarray(grip.tcp_pose(observation))[0]
    far = target(observation, np.full(7, 50.0, np.float32))
    assert np.linalg.norm(far[:3, 3] - hand[:3, 3]) <= 0.12 + 1e-5
    np.testing.assert_allclose(far, target(observation, np.ones(7, np.float32)), atol=1e-6)
    angle = np.arccos(np.clip((np.trace(far[:3, :3].T @ hand[:3, :3]) - 1) / 2, -1, 1))
    assert angle == pytest.approx(0.6, abs=1e-3)


def test_rotation_vectors_are_the_inverse_of_their_matrix():
    vectors = np.random.default_rng(0).normal(0, 0.8, (50, 3)).astype(np.float32)
    found = grip.rotation_vector(grip.rotation_matrix(jnp.asarray(vectors)))
    np.testing.assert_allclose(found, vectors, atol=2e-5)
