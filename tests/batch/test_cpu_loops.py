"""Compiled loops move set-points as the servos of a single robot do, and find what MuJoCo's data have."""

from __future__ import annotations

import ctypes
from typing import Any

import mujoco
import numpy as np
import pytest
from dm_control import mjcf

from manipose_mj.batch.kernels.cpu_loops import follow
from manipose_mj.batch.kernels.data_fields import data_fields
from manipose_mj.batch.world_tables import constants, empty_robots, enter_robot
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda.robot import HOME, Panda
from manipose_mj.mjcf.panda.servos import Servos
from manipose_mj.mjcf.panda.speed_limits import TCP_LEAD

ROBOTS = 200


def test_set_points_move_bit_for_bit():
    panda = Panda()
    physics = mjcf.Physics.from_mjcf_model(panda.mjcf_model)
    model, at = physics.model.ptr, panda.servos(physics).at
    rng = np.random.default_rng(0)
    robots = empty_robots(1)
    slowed = stopped = 0
    for i in range(ROBOTS):
        scale = (0.001, 0.05, 0.5)[i % 3]
        joints = np.clip(HOME + rng.normal(0, 0.5, 7), *POSITION_LIMITS.T)
        controls = joints + rng.normal(0, scale, 7)
        compiled, plain = (servos_at(model, at, joints, controls) for _ in range(2))
        target = np.append(HOME + rng.normal(0, 1.0, 7), rng.uniform(-0.02, 0.1))
        if i % 50 == 0:
            target[i // 50] = np.nan
        enter_robot(robots, 0, compiled)
        follow(constants(), robots, 0, target, np.empty(7))
        plain.follow(target)
        np.testing.assert_array_equal(compiled.control, plain.control)
        assert compiled.opening[0] == plain.opening[0]
        lead = plain.tcp_jacobian() @ (plain.control - plain.joint_angles)
        slowed += bool(np.linalg.norm(lead) > 0.999 * TCP_LEAD)
        stopped += bool(np.isnan(plain.control).any())
    assert 20 < slowed < ROBOTS - 20 and stopped == ROBOTS // 50


@pytest.mark.parametrize(
    "changed", [{"tcp_lead": 0.001}, {"max_opening": 0.01}, {"lowest": np.zeros(7)}]
)
def test_limits_are_those_of_the_call(changed):
    """Not those that were true when Numba compiled the loop, perhaps weeks ago."""
    panda = Panda()
    physics = mjcf.Physics.from_mjcf_model(panda.mjcf_model)
    model, at = physics.model.ptr, panda.servos(physics).at
    robots, target, found = empty_robots(1), np.append(HOME + 0.5, 0.08), []
    for limits in (constants(), constants()._replace(**changed)):
        servos = servos_at(model, at, HOME, HOME.copy())
        enter_robot(robots, 0, servos)
        for _ in range(20):
            follow(limits, robots, 0, target, np.empty(7))
        found.append(np.append(servos.control, servos.opening))
    assert not np.array_equal(*found)


def servos_at(model: mujoco.MjModel, at: Any, joints: np.ndarray, controls: np.ndarray) -> Servos:
    data = mujoco.MjData(model)
    data.qpos[at.angles], data.ctrl[at.arm] = joints, controls
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return Servos.of(model, data, at)


def test_fields_are_where_mujoco_shows_them():
    """Contacts of a falling box, a warning, and what is awake."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .09'><freejoint/>"
        "<geom name='box' type='box' size='.1 .1 .1'/></body></worldbody></mujoco>"
    )
    data, fields = mujoco.MjData(model), data_fields()
    mujoco.mj_forward(model, data)
    data.warning[3].number = 5

    def number(kind: Any, offset: int) -> int:
        return kind.from_address(data._address + offset).value

    assert number(ctypes.c_int32, fields.contact_count) == data.ncon == 4
    first = number(ctypes.c_uint64, fields.contacts)
    geoms = data.contact.geom
    assert first + fields.contact_geoms == geoms.ctypes.data
    assert fields.contact_bytes == geoms.strides[0]
    assert number(ctypes.c_int32, fields.warnings + 3 * fields.warning_bytes) == 5
    awake = [data.ntree_awake, data.nbody_awake, data.nparent_awake, data.nv_awake]
    assert [number(ctypes.c_int32, int(at)) for at in fields.awake] == awake
