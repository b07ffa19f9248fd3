"""Where in memory each world's values are, for the compiled loops."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.batch.kernels.cpu_loops import Constants, Robots, Tables
from manipose_mj.batch.kernels.data_fields import data_fields
from manipose_mj.batch.measurement import flat_values, gathered
from manipose_mj.batch.starts import Start, StartPool
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda.servos import Servos
from manipose_mj.mjcf.panda.speed_limits import JOINT_LEADS, TCP_LEAD, TCP_REACH, most_motion
from manipose_mj.tasks.core.simulation_state import ASLEEP, LEFT_BEHIND, STATE, state_size
from manipose_mj.tasks.scene.indices import FIRST, NOBODY, RIGHT_PAD

# What MuJoCo warns of when a simulation diverges, as dm_control asks for it.
_DIVERGED = ("INERTIA", "BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
_FULL = ("CONTACTFULL", "CNSTRFULL")


class _Addresses:
    """In place of each of MuJoCo's arrays, the addresses of its values, in the same shape."""

    def __init__(self, data: mujoco.MjData) -> None:
        self._data = data

    def __getattr__(self, name: str) -> np.ndarray:
        array = getattr(self._data, name)
        return array.ctypes.data + array.itemsize * np.arange(array.size).reshape(array.shape)


def constants() -> Constants:
    """As the task's own modules have them."""
    lowest, highest = POSITION_LIMITS.T.copy()
    return Constants(
        lowest=lowest,
        highest=highest,
        joint_leads=JOINT_LEADS,
        reach=np.ascontiguousarray(TCP_REACH),
        tcp_lead=float(TCP_LEAD),
        max_opening=float(MAX_OPENING),
        state=int(STATE),
        diverged=_numbers(_DIVERGED),
        full=_numbers(_FULL),
        right_pad=RIGHT_PAD,
        first=FIRST,
        fields=data_fields(),
    )


def _numbers(warnings: tuple[str, ...]) -> np.ndarray:
    return np.array([int(getattr(mujoco.mjtWarning, f"mjWARN_{name}")) for name in warnings])


def empty_tables(pool: StartPool, worlds: int) -> Tables:
    """Tables of so many worlds, none of which is in them yet."""
    geoms = max(model.ngeom for model in pool.scenes)
    values = len(flat_values(pool.starts[0].measurement))

    def addresses(*shape: int) -> np.ndarray:
        return np.zeros((worlds, *shape), np.uintp)

    def numbers(*shape: int) -> np.ndarray:
        return np.zeros((worlds, *shape), int)

    return Tables(
        robots=empty_robots(worlds),
        measured=addresses(values),
        states=numbers(),
        whole=addresses(len(ASLEEP)),
        real=addresses(len(LEFT_BEHIND)),
        wholes=numbers(len(ASLEEP)),
        reals=numbers(len(LEFT_BEHIND)),
        owners=np.full((worlds, geoms), NOBODY),
    )


def empty_robots(worlds: int) -> Robots:
    """The robots of so many worlds, none of which is known yet."""
    models, datas, angles, controls, openings, jacobians = np.zeros((6, worlds), np.uintp)
    velocities, arms = np.zeros((2, worlds), int)
    sites, most = np.zeros(worlds, np.int32), np.zeros((worlds, 7))
    return Robots(
        models, datas, angles, controls, openings, jacobians, velocities, arms, sites, most
    )


def enter_robot(robots: Robots, world: int, servos: Servos) -> None:
    """Writes where a world's robot is.

    Args:
      robots: To be written.
      world: Its number.
      servos: Of its robot, which have its model and data. They have to be kept as long as the tables are used.
    """
    model, at = servos.model, servos.at
    robots.models[world] = model._address
    robots.datas[world] = servos.data._address
    robots.angles[world] = servos.joint_angles.ctypes.data
    robots.controls[world] = servos.control.ctypes.data
    robots.openings[world] = servos.opening.ctypes.data
    robots.jacobians[world] = servos.jacobian.ctypes.data
    robots.velocities[world] = model.nv
    robots.arms[world] = at.dofs.start
    robots.sites[world] = at.tcp
    robots.most[world] = most_motion(model.opt.timestep)


def enter(tables: Tables, world: int, start: Start, servos: Servos) -> None:
    """Writes where a world is.

    Args:
      tables: To be written.
      world: Its number.
      start: Its start.
      servos: As of `enter_robot`.
    """
    enter_robot(tables.robots, world, servos)
    data = servos.data
    none = np.zeros(start.measurement.contacts.shape, bool)
    addresses: Any = _Addresses(data)
    tables.measured[world] = flat_values(gathered(addresses, start.addresses, none))
    tables.states[world] = state_size(servos.model)
    whole, real = ([getattr(data, name) for name in names] for names in (ASLEEP, LEFT_BEHIND))
    assert all(array.dtype == np.int32 for array in whole)
    tables.whole[world] = [array.ctypes.data for array in whole]
    tables.real[world] = [array.ctypes.data for array in real]
    tables.wholes[world] = [array.size for array in whole]
    tables.reals[world] = [array.size for array in real]
    owners = start.addresses.owners
    tables.owners[world] = NOBODY
    tables.owners[world, : len(owners)] = owners
