"""Control laws and the limiter of set-points under `jit` and `vmap` do what they do for one robot in NumPy."""

from __future__ import annotations

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manipose_mj.actions import Arm, PureTcpSolver, TcpSolver, control_law, control_mode
from manipose_mj.actions.tcp_motion import euler_rotation
from manipose_mj.actions.tcp_search import damped_step
from manipose_mj.mjcf.panda.kinematics import link_poses, tcp_pose
from manipose_mj.mjcf.panda.robot import HOME, POSITION_LIMITS, VELOCITY_LIMITS
from manipose_mj.mjcf.panda.speed_limits import allowed_set_points, most_motion
from tests.actions.driven_arm import SIZES

LOW, HIGH = POSITION_LIMITS.T
ROBOTS, CONTROL_STEPS, SUBSTEPS, TIMESTEP = 6, 3, 2, 0.002
SERVO_LAG, OPENING = np.full(7, 0.1, np.float32), 0.04
SOLVER = SimpleNamespace(pose=jax.jit(PureTcpSolver().pose), reach=jax.jit(PureTcpSolver().reach))


def sent(start, begin, targets, joints, actions):
    """What the servos are sent in some control steps, of arms that go a part of the way there."""
    memory, found = start(joints), []
    for action in actions:
        memory = begin(memory, action, joints)
        for _ in range(SUBSTEPS):
            target, memory = targets(memory)
            found.append(target)
        joints = joints + 0.3 * (target - joints)
    return [*found, *memory]


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", SIZES)
def test_every_robot_of_a_batch_is_sent_what_it_would_be_alone(name):
    law, rng = control_law(name), np.random.default_rng(3)
    spec = control_mode(name).spec()
    joints = HOME + rng.uniform(-0.2, 0.2, (ROBOTS, 7))
    actions = rng.uniform(spec.minimum, spec.maximum, (CONTROL_STEPS, ROBOTS, SIZES[name]))
    if name == "pd_ee_pose":  # somewhere in front of the robot, the hand pointing down
        actions[..., :3] = rng.uniform(
            [0.3, -0.2, 0.2], [0.6, 0.2, 0.5], (CONTROL_STEPS, ROBOTS, 3)
        )
        actions[..., 3:6] = [np.pi, 0, 0] + rng.uniform(-0.3, 0.3, (CONTROL_STEPS, ROBOTS, 3))
    # Modes that move the TCP share what compiles longest; one of them is compiled as a whole.
    whole = jax.jit if not law.moves_tcp or name == "pd_ee_pose" else lambda function: function

    def steps(kinematics, batch):
        def begin(memory, action, q):
            return law.begin(memory, action, Arm(q, SERVO_LAG, kinematics))

        return (
            batch(lambda q: law.start(q[0] * 0 + OPENING, Arm(q, SERVO_LAG, kinematics))),
            batch(begin),
            batch(lambda memory: law.targets(memory, TIMESTEP)),
        )

    pure = steps(SOLVER, lambda function: whole(jax.vmap(function)))
    many = sent(*pure, jnp.asarray(joints), jnp.asarray(actions))
    alone = steps(TcpSolver() if law.moves_tcp else None, lambda function: function)
    for i in range(ROBOTS):
        one = sent(*alone, joints[i], actions[:, i])
        for own, other in zip(one, many, strict=True):
            np.testing.assert_allclose(other[i], own, rtol=0, atol=1e-5)


@pytest.mark.parametrize("name", [n for n in SIZES if "ee" not in n])
def test_laws_of_joints_take_batches_as_they_are(name):
    law, rng = control_law(name), np.random.default_rng(4)
    joints, actions = (
        HOME + rng.uniform(-1, 1, (ROBOTS, 7)),
        rng.uniform(-2, 2, (ROBOTS, SIZES[name])),
    )
    opening = np.full(ROBOTS, 0.04)
    arm = Arm(joints, SERVO_LAG)
    batch = law.targets(law.begin(law.start(opening, arm), actions, arm), TIMESTEP)
    for i in range(ROBOTS):
        alone = Arm(joints[i], SERVO_LAG)
        single = law.targets(law.begin(law.start(opening[i], alone), actions[i], alone), TIMESTEP)
        for own, other in zip(jax.tree.leaves(single), jax.tree.leaves(batch), strict=True):
            np.testing.assert_array_equal(own, other[i])


@jax.jit
@jax.vmap
def _limited(targets, set_points, joints, jacobian):
    return allowed_set_points(targets, set_points, joints, lambda: jacobian, most_motion(TIMESTEP))


def _tcp_jacobian(joints):
    """Of the arm itself [m/rad]: NumPy does not ask for one that cannot matter to it."""
    links, tcp = link_poses(joints), tcp_pose(joints)[:3, 3]
    return np.cross(links[:, :3, 2], tcp - links[:, :3, 3]).T


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.floats(0.0, 3.0))
def test_the_limiter_holds_every_robot_of_a_batch_to_its_own_limits(seed, scale):
    rng = np.random.default_rng(seed)
    joints = rng.uniform(LOW, HIGH, (ROBOTS, 7))
    set_points = joints + scale * 0.05 * rng.uniform(-1, 1, (ROBOTS, 7))
    targets = joints + scale * rng.uniform(-1, 1, (ROBOTS, 7))
    jacobians = np.stack([_tcp_jacobian(angles) for angles in joints])
    found = _limited(targets, set_points, joints, jacobians)
    for i in range(ROBOTS):
        own = allowed_set_points(
            targets[i], set_points[i], joints[i], lambda i=i: jacobians[i], most_motion(TIMESTEP)
        )
        assert (own >= LOW).all() and (own <= HIGH).all()
        bounded = allowed_set_points(
            *(jnp.asarray(a[i]) for a in (targets, set_points, joints)),
            lambda i=i: jnp.asarray(jacobians[i]),
            most_motion(TIMESTEP),
        )
        np.testing.assert_allclose(found[i], bounded, rtol=0, atol=1e-6)
        np.testing.assert_allclose(found[i], own, rtol=0, atol=1e-5)


def test_set_points_move_no_faster_than_the_joints():
    found = allowed_set_points(
        HOME + 1.0, HOME, HOME, lambda: np.zeros((3, 7)), most_motion(TIMESTEP)
    )
    np.testing.assert_allclose(found - HOME, TIMESTEP * VELOCITY_LIMITS)


def test_both_solvers_agree_on_poses_and_jacobians():
    pure, mine = PureTcpSolver(), TcpSolver()
    model, data = mine._model, mujoco.MjData(mine._model)
    rng = np.random.default_rng(0)
    poses = jax.jit(jax.vmap(pure.pose))
    joints = rng.uniform(LOW, HIGH, (10, 7))
    for q, pose in zip(joints, poses(jnp.asarray(joints)), strict=True):
        np.testing.assert_allclose(pose, mine.pose(q), atol=1e-5)
        moved = q + 1e-4
        data.qpos[:7] = moved
        mujoco.mj_kinematics(model, data)
        found, error = pure.reach(mine.pose(moved), q)  # NumPy arrays: the same code, in NumPy
        assert float(error) < 1e-6
        np.testing.assert_allclose(mine.pose(found), mine.pose(moved), atol=1e-6)


def test_a_damped_step_stops_joints_at_their_limits_and_lets_others_make_up_for_it():
    rng = np.random.default_rng(1)
    joints, jacobian = HIGH - [1e-3, 1, 1, 1, 1, 1, 1], rng.normal(size=(6, 7))
    error = jacobian @ np.full(7, 0.002)
    own = damped_step(joints, jacobian, error, 1e-6, 0.3)
    assert own[0] == joints[0] and (own[1:] != joints[1:]).all() and (own <= HIGH).all()
    np.testing.assert_allclose(jacobian @ (own - joints), error, atol=1e-4)
    # With the damping of a pose some centimetres away, for single precision.
    single = jax.jit(lambda *a: damped_step(*a, 1e-2, 0.3))
    found = single(*map(jnp.asarray, (joints, jacobian, error)))
    np.testing.assert_allclose(found, damped_step(joints, jacobian, error, 1e-2, 0.3), atol=1e-5)


def test_euler_rotations_agree():
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 3))
    found = jax.jit(jax.vmap(euler_rotation))(jnp.asarray(angles))
    np.testing.assert_allclose(found, [euler_rotation(a) for a in angles], atol=1e-6)
