"""Loops over worlds of the engine `c`, which call MuJoCo; Numba compiles them at the first call and keeps them.

A Python call, and NumPy on arrays of seven numbers, cost as much as a tenth of a physics step. These loops hold no
lock of Python's, so threads run them side by side. MuJoCo's warnings go where they always go; an error of MuJoCo's, such
as a stack without room, ends the process with its message.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import mujoco
import numpy as np
from llvmlite import ir
from numba import njit
from numba.core import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from manipose_mj.errors import InputError

_LIBRARY = re.compile(r"(lib)?mujoco[.\d]*(\.so[.\d]*|\.dylib|\.dll)")
_FUNCTIONS = (
    "mj_step1", "mj_step2", "mj_jacSite", "mj_getState", "mj_setState", "mj_resetData", "mj_forward",
)  # fmt: skip
# The TCP moves less than its joints sweep, whatever rounding does to either.
_SURELY = 1 - 1e-9


class Constants(NamedTuple):
    """What other modules say. Arguments of the loops, since Numba would keep what they said when it compiled.

    Attributes:
      lowest, highest: Limits of the arm's set-points [rad].
      joint_leads: How far they may be ahead of the joints [rad].
      reach: Of the TCP from each joint's axis, at most [m].
      tcp_lead: How far ahead of the TCP they may be [m].
      max_opening: Of the hand [m].
      state: Which parts of MuJoCo's state are read.
      warnings: Numbers of those that say that a simulation diverged.
      right_pad: The last of the robot's kinds of geoms, in `Tables.owners`.
      first: The first of what is owned there.
    """

    lowest: np.ndarray
    highest: np.ndarray
    joint_leads: np.ndarray
    reach: np.ndarray
    tcp_lead: float
    max_opening: float
    state: int
    warnings: np.ndarray
    right_pad: int
    first: int


class Robots(NamedTuple):
    """Where each world's robot is; rows are worlds. Addresses are numbers of bytes.

    Attributes:
      models, datas: Addresses of MuJoCo's model and data.
      angles, controls, openings: Of the arm's angles in `qpos`, its controls, and the hand's control.
      jacobians: Of room for three rows of the site's Jacobian.
      velocities: Numbers of degrees of freedom.
      arms: The first of the arm's.
      sites: The TCP.
      most: How far a set-point of the arm may move in a step [rad].
    """

    models: np.ndarray
    datas: np.ndarray
    angles: np.ndarray
    controls: np.ndarray
    openings: np.ndarray
    jacobians: np.ndarray
    velocities: np.ndarray
    arms: np.ndarray
    sites: np.ndarray
    most: np.ndarray


class Tables(NamedTuple):
    """Where each world's values are; rows are worlds. Addresses are numbers of bytes.

    Attributes:
      robots: With the worlds' models and data.
      measured: Addresses of what a measurement is made of, in its order.
      states: Numbers of values that MuJoCo's state has.
      whole, real: Addresses of what else belongs to a world's state: integers, then doubles.
      wholes, reals: How many are at each.
      contacts: Address of the first contact's geoms; 0 until there was one.
      contact_bytes: From one contact to the next.
      warnings: Address of the first counter of warnings.
      warning_bytes: From one to the next.
      owners: Of each geom, as in `Addresses`.
    """

    robots: Robots
    measured: np.ndarray
    states: np.ndarray
    whole: np.ndarray
    real: np.ndarray
    wholes: np.ndarray
    reals: np.ndarray
    contacts: np.ndarray
    contact_bytes: np.ndarray
    warnings: np.ndarray
    warning_bytes: np.ndarray
    owners: np.ndarray


def _symbols() -> None:
    """Lets compiled code find MuJoCo's functions by their names, in the library that `mujoco` has loaded.

    Raises:
      InputError: The library is not where it is expected.
    """
    folder = Path(str(mujoco.__file__)).parent
    libraries = [path for path in folder.iterdir() if _LIBRARY.fullmatch(path.name)]
    if len(libraries) != 1:
        raise InputError(
            f"{folder}: {len(libraries)} libraries of MuJoCo, expected one: install mujoco again"
        )
    library = ctypes.CDLL(str(libraries[0]))
    for name in _FUNCTIONS:
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        assert address is not None
        llvm.add_symbol(name, address)


def _compiled(loop: Callable) -> Any:
    """A loop that Numba compiles; kept for the next process, unless it finds no folder that it may write."""
    try:
        return njit(nogil=True, cache=True)(loop)
    except RuntimeError:
        return njit(nogil=True)(loop)


_symbols()
_POINTER = types.uintp
_step1 = types.ExternalFunction("mj_step1", types.void(_POINTER, _POINTER))
_step2 = types.ExternalFunction("mj_step2", types.void(_POINTER, _POINTER))
_site_jacobian = types.ExternalFunction(
    "mj_jacSite", types.void(_POINTER, _POINTER, _POINTER, _POINTER, types.int32)
)
_get_state = types.ExternalFunction(
    "mj_getState", types.void(_POINTER, _POINTER, _POINTER, types.int32)
)
_set_state = types.ExternalFunction(
    "mj_setState", types.void(_POINTER, _POINTER, _POINTER, types.int32)
)
_reset_data = types.ExternalFunction("mj_resetData", types.void(_POINTER, _POINTER))
_forward = types.ExternalFunction("mj_forward", types.void(_POINTER, _POINTER))


def _pointer_to(kind: Any) -> Any:
    @intrinsic
    def pointer(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(kind)(address), generate

    return pointer


_doubles, _integers = _pointer_to(types.float64), _pointer_to(types.int32)


@_compiled
def step(constants: Constants, robots: Robots, targets: Any, first: int, end: int) -> None:
    """Physics steps of some worlds, one world after the other.

    Args:
      constants, robots: Of all worlds.
      targets: Joint angles [rad] and openings [m], (worlds, substeps, 8).
      first: World that is stepped; end: Not stepped any more.
    """
    room = np.empty(7)
    for world in range(first, end):
        model, data = robots.models[world], robots.datas[world]
        for substep in range(targets.shape[1]):
            follow(constants, robots, world, targets[world, substep], room)
            # The second half of a step, then the first of the next, as the CPU's environment steps.
            _step2(model, data)
            _step1(model, data)


@_compiled
def follow(constants: Constants, robots: Robots, world: int, target: Any, allowed: Any) -> None:
    """Moves a world's set-points as `Servos.follow` does, bit for bit; `allowed` is room for seven numbers."""
    angles = carray(_doubles(robots.angles[world]), 7)
    control = carray(_doubles(robots.controls[world]), 7)
    swept = 0.0
    for j in range(7):
        most, lead = robots.most[world, j], constants.joint_leads[j]
        value = np.minimum(np.maximum(target[j], control[j] - most), control[j] + most)
        value = np.minimum(np.maximum(value, angles[j] - lead), angles[j] + lead)
        allowed[j] = value
        swept += abs(value - angles[j]) * constants.reach[j]
    if swept >= _SURELY * constants.tcp_lead:
        _slow_down(constants, robots, world, angles, allowed)
    for j in range(7):
        control[j] = np.minimum(np.maximum(allowed[j], constants.lowest[j]), constants.highest[j])
    opening = carray(_doubles(robots.openings[world]), 1)
    opening[0] = np.minimum(np.maximum(target[7], 0.0), constants.max_opening)


@_compiled
def _slow_down(constants: Constants, robots: Robots, world: int, angles: Any, allowed: Any) -> None:
    """Draws set-points nearer to the joints where the TCP would move too fast, as `allowed_set_points` does."""
    model, data, address = robots.models[world], robots.datas[world], robots.jacobians[world]
    _site_jacobian(model, data, address, np.uintp(0), robots.sites[world])
    jacobian = carray(_doubles(address), (3, robots.velocities[world]))
    first, squares = robots.arms[world], 0.0
    for row in range(3):
        motion = 0.0
        for j in range(7):
            motion += jacobian[row, first + j] * (allowed[j] - angles[j])
        squares += motion * motion
    length = np.sqrt(squares)
    if length > constants.tcp_lead:
        share = constants.tcp_lead / length
        for j in range(7):
            allowed[j] = angles[j] + share * (allowed[j] - angles[j])


@_compiled
def begin_putting_back(constants: Constants, tables: Tables, chosen: Any, states: Any) -> None:
    """The first half of `write_simulation`: all before the counts of what is awake.

    Args:
      constants, tables: Of all worlds.
      chosen: Numbers of the worlds.
      states: Of all worlds, as `read` gives them.
    """
    for world in chosen:
        flat = states[world]
        model, data = tables.robots.models[world], tables.robots.datas[world]
        _reset_data(model, data)
        _set_state(model, data, flat.ctypes.data, np.int32(constants.state))
        _forward(model, data)
        place = tables.states[world]
        for k in range(tables.whole.shape[1]):
            values = carray(_integers(tables.whole[world, k]), tables.wholes[world, k])
            for i in range(len(values)):
                values[i] = np.int32(flat[place + i])
            place += len(values)


@_compiled
def end_putting_back(
    constants: Constants, tables: Tables, chosen: Any, states: Any, awake: int
) -> None:
    """The second half of `write_simulation`: all after the counts, of which there are `awake`."""
    for world in chosen:
        flat = states[world]
        model, data = tables.robots.models[world], tables.robots.datas[world]
        _set_state(model, data, flat.ctypes.data, np.int32(constants.state))
        _step1(model, data)
        place = tables.states[world] + tables.wholes[world].sum() + awake
        for k in range(tables.real.shape[1]):
            values = carray(_doubles(tables.real[world, k]), tables.reals[world, k])
            values[:] = flat[place : place + len(values)]
            place += len(values)


@_compiled
def read(constants: Constants, tables: Tables, awake: Any, states: Any) -> None:
    """All states, as `SimulationState.flat` has them; what is longer stays as it is.

    Args:
      constants, tables: Of all worlds.
      awake: Counts of what is awake, (worlds, 4).
      states: To be written, (worlds, values).
    """
    for world in range(len(states)):
        flat = states[world]
        model, data = tables.robots.models[world], tables.robots.datas[world]
        _get_state(model, data, flat.ctypes.data, np.int32(constants.state))
        place = tables.states[world]
        for k in range(tables.whole.shape[1]):
            count = tables.wholes[world, k]
            flat[place : place + count] = carray(_integers(tables.whole[world, k]), count)
            place += count
        flat[place : place + awake.shape[1]] = awake[world]
        place += awake.shape[1]
        for k in range(tables.real.shape[1]):
            count = tables.reals[world, k]
            flat[place : place + count] = carray(_doubles(tables.real[world, k]), count)
            place += count


@_compiled
def measure(
    constants: Constants, tables: Tables, counts: Any, values: Any, touched: Any, diverged: Any
) -> None:
    """What `measurement.measure` gives, of all worlds, and which of them MuJoCo warns of.

    Args:
      constants, tables: Of all worlds.
      counts: Of contacts.
      values, touched: Of a `FlatMeasurement`, to be written; nothing is touched yet.
      diverged: To be written.
    """
    for world in range(len(values)):
        for k in range(values.shape[1]):
            values[world, k] = carray(_doubles(tables.measured[world, k]), 1)[0]
        for contact in range(counts[world]):
            address = tables.contacts[world] + np.uintp(contact) * tables.contact_bytes[world]
            geoms = carray(_integers(address), 2)
            one, other = tables.owners[world, geoms[0]], tables.owners[world, geoms[1]]
            kind, slot = min(one, other), max(one, other)
            if kind <= constants.right_pad and slot >= constants.first:
                touched[world, kind, slot - constants.first] = True
        diverged[world] = False
        for warning in constants.warnings:
            address = tables.warnings[world] + np.uintp(warning) * tables.warning_bytes[world]
            if carray(_integers(address), 1)[0] > 0:
                diverged[world] = True
