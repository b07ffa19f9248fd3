"""What an action of each control mode means: differences, velocities, poses and their targets."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.actions.tcp_motion import euler_angles
from manipose_mj.mjcf.panda.kinematics import tcp_pose
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING, POSITION_LIMITS, VELOCITY_LIMITS
from manipose_mj.poses import compose, rotation_about, rotation_angle
from tests.actions.driven_arm import TIMESTEP, act

HIGH = POSITION_LIMITS[:, 1]


def test_joint_differences_start_from_the_angles_or_from_the_targets(arm):
    for name in ("pd_joint_delta_pos", "pd_joint_target_delta_pos"):
        arm.start(name)
        arm.step(act(name, 0, 0, 0, 0, 0, 0, 0.5))
        assert arm.targets[6] == pytest.approx(HOME[6] + 0.05)
        measured = arm.joints[6]
        assert measured < HOME[6] + 0.04  # the arm is on its way
        arm.step(act(name, 0, 0, 0, 0, 0, 0, 0.5))
        start = measured if name == "pd_joint_delta_pos" else HOME[6] + 0.05
        assert arm.targets[6] == pytest.approx(start + 0.05)


def test_targets_do_not_run_away_behind_a_joint_limit(arm):
    name = "pd_joint_target_delta_pos"
    arm.start(name)
    for _ in range(50):
        arm.step(act(name, 0, 0, 0, 0, 0, 0, 1))
    arm.step(act(name, 0, 0, 0, 0, 0, 0, -1))
    assert arm.targets[6] == pytest.approx(HIGH[6] - 0.1)


def test_a_velocity_is_reached_and_held(arm):
    arm.start("pd_joint_vel")
    velocity = np.array([0.5, -0.3, 0.4, 0.2, -0.5, 0.6, 1.0])
    for _ in range(25):
        arm.step(act("pd_joint_vel", *velocity))
    np.testing.assert_allclose(arm.physics.bind(arm.robot.joints).qvel, velocity, atol=0.05)
    travelled = (arm.joints - HOME) / (25 * TIMESTEP)
    np.testing.assert_allclose(travelled, velocity, atol=0.05)
    for _ in range(25):
        arm.step(act("pd_joint_vel"))
    np.testing.assert_allclose(arm.joints, HOME + 0.5 * velocity, atol=2e-3)


def test_a_blocked_velocity_target_waits_for_the_arm(arm):
    arm.start("pd_joint_vel")
    for _ in range(100):
        arm.step(act("pd_joint_vel", 1.0))
        arm.robot.set_configuration(arm.physics, HOME, MAX_OPENING)  # something holds it
    assert arm.mode.memory()[0] < HOME[0] + 0.08


def test_position_and_velocity_targets_push_like_a_drive_with_both(arm):
    joint, velocity = 6, 0.8
    arm.start("pd_joint_pos_vel")
    action = np.concatenate([HOME + 0.001, np.zeros(7), [MAX_OPENING]])
    action[7 + joint] = velocity
    arm.step(action)
    arm.physics.forward()
    q, v = arm.joints[joint], float(arm.physics.bind(arm.robot.joints).qvel[joint])
    servo = arm.physics.bind(arm.robot.actuators[joint])
    stiffness, damping = -servo.biasprm[1], -servo.biasprm[2]
    expected = stiffness * (HOME[joint] + 0.001 - q) + damping * (velocity - v)
    assert float(servo.force) == pytest.approx(np.clip(expected, -12, 12), rel=1e-6)
    np.testing.assert_allclose(arm.robot.servo_lag(arm.physics)[joint], damping / stiffness)


@pytest.mark.parametrize("name", ["pd_ee_delta_pos", "pd_ee_delta_pose"])
def test_the_tcp_moves_along_the_axes_of_the_base(arm, name):
    start = tcp_pose(HOME)
    for axis in range(3):
        arm.start(name)
        arm.step(act(name, *(0.4 * np.eye(3)[axis])))
        sent = tcp_pose(arm.targets)
        np.testing.assert_allclose(sent[:3, 3] - start[:3, 3], 0.04 * np.eye(3)[axis], atol=1e-6)
        np.testing.assert_allclose(sent[:3, :3], start[:3, :3], atol=1e-6)


@pytest.mark.parametrize("name", ["pd_ee_delta_pose", "pd_ee_target_delta_pose"])
def test_the_hand_turns_about_the_axes_of_the_base_the_positive_way(arm, name):
    start = tcp_pose(HOME)
    for axis in range(3):
        arm.start(name)
        arm.step(act(name, 0, 0, 0, *(0.5 * np.eye(3)[axis])))
        sent = tcp_pose(arm.targets)
        turn = rotation_about(np.eye(3)[axis], 0.05)
        np.testing.assert_allclose(sent[:3, :3], turn @ start[:3, :3], atol=1e-6)
        np.testing.assert_allclose(sent[:3, 3], start[:3, 3], atol=1e-6)
    arm.start(name)
    arm.step(act(name, 0, 0, 0, 1.0, -1.0, 1.0))
    assert rotation_angle(tcp_pose(arm.targets)[:3, :3], start[:3, :3]) == pytest.approx(
        0.1, rel=0.05
    )


def test_target_poses_add_up_and_measured_ones_do_not(arm):
    start = tcp_pose(HOME)[2, 3]
    for name in ("pd_ee_target_delta_pos", "pd_ee_target_delta_pose", "pd_ee_delta_pos"):
        arm.start(name)
        for _ in range(5):
            arm.step(act(name, 0, 0, 0.1))
        risen = tcp_pose(arm.targets)[2, 3] - start
        if "target" in name:
            assert risen == pytest.approx(0.05, abs=1e-6)
        else:
            assert 0.01 < risen < 0.035


def test_a_target_pose_does_not_run_away(arm):
    name = "pd_ee_target_delta_pos"
    arm.start(name)
    for _ in range(60):
        arm.step(act(name, 1.0))
    furthest = tcp_pose(arm.joints)[0, 3]
    for _ in range(10):
        arm.step(act(name, -0.2))
    for _ in range(40):
        arm.step(act(name))
    assert tcp_pose(arm.joints)[0, 3] < furthest - 0.1


def test_an_absolute_pose_is_reached_and_stays(arm):
    goal = compose(rotation_about(np.array([0, 0, 1.0]), 0.6) @ tcp_pose(HOME)[:3, :3], np.zeros(3))
    goal[:3, 3] = 0.5, -0.2, 0.25
    action = np.concatenate([goal[:3, 3], euler_angles(goal[:3, :3]), [MAX_OPENING]])
    arm.start("pd_ee_pose")
    arm.step(action)
    assert 0.1 < np.abs((arm.targets - HOME) / VELOCITY_LIMITS).max() / TIMESTEP < 0.5 + 1e-9
    for _ in range(90):
        arm.step(action)
    there = arm.targets
    for _ in range(20):
        arm.step(action)
    np.testing.assert_allclose(tcp_pose(arm.joints), goal, atol=1e-3)
    np.testing.assert_array_equal(arm.targets, there)


def test_a_pose_out_of_reach_is_approached(arm):
    arm.start("pd_ee_pose")
    action = np.concatenate([[1.2, 0.0, 0.3], euler_angles(tcp_pose(HOME)[:3, :3]), [0.0]])
    for _ in range(120):
        arm.step(action)
    assert tcp_pose(arm.joints)[0, 3] > 0.75
