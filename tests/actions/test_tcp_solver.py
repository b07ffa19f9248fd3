"""Inverse kinematics of the TCP modes: near, where it is, out of reach; and the angles they speak in."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.actions.tcp_motion import euler_angles, euler_rotation
from manipose_mj.actions.tcp_solver import TcpSolver
from manipose_mj.mjcf.panda.kinematics import tcp_pose
from manipose_mj.mjcf.panda.robot import HOME, POSITION_LIMITS
from manipose_mj.poses import rotation_about

LOW, HIGH = POSITION_LIMITS.T


def test_euler_angles_are_the_inverse_of_their_rotation():
    rng = np.random.default_rng(0)
    for angles in [*rng.uniform(-np.pi, np.pi, (20, 3)), np.array([0.3, np.pi / 2, 0.5])]:
        rotation = euler_rotation(angles)
        np.testing.assert_allclose(euler_rotation(euler_angles(rotation)), rotation, atol=1e-9)
    np.testing.assert_allclose(
        euler_rotation(np.array([0.1, 0.2, 0.3])),
        rotation_about(np.array([1.0, 0, 0]), 0.1)
        @ rotation_about(np.array([0, 1.0, 0]), 0.2)
        @ rotation_about(np.array([0, 0, 1.0]), 0.3),
    )


def test_the_solver_knows_the_published_kinematics():
    joints = np.random.default_rng(0).uniform(LOW, HIGH, (20, 7))
    solver = TcpSolver()
    for q in joints:
        np.testing.assert_allclose(solver.pose(q), tcp_pose(q), atol=1e-9)


def test_near_poses_are_reached_with_a_small_motion():
    rng = np.random.default_rng(5)
    solver = TcpSolver()
    for _ in range(100):
        start = rng.uniform(LOW + 0.1, HIGH - 0.1)
        moved = np.clip(start + rng.uniform(-0.05, 0.05, 7), LOW, HIGH)
        joints, error = solver.reach(solver.pose(moved), start)
        assert error < 1e-4 and (joints >= LOW).all() and (joints <= HIGH).all()
        assert np.linalg.norm(joints - start) < 3 * np.linalg.norm(moved - start)


def test_where_the_arm_is_nothing_moves():
    solver = TcpSolver()
    joints, error = solver.reach(solver.pose(HOME), HOME)
    np.testing.assert_array_equal(joints, HOME)
    assert error < 1e-9


@pytest.mark.parametrize("position", [(3.0, 0, 0.3), (0, 0, 0), (0.4, 0, -2.0), (0, 0, 9.0)])
def test_poses_out_of_reach_give_the_nearest_and_never_nan(position):
    solver = TcpSolver()
    goal = solver.pose(HOME)
    goal[:3, 3] = position
    joints, error = solver.reach(goal, HOME)
    assert np.isfinite(joints).all() and (joints >= LOW).all() and (joints <= HIGH).all()
    assert np.isfinite(error)
    away = np.linalg.norm(solver.pose(joints)[:3, 3] - position)
    assert away < np.linalg.norm(solver.pose(HOME)[:3, 3] - position)
