"""Inverse kinematics, free paths, timing and straight lines."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manipose_mj.control.grasping.candidates import reachable
from manipose_mj.control.motion.batch_ik import (
    BatchIkConfig,
    forward,
    rotation_vector,
    seeds_for,
    solve,
)
from manipose_mj.control.motion.free_motion import FreeMotionConfig, edge_is_free, plan_path
from manipose_mj.control.motion.line_motion import LineConfig, line_poses, track
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.motion.trajectory import SERVO_LAG, Timing, timed, tracked
from manipose_mj.control.scene.collision_query import (
    CONTACT,
    CollisionQuery,
)
from manipose_mj.mjcf.panda.kinematics import (
    HOME,
    POSITION_LIMITS,
    VELOCITY_LIMITS,
    tcp_pose,
)
from manipose_mj.poses import compose, invert, rotation_about

LOW, HIGH = POSITION_LIMITS.T
TIMESTEP = 0.02
DOWN = np.diag([1.0, -1.0, -1.0])


def _configurations(count: int, seed: int = 0) -> np.ndarray:
    margin = 0.1 * (HIGH - LOW)
    return np.random.default_rng(seed).uniform(LOW + margin, HIGH - margin, (count, 7))


# Inverse kinematics


def test_forward_kinematics_of_many_is_that_of_each():
    joints = _configurations(50)
    poses, _ = forward(joints)
    np.testing.assert_allclose(poses, [tcp_pose(q) for q in joints], atol=1e-12)


def test_the_jacobian_is_the_derivative():
    joints, step = _configurations(20, seed=1), 1e-6
    poses, jacobian = forward(joints)
    for i in range(7):
        more, _ = forward(joints + step * np.eye(7)[i])
        less, _ = forward(joints - step * np.eye(7)[i])
        linear = (more[:, :3, 3] - less[:, :3, 3]) / (2 * step)
        turn = rotation_vector(more[:, :3, :3] @ less[:, :3, :3].transpose(0, 2, 1)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, :3, i], linear, atol=1e-7)
        np.testing.assert_allclose(jacobian[:, 3:, i], turn, atol=1e-7)


def test_rotation_vectors_are_axis_times_angle():
    rotations = Rotation.random(50, rng=np.random.default_rng(0))
    np.testing.assert_allclose(
        rotation_vector(rotations.as_matrix()), rotations.as_rotvec(), atol=1e-9
    )
    axes = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.0, 0.8], [0.0, -0.6, 0.8]])
    halves = 2 * axes[:, :, None] * axes[:, None] - np.eye(3)
    found = rotation_vector(halves)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), np.pi)
    np.testing.assert_allclose(np.abs((found * axes).sum(axis=1)), np.pi)
    np.testing.assert_array_equal(rotation_vector(np.eye(3)[None]), np.zeros((1, 3)))


def test_poses_over_the_table_are_reached_and_poses_out_of_reach_are_not():
    rng, config = np.random.default_rng(0), BatchIkConfig()
    count = 60
    targets = np.stack(
        [
            compose(
                rotation_about(np.array([0.0, 0, 1]), rng.uniform(-np.pi, np.pi)) @ DOWN,
                rng.uniform([0.35, -0.3, 0.05], [0.6, 0.3, 0.3]),
            )
            for _ in range(count)
        ]
    )
    joints, reached = solve(targets, seeds_for(targets))
    assert reached.any(axis=0).mean() > 0.9
    own = np.stack([tcp_pose(q) for q in joints[reached]])
    requested = np.broadcast_to(targets, (len(joints), count, 4, 4))[reached]
    assert (
        np.linalg.norm(own[:, :3, 3] - requested[:, :3, 3], axis=1).max()
        < config.position_tolerance
    )
    turn = rotation_vector(own[:, :3, :3] @ requested[:, :3, :3].transpose(0, 2, 1))
    assert np.linalg.norm(turn, axis=1).max() < config.rotation_tolerance
    assert (joints >= LOW).all() and (joints <= HIGH).all()
    far = targets.copy()
    far[:, :3, 3] *= 1.3 / np.linalg.norm(far[:, :3, 3], axis=1, keepdims=True)
    assert not solve(far, seeds_for(far))[1].any()
    assert not len(reachable(far, HOME).index)


def test_of_several_solutions_the_nearest_is_taken():
    target = tcp_pose(HOME)[None]
    reach = reachable(target, HOME, extra_seeds=HOME[None])
    np.testing.assert_allclose(reach.joints[0], HOME, atol=0.01)
    assert not len(reachable(np.empty((0, 4, 4)), HOME).index)


# Free paths

START, GOAL = HOME.copy(), HOME.copy()
START[0], GOAL[0] = -1.2, 1.2


def _wall(q: np.ndarray) -> bool:
    """A wall across joint 1's range that only a stretched elbow passes."""
    return bool(abs(q[0]) < 0.2 and q[3] < -1.6)


def _plan(seed: int, collides=_wall):
    return plan_path(START, GOAL, collides, np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(3))
def test_a_path_leads_around_an_obstacle(seed):
    path = _plan(seed)
    assert path is not None and len(path) > 2
    np.testing.assert_array_equal(path[[0, -1]], [START, GOAL])
    assert (path >= LOW - 1e-9).all() and (path <= HIGH + 1e-9).all()
    for a, b in zip(path[:-1], path[1:], strict=True):
        for share in np.linspace(0, 1, 200):
            q = a + share * (b - a)
            # The obstacle, less what may pass between two checks.
            assert not (abs(q[0]) < 0.17 and q[3] < -1.63)
    assert np.abs(np.diff(path, axis=0)).sum() < 20


def test_the_same_seed_gives_the_same_path():
    np.testing.assert_array_equal(_plan(5), _plan(5))
    other = _plan(6)
    assert other is not None
    same = _plan(5)
    assert other.shape != same.shape or not np.array_equal(other, same)


def test_a_free_way_is_straight():
    np.testing.assert_array_equal(_plan(0, lambda q: False), [START, GOAL])


def test_no_path_where_there_is_none():
    config = FreeMotionConfig(max_nodes=150)
    rng = np.random.default_rng(0)
    assert plan_path(START, GOAL, lambda q: abs(q[0]) < 0.3, rng, config) is None
    assert plan_path(START, GOAL, lambda q: q[0] > 1.1, rng, config) is None  # the goal collides


def test_an_edge_is_checked_to_its_resolution():
    checked: list[float] = []

    def record(q):
        checked.append(float(q[0]))
        return False

    assert edge_is_free(START, GOAL, record, 0.05)
    assert np.diff(np.sort([START[0], *checked])).max() <= 0.05 + 1e-9
    assert max(checked) == GOAL[0]
    assert not edge_is_free(START, GOAL, lambda q: abs(q[0]) < 0.026, 0.05)


# Timing


@pytest.mark.parametrize("speed", [0.45, 0.1])
def test_timed_paths_start_and_end_at_rest_within_the_limits(speed):
    path = _configurations(4, seed=3)
    targets = timed(path, TIMESTEP, Timing(speed=speed))
    np.testing.assert_allclose(targets[0], path[0], atol=2e-3)
    np.testing.assert_array_equal(targets[-1], path[-1])
    velocity = np.diff(targets, axis=0) / TIMESTEP
    assert (np.abs(velocity) <= speed * VELOCITY_LIMITS * 1.001).all()
    # The last target is put in whole: what the filter has left of the way is small.
    assert np.abs(velocity[[0, -1]]).max() < 0.02
    assert np.abs(velocity / VELOCITY_LIMITS).max() > 0.9 * speed


def test_the_tcps_speed_can_be_bounded_as_well():
    path = np.stack([HOME, HOME + 0.01])
    lengths = np.array([0.24])
    slow = timed(path, TIMESTEP, Timing(), lengths=lengths)
    assert len(slow) * TIMESTEP >= 0.24 / Timing().linear_speed
    assert len(slow) > 2 * len(timed(path, TIMESTEP, Timing()))


def test_servos_lag_by_a_first_order_law():
    step = np.concatenate([np.zeros((1, 7)), np.ones((200, 7))])
    arm = tracked(step, TIMESTEP)
    assert arm.shape == step.shape
    np.testing.assert_array_equal(arm[0], 0)
    one_lag = round(SERVO_LAG / TIMESTEP)
    expected = 1 - np.exp(-one_lag * TIMESTEP / SERVO_LAG)
    np.testing.assert_allclose(arm[one_lag], expected, atol=1e-9)
    np.testing.assert_allclose(arm[-1], 1, atol=1e-9)
    np.testing.assert_allclose(tracked(np.tile(HOME, (20, 1)), TIMESTEP), np.tile(HOME, (20, 1)))


# Among obstacles


def test_the_servos_follow_as_the_model_of_them_says(environment):
    """What collision checks assume of the arm is what the simulated arm does."""
    environment.random_state.seed(1)
    environment.reset()
    robot, physics = environment.task.robot, environment.physics
    start = robot.configuration(physics)[0]
    goal = start + [0.3, 0.1, -0.2, -0.2, 0.2, 0.2, 0.3]
    targets = timed(np.stack([start, goal]), TIMESTEP, Timing())
    driven = []
    for q in targets:
        environment.step(np.append(q, 0.08))
        driven.append(robot.configuration(physics)[0])
    gap = np.abs(np.array(driven) - tracked(targets, TIMESTEP)).max()
    assert gap < 0.005
    assert gap < 0.2 * np.abs(np.array(driven) - targets).max()


def test_the_arm_model_stands_where_the_scene_has_it(environment, scene, arm):
    arm.follow(scene, HOME)
    assert arm.model.nq == arm.model.nv == 7
    environment.random_state.seed(9)
    environment.reset()
    model, qpos = environment.physics.model.ptr, environment.physics.data.qpos
    positions = scene.collision_model.positions_of(model, qpos)
    arm.follow(replace(scene, positions=positions), HOME)
    handle = "cabinet/middle_drawer"
    data = mujoco.MjData(arm.model)
    mujoco.mj_kinematics(arm.model, data)
    expected = environment.physics.data.ptr.body(handle).xpos
    np.testing.assert_allclose(data.body(handle).xpos, expected, atol=1e-6)


@pytest.mark.parametrize(
    "move", [[0.0, 0.0, -0.15], [0.1, 0.1, -0.05], [-0.05, -0.15, 0.05]], ids=str
)
def test_the_tcp_stays_on_its_line_and_the_joints_within_their_limits(scene, arm, move):
    arm.follow(scene, HOME)
    start = tcp_pose(HOME)
    goal = compose(np.eye(3), np.array(move)) @ start
    poses = line_poses(start, goal, TIMESTEP, LineConfig())
    targets = track(arm, HOME, poses, TIMESTEP)
    assert targets is not None
    own = np.stack([tcp_pose(q) for q in targets])
    direction = np.array(move) / np.linalg.norm(move)
    away = own[:, :3, 3] - start[:3, 3]
    assert np.linalg.norm(away - np.outer(away @ direction, direction), axis=1).max() < 1e-3
    np.testing.assert_allclose(own[-1, :3, 3], goal[:3, 3], atol=1e-3)
    tilt = rotation_vector(own[:, :3, :3] @ start[:3, :3].T)
    assert np.linalg.norm(tilt, axis=1).max() < 0.01
    assert (targets > LOW).all() and (targets < HIGH).all()
    velocity = np.abs(np.diff(targets, axis=0)) / TIMESTEP
    assert (velocity <= VELOCITY_LIMITS).all()


def test_line_poses_end_at_the_goal_no_faster_than_asked():
    start, config = tcp_pose(HOME), LineConfig()
    goal = start @ compose(rotation_about(np.array([0.0, 0, 1]), 0.5), np.array([0.1, 0, 0.05]))
    poses = line_poses(start, goal, TIMESTEP, config)
    np.testing.assert_allclose(poses[-1], goal, atol=1e-12)
    speed = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) / TIMESTEP
    assert speed.max() <= config.speed * 1.01
    assert max(speed[0], speed[-1]) < 0.1 * config.speed


def test_a_line_that_the_arm_cannot_follow_is_refused(scene, arm):
    arm.follow(scene, HOME)
    start = tcp_pose(HOME)
    far = compose(np.eye(3), np.array([0.6, 0.0, 0.2])) @ start
    assert track(arm, HOME, line_poses(start, far, TIMESTEP, LineConfig()), TIMESTEP) is None
    into_table = compose(np.eye(3), np.array([0.0, 0.0, -0.45])) @ start
    poses = line_poses(start, into_table, TIMESTEP, LineConfig())
    assert track(arm, HOME, poses, TIMESTEP) is None


def test_a_line_asked_for_again_has_the_same_bits_and_where_something_moved_is_another(scene, arm):
    arm.follow(scene, HOME)
    start = tcp_pose(HOME)
    up = compose(np.eye(3), np.array([0.0, 0.0, 0.05])) @ start
    poses = line_poses(start, up, TIMESTEP, LineConfig())
    arm.tracks.clear()
    first = track(arm, HOME, poses, TIMESTEP)
    kept = first.copy()
    first[:] = 0.0  # nobody's changes come back
    assert (track(arm, HOME, poses, TIMESTEP) == kept).all() and len(arm.tracks) == 1
    arm.tracks.clear()
    assert (track(arm, HOME, poses, TIMESTEP) == kept).all()
    arm.model.body("cabinet/middle_drawer").pos[:] += 0.01
    track(arm, HOME, poses, TIMESTEP)
    assert len(arm.tracks) == 2
    arm.follow(scene, HOME)


def test_the_motion_planner_finds_free_joint_targets(scene, arm, tcp_at):
    planner = MotionPlanner(scene, arm, TIMESTEP, np.random.default_rng(0))
    goal = tcp_at((0.35, -0.1, 0.25))
    targets = planner.free_path(HOME, goal)
    assert targets is not None
    np.testing.assert_array_equal(targets[-1], goal)
    assert not any(planner.collides(q, CollisionQuery(CONTACT)) for q in targets[::5])
    assert planner.free_path(HOME, tcp_at((0.45, 0.1, -0.01))) is None
    back = planner.backed_off(HOME, 0.1)
    np.testing.assert_allclose((invert(tcp_pose(HOME)) @ back)[:3, 3], [0, 0, -0.1], atol=1e-9)
