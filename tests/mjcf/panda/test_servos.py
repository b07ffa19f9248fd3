"""Many robots' servos follow together as each does by itself."""

from __future__ import annotations

import mujoco
import numpy as np
from dm_control import mjcf

from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda.robot import HOME, Panda
from manipose_mj.mjcf.panda.servos import ServoGroup, Servos
from manipose_mj.mjcf.panda.speed_limits import TCP_LEAD

ROBOTS = 60


def test_robots_follow_together_bit_for_bit():
    panda = Panda()
    physics = mjcf.Physics.from_mjcf_model(panda.mjcf_model)
    model, at = physics.model.ptr, panda.servos(physics).at
    rng = np.random.default_rng(0)
    pairs, slowed = [], 0
    for i in range(ROBOTS):
        scale = (0.001, 0.05, 0.5)[i % 3]
        joints = np.clip(HOME + rng.normal(0, 0.5, 7), *POSITION_LIMITS.T)
        controls = joints + rng.normal(0, scale, 7)
        each = []
        for _ in range(2):
            data = mujoco.MjData(model)
            data.qpos[at.angles], data.ctrl[at.arm] = joints, controls
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            each.append(Servos.of(model, data, at))
        pairs.append(each)
    targets = np.concatenate(
        [HOME + rng.normal(0, 1.0, (ROBOTS, 7)), rng.uniform(-0.02, 0.1, (ROBOTS, 1))], axis=1
    )
    group = ServoGroup([together for together, _ in pairs])
    group.read_set_points()
    group.follow(targets)
    for (together, alone), target in zip(pairs, targets, strict=True):
        alone.follow(target)
        np.testing.assert_array_equal(together.control, alone.control)
        assert together.opening[0] == alone.opening[0]
        lead = together.tcp_jacobian() @ (alone.control - alone.joint_angles)
        slowed += bool(np.linalg.norm(lead) > 0.999 * TCP_LEAD)
    assert 0 < slowed < ROBOTS
