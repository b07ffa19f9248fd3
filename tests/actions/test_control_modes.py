"""Every control mode: its spec, that it keeps to its limits, and that the physics is always the same."""

from __future__ import annotations

import copy
import pickle

import mujoco
import numpy as np
import pytest

from manipose_mj.actions import (
    CONTROL_MODES,
    TcpSolver,
    action_towards,
    checked_action,
    control_mode,
)
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.kinematics import tcp_pose
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING, POSITION_LIMITS
from tests.actions.driven_arm import SIZES, TIMESTEP, act

LOW, HIGH = POSITION_LIMITS.T
NORMALISED = [
    name for name in SIZES if name not in ("pd_joint_pos", "pd_joint_pos_vel", "pd_ee_pose")
]
ABSOLUTE = ["pd_joint_pos", "pd_joint_pos_vel", "pd_ee_pose"]


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


@pytest.mark.usefixtures("wrong_arrays")
@pytest.mark.parametrize(
    ("action", "said"),
    [
        (np.zeros(2) + 0j, "is array([0.+0.j, 0.+0.j]), which is no array of real numbers"),
        (["a", "b"], "is ['a', 'b'], which is no array of real numbers"),
        ([[1.0], [1.0, 2.0]], "is [[1.0], [1.0, 2.0]], which is no array of real numbers"),
        ([1.0], "has shape (1,) and values [1.0]"),
        ([1.0, float("nan")], "has shape (2,) and values [1.0, nan]"),
    ],
)
def test_a_wrong_action_is_told_as_what_it_is(action, said):
    with pytest.raises(InputError) as refusal:
        checked_action("pd_joint_pos", (2,), action)
    assert str(refusal.value) == f"action {said}; pd_joint_pos expects 2 finite numbers"


@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("kind", ["short", "nan", "text"])
def test_a_bad_action_is_refused_in_one_line(arm, name, kind):
    arm.start(name)
    action: object = "up"
    if kind == "short":
        action = np.zeros(SIZES[name] - 1)
    elif kind == "nan":
        action = act(name, np.nan)
    with pytest.raises(InputError, match=name) as refused:
        arm.step(action)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value) and str(SIZES[name]) in str(refused.value)


@pytest.mark.parametrize("name", SIZES)
def test_the_neutral_action_keeps_the_robot_still(arm, name):
    arm.start(name)
    action = act(name) if name in NORMALISED else arm.still()
    for _ in range(25):
        arm.step(action)
    np.testing.assert_allclose(arm.joints, HOME, atol=2e-4)
    assert arm.robot.configuration(arm.physics)[1] == pytest.approx(MAX_OPENING, abs=2e-4)


@pytest.mark.sample(4)
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


@pytest.mark.parametrize("ahead", [0.09, 0.15])
def test_a_velocity_arrives_only_where_the_servos_are_sent_there(arm, ahead):
    name = "pd_joint_vel"
    arm.start(name)
    for _ in range(10):
        arm.step(act(name, 1.0))
        held = arm.physics.bind(arm.robot.joints)  # by something in its way
        held.qpos, held.qvel = HOME, np.zeros(7)
    goal = HOME + ahead * np.eye(7)[0]
    action, arrives = action_towards(arm.mode, arm.physics, arm.robot, goal, 0.03, TIMESTEP)
    arm.step(action)
    assert arrives == (ahead < 0.1)
    assert arrives == np.allclose(arm.controls, goal, atol=1e-6)


def _straight_goals() -> np.ndarray:
    """Joint targets that move the TCP to the side without turning it."""
    solver, joints, goals = TcpSolver(), HOME, []
    pose = solver.pose(HOME)
    for _ in range(12):
        pose[1, 3] += 0.002
        joints, _ = solver.reach(pose, joints)
        goals.append(joints)
    return np.array(goals)


@pytest.mark.sample(4)
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
    action = act(name) if name in NORMALISED else arm.still()
    # ManiSkill's -1 and 1 shut and open the gripper as well.
    for number, opening in ((0.05, 0.05), (-1.0, 0.0), (1.0, MAX_OPENING)):
        action[-1] = number
        arm.step(action)
        assert arm.physics.bind(arm.robot.gripper_actuator).ctrl == pytest.approx(opening)
