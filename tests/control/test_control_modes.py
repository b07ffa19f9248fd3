"""Control modes: what they mean, that they keep to their limits, and that the physics is always the same."""

from __future__ import annotations

import copy
import pickle

import mujoco
import numpy as np
import pytest
from dm_control import mjcf

from manipose_mj.control.modes import CONTROL_MODES, control_mode
from manipose_mj.control.modes.inverse import action_towards
from manipose_mj.control.modes.joint_velocity import servo_lag
from manipose_mj.control.modes.tcp_motion import euler_angles, euler_rotation
from manipose_mj.control.modes.tcp_solver import TcpSolver
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda import HOME, MAX_OPENING, POSITION_LIMITS, VELOCITY_LIMITS, Panda
from manipose_mj.mjcf.panda_kinematics import tcp_pose
from manipose_mj.poses import compose, rotation_about, rotation_angle
from manipose_mj.tasks.action_mode import checked_action

SUBSTEPS = 10
TIMESTEP = 0.02
LOW, HIGH = POSITION_LIMITS.T
SIZES = {
    "pd_joint_pos": 8,
    "pd_joint_delta_pos": 8,
    "pd_joint_target_delta_pos": 8,
    "pd_joint_vel": 8,
    "pd_joint_pos_vel": 15,
    "pd_joint_delta_pos_vel": 15,
    "pd_ee_pose": 7,
    "pd_ee_delta_pos": 4,
    "pd_ee_delta_pose": 7,
    "pd_ee_target_delta_pos": 4,
    "pd_ee_target_delta_pose": 7,
}
NORMALISED = [
    name for name in SIZES if name not in ("pd_joint_pos", "pd_joint_pos_vel", "pd_ee_pose")
]
ABSOLUTE = ["pd_joint_pos", "pd_joint_pos_vel", "pd_ee_pose"]


class Arm:
    """The robot alone, driven as a task drives it."""

    def __init__(self) -> None:
        self.robot = Panda(visuals="primitive")
        self.robot.mjcf_model.option.timestep = TIMESTEP / SUBSTEPS
        self.robot.mjcf_model.option.integrator = "implicitfast"
        self.physics = mjcf.Physics.from_mjcf_model(self.robot.mjcf_model)
        self.mode = control_mode("pd_joint_pos")

    def start(self, name: str, joints: np.ndarray = HOME) -> Arm:
        self.physics.reset()
        self.robot.set_configuration(self.physics, joints, MAX_OPENING)
        self.physics.forward()
        self.mode = control_mode(name)
        self.mode.reset(self.physics, self.robot)
        return self

    def step(self, action: np.ndarray) -> None:
        self.mode.begin(
            self.physics, self.robot, checked_action(self.mode.name, self.mode.spec().shape, action)
        )
        for k in range(1, SUBSTEPS + 1):
            joints, opening = self.mode.targets(self.physics, self.robot, k / SUBSTEPS)
            self.robot.follow_targets(self.physics, np.append(joints, opening))
            self.physics.step()

    @property
    def joints(self) -> np.ndarray:
        return self.robot.configuration(self.physics)[0]

    @property
    def targets(self) -> np.ndarray:
        """Where the mode sends the joints [rad]; servos get there no faster than the joints can."""
        return self.mode.memory()[:7]

    @property
    def controls(self) -> np.ndarray:
        """What the arm's servos were sent last [rad]."""
        return np.array(self.physics.bind(self.robot.actuators).ctrl)

    @property
    def state(self) -> np.ndarray:
        return np.concatenate([self.physics.data.qpos, self.physics.data.qvel])

    def still(self) -> np.ndarray:
        """The action that goes nowhere."""
        action, arrives = action_towards(
            self.mode, self.physics, self.robot, self.joints, MAX_OPENING, TIMESTEP
        )
        assert arrives
        return action


@pytest.fixture(scope="module")
def compiled() -> Arm:
    return Arm()


@pytest.fixture
def arm(compiled: Arm) -> Arm:
    return compiled


def _act(name: str, *numbers: float, opening: float = MAX_OPENING) -> np.ndarray:
    """An action of a mode whose arm part begins with these numbers; the rest is zero."""
    action = np.zeros(SIZES[name])
    action[: len(numbers)] = numbers
    action[-1] = opening
    return action


def test_the_names_are_the_eleven():
    assert set(CONTROL_MODES) == set(SIZES) and len(CONTROL_MODES) == 11
    with pytest.raises(InputError, match="did you mean pd_ee_delta_pose"):
        control_mode("pd_ee_delta_psoe")


@pytest.mark.parametrize("name", SIZES)
def test_spec(name):
    spec = control_mode(name).spec()
    assert spec.shape == (SIZES[name],) and spec.name == name
    assert (spec.minimum[-1], spec.maximum[-1]) == (0.0, MAX_OPENING)
    if name in NORMALISED:
        assert (spec.minimum[:-1] == -1).all() and (spec.maximum[:-1] == 1).all()
    if name == "pd_joint_pos_vel":
        np.testing.assert_array_equal(spec.minimum[:7], LOW)
        np.testing.assert_array_equal(spec.maximum[7:14], np.ones(7))
    spec.validate((spec.minimum + spec.maximum) / 2)


@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("kind", ["short", "nan", "text"])
def test_a_bad_action_is_refused_in_one_line(arm, name, kind):
    arm.start(name)
    action: object = "up"
    if kind == "short":
        action = np.zeros(SIZES[name] - 1)
    elif kind == "nan":
        action = _act(name, np.nan)
    with pytest.raises(InputError, match=name) as refused:
        arm.step(action)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value) and str(SIZES[name]) in str(refused.value)


@pytest.mark.parametrize("name", SIZES)
def test_the_neutral_action_keeps_the_robot_still(arm, name):
    arm.start(name)
    action = _act(name) if name in NORMALISED else arm.still()
    for _ in range(25):
        arm.step(action)
    np.testing.assert_allclose(arm.joints, HOME, atol=2e-4)
    assert arm.robot.configuration(arm.physics)[1] == pytest.approx(MAX_OPENING, abs=2e-4)


@pytest.mark.parametrize("name", SIZES)
def test_nothing_leaves_the_limits_of_the_joints(arm, name):
    spec = control_mode(name).spec()
    rng = np.random.default_rng(1)
    for corner in (spec.minimum, spec.maximum, None):
        arm.start(name)
        for _ in range(40):
            arm.step(
                rng.uniform(3 * spec.minimum, 3 * spec.maximum) if corner is None else 9 * corner
            )
            assert np.isfinite(arm.state).all() and np.isfinite(arm.targets).all()
            assert (arm.controls >= LOW).all() and (arm.controls <= HIGH).all()


@pytest.mark.parametrize("name", SIZES)
def test_what_lies_beyond_a_limit_counts_as_the_limit(arm, name):
    spec = control_mode(name).spec()
    ends = []
    for factor in (1.0, 5.0):
        arm.start(name)
        action = factor * spec.maximum
        if name == "pd_ee_pose":
            action[3:6] = spec.maximum[3:6]
        for _ in range(3):
            arm.step(action)
        ends.append(arm.state)
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize("name", SIZES)
def test_the_model_stays_as_it_is(arm, name):
    model = arm.physics.model.ptr
    before = copy.copy(model)
    rng = np.random.default_rng(0)
    spec = arm.start(name).mode.spec()
    for _ in range(5):
        arm.step(rng.uniform(spec.minimum, spec.maximum))
    buffers = []
    for each in (before, model):
        buffer = np.empty(mujoco.mj_sizeModel(each), np.uint8)
        mujoco.mj_saveModel(each, None, buffer)
        buffers.append(buffer)
    np.testing.assert_array_equal(*buffers)


@pytest.mark.parametrize("name", [n for n in SIZES if n != "pd_joint_vel"])
def test_the_same_targets_make_the_same_motion_in_every_mode(arm, name):
    goals = HOME + np.linspace(0.0, 0.02, 12)[:, None] * [1, -1, 1, 1, -1, 1, 1]
    if "pos" in name.split("_") and "ee" in name:
        goals = _straight_goals()

    def run(mode: str) -> np.ndarray:
        arm.start(mode)
        for goal in goals:
            action, arrives = action_towards(arm.mode, arm.physics, arm.robot, goal, 0.03, TIMESTEP)
            assert arrives
            arm.step(action)
        return arm.state

    # The elbow is free where only the TCP is commanded: compare that.
    own, reference = run(name), run("pd_joint_pos")
    if "ee" in name:
        # Measured orientations are kept, with what the motion tilts the hand.
        tolerance = 3e-3 if name == "pd_ee_delta_pos" else 3e-4
        np.testing.assert_allclose(tcp_pose(own[:7]), tcp_pose(reference[:7]), atol=tolerance)
    else:
        np.testing.assert_allclose(own, reference, atol=1e-9)


def _straight_goals() -> np.ndarray:
    """Joint targets that move the TCP to the side without turning it."""
    solver, joints, goals = TcpSolver(), HOME, []
    pose = solver.pose(HOME)
    for _ in range(12):
        pose[1, 3] += 0.002
        joints, _ = solver.reach(pose, joints)
        goals.append(joints)
    return np.array(goals)


@pytest.mark.parametrize("name", SIZES)
def test_an_episode_goes_on_from_a_saved_state_bit_for_bit(arm, name):
    spec = arm.start(name).mode.spec()
    actions = np.random.default_rng(3).uniform(spec.minimum, spec.maximum, (12, SIZES[name]))
    if name in ABSOLUTE:
        actions = arm.still() + 0.05 * actions
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    model, data = arm.physics.model.ptr, arm.physics.data.ptr
    states, saved, memory = [], np.empty(mujoco.mj_stateSize(model, kind)), None
    for k, action in enumerate(actions):
        if k == 5:
            mujoco.mj_getState(model, data, saved, kind)
            memory = arm.mode.memory()
        arm.step(action)
        states.append(arm.state)
    again = arm.start(name)
    assert len(again.mode.memory()) == len(memory)
    for action in actions[:5]:
        again.step(action)
    np.testing.assert_array_equal(again.state, states[4])
    again.start(name, HOME + 0.1)
    again.step(actions[0])
    mujoco.mj_setState(model, data, saved, kind)
    mujoco.mj_forward(model, data)
    again.mode.remember(memory)
    for k in range(5, 12):
        again.step(actions[k])
        np.testing.assert_array_equal(again.state, states[k])


@pytest.mark.parametrize("name", SIZES)
def test_modes_survive_pickling_and_copying(arm, name):
    arm.start(name)
    for twin in (pickle.loads(pickle.dumps(arm.mode)), copy.deepcopy(arm.mode)):
        np.testing.assert_array_equal(twin.memory(), arm.mode.memory())
        assert len(pickle.dumps(twin)) < 5000


def test_memory_is_a_copy(arm):
    for name in SIZES:
        arm.start(name)
        memory = arm.mode.memory()
        memory[:] = 7.0
        assert not (arm.mode.memory() == 7.0).any(), name


@pytest.mark.parametrize("name", SIZES)
def test_the_last_number_is_the_opening(arm, name):
    arm.start(name)
    action = _act(name) if name in NORMALISED else arm.still()
    # ManiSkill's -1 and 1 shut and open the gripper as well.
    for number, opening in ((0.05, 0.05), (-1.0, 0.0), (1.0, MAX_OPENING)):
        action[-1] = number
        arm.step(action)
        assert arm.physics.bind(arm.robot.gripper_actuator).ctrl == pytest.approx(opening)


# What an action of a mode means.


def test_joint_differences_start_from_the_angles_or_from_the_targets(arm):
    for name in ("pd_joint_delta_pos", "pd_joint_target_delta_pos"):
        arm.start(name)
        arm.step(_act(name, 0, 0, 0, 0, 0, 0, 0.5))
        assert arm.targets[6] == pytest.approx(HOME[6] + 0.05)
        measured = arm.joints[6]
        assert measured < HOME[6] + 0.04  # the arm is on its way
        arm.step(_act(name, 0, 0, 0, 0, 0, 0, 0.5))
        start = measured if name == "pd_joint_delta_pos" else HOME[6] + 0.05
        assert arm.targets[6] == pytest.approx(start + 0.05)


def test_targets_do_not_run_away_behind_a_joint_limit(arm):
    name = "pd_joint_target_delta_pos"
    arm.start(name)
    for _ in range(50):
        arm.step(_act(name, 0, 0, 0, 0, 0, 0, 1))
    arm.step(_act(name, 0, 0, 0, 0, 0, 0, -1))
    assert arm.targets[6] == pytest.approx(HIGH[6] - 0.1)


def test_a_velocity_is_reached_and_held(arm):
    arm.start("pd_joint_vel")
    velocity = np.array([0.5, -0.3, 0.4, 0.2, -0.5, 0.6, 1.0])
    for _ in range(25):
        arm.step(_act("pd_joint_vel", *velocity))
    np.testing.assert_allclose(arm.physics.bind(arm.robot.joints).qvel, velocity, atol=0.05)
    travelled = (arm.joints - HOME) / (25 * TIMESTEP)
    np.testing.assert_allclose(travelled, velocity, atol=0.05)
    for _ in range(25):
        arm.step(_act("pd_joint_vel"))
    np.testing.assert_allclose(arm.joints, HOME + 0.5 * velocity, atol=2e-3)


def test_a_blocked_velocity_target_waits_for_the_arm(arm):
    arm.start("pd_joint_vel")
    for _ in range(100):
        arm.step(_act("pd_joint_vel", 1.0))
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
    np.testing.assert_allclose(servo_lag(arm.physics, arm.robot)[joint], damping / stiffness)


@pytest.mark.parametrize("name", ["pd_ee_delta_pos", "pd_ee_delta_pose"])
def test_the_tcp_moves_along_the_axes_of_the_base(arm, name):
    start = tcp_pose(HOME)
    for axis in range(3):
        arm.start(name)
        arm.step(_act(name, *(0.4 * np.eye(3)[axis])))
        sent = tcp_pose(arm.targets)
        np.testing.assert_allclose(sent[:3, 3] - start[:3, 3], 0.04 * np.eye(3)[axis], atol=1e-6)
        np.testing.assert_allclose(sent[:3, :3], start[:3, :3], atol=1e-6)


@pytest.mark.parametrize("name", ["pd_ee_delta_pose", "pd_ee_target_delta_pose"])
def test_the_hand_turns_about_the_axes_of_the_base_the_positive_way(arm, name):
    start = tcp_pose(HOME)
    for axis in range(3):
        arm.start(name)
        arm.step(_act(name, 0, 0, 0, *(0.5 * np.eye(3)[axis])))
        sent = tcp_pose(arm.targets)
        turn = rotation_about(np.eye(3)[axis], 0.05)
        np.testing.assert_allclose(sent[:3, :3], turn @ start[:3, :3], atol=1e-6)
        np.testing.assert_allclose(sent[:3, 3], start[:3, 3], atol=1e-6)
    arm.start(name)
    arm.step(_act(name, 0, 0, 0, 1.0, -1.0, 1.0))
    assert rotation_angle(tcp_pose(arm.targets)[:3, :3], start[:3, :3]) == pytest.approx(
        0.1, rel=0.05
    )


def test_target_poses_add_up_and_measured_ones_do_not(arm):
    start = tcp_pose(HOME)[2, 3]
    for name in ("pd_ee_target_delta_pos", "pd_ee_target_delta_pose", "pd_ee_delta_pos"):
        arm.start(name)
        for _ in range(5):
            arm.step(_act(name, 0, 0, 0.1))
        risen = tcp_pose(arm.targets)[2, 3] - start
        if "target" in name:
            assert risen == pytest.approx(0.05, abs=1e-6)
        else:
            assert 0.01 < risen < 0.035


def test_a_target_pose_does_not_run_away(arm):
    name = "pd_ee_target_delta_pos"
    arm.start(name)
    for _ in range(60):
        arm.step(_act(name, 1.0))
    furthest = tcp_pose(arm.joints)[0, 3]
    for _ in range(10):
        arm.step(_act(name, -0.2))
    for _ in range(40):
        arm.step(_act(name))
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


# Inverse kinematics


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
        joints, left = solver.reach(solver.pose(moved), start)
        assert left < 1e-4 and (joints >= LOW).all() and (joints <= HIGH).all()
        assert np.linalg.norm(joints - start) < 3 * np.linalg.norm(moved - start)


def test_where_the_arm_is_nothing_moves():
    solver = TcpSolver()
    joints, left = solver.reach(solver.pose(HOME), HOME)
    np.testing.assert_array_equal(joints, HOME)
    assert left < 1e-9


@pytest.mark.parametrize("position", [(3.0, 0, 0.3), (0, 0, 0), (0.4, 0, -2.0), (0, 0, 9.0)])
def test_poses_out_of_reach_give_the_nearest_and_never_nan(position):
    solver = TcpSolver()
    goal = solver.pose(HOME)
    goal[:3, 3] = position
    joints, left = solver.reach(goal, HOME)
    assert np.isfinite(joints).all() and (joints >= LOW).all() and (joints <= HIGH).all()
    assert np.isfinite(left)
    away = np.linalg.norm(solver.pose(joints)[:3, 3] - position)
    assert away < np.linalg.norm(solver.pose(HOME)[:3, 3] - position)
