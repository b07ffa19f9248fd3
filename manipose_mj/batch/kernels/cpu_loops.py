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


# What the loops take is defined here: Numba compiles anew when this file changes, and looks at no other.
class DataFields(NamedTuple):
    """Numbers of bytes from the beginning of an `mjData`, unless said otherwise.

    Attributes:
      awake: Of the counts of what is awake.
      contact_count: Of how many contacts there are.
      contacts: Of the address of the first.
      contact_bytes: From one contact to the next.
      contact_geoms: From a contact to its geoms.
      warnings: Of the first counter of warnings.
      warning_bytes: From one to the next.
    """

    awake: np.ndarray
    contact_count: int
    contacts: int
    contact_bytes: int
    contact_geoms: int
    warnings: int
    warning_bytes: int


class Constants(NamedTuple):
    """What other modules say. Arguments of the loops, since Numba would keep what they said when it compiled.

    Attributes:
      lowest, highest: Limits of the arm's set-points [rad].
      joint_leads: How far they may be ahead of the joints [rad].
      reach: Of the TCP from each joint's axis, at most [m].
      tcp_lead: How far ahead of the TCP they may be [m].
      max_opening: Of the hand [m].
      state: Which parts of MuJoCo's state are read.
      diverged, full: Numbers of the warnings that say that a simulation diverged, or left out contacts or constraints.
      right_pad: The last of the robot's kinds of geoms, in `Tables.owners`.
      first: The first of what is owned there.
      fields: Where MuJoCo keeps its counts, contacts and warnings.
    """

    lowest: np.ndarray
    highest: np.ndarray
    joint_leads: np.ndarray
    reach: np.ndarray
    tcp_lead: float
    max_opening: float
    state: int
    diverged: np.ndarray
    full: np.ndarray
    right_pad: int
    first: int
    fields: DataFields


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
      owners: Of each geom, as in `Addresses`.
    """

    robots: Robots
    measured: np.ndarray
    states: np.ndarray
    whole: np.ndarray
    real: np.ndarray
    wholes: np.ndarray
    reals: np.ndarray
    owners: np.ndarray


class Seen(NamedTuple):
    """Worlds after a control step.

    Attributes:
      states: Of MuJoCo, as `SimulationState.flat` has them, then zeros; the last is 1 if anything was left out, now or
        before.
      values, contacts: Of a `FlatMeasurement`.
      diverged: Whether MuJoCo warned of it.
    """

    states: np.ndarray
    values: np.ndarray
    contacts: np.ndarray
    diverged: np.ndarray


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
_words, _addresses = _pointer_to(types.uint64), _pointer_to(types.uintp)


def _atomic_increment(_: Any, address: Any) -> Any:
    """Counts up by one what is at an address, for all threads at once; returns what it was."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
        counter = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
        return builder.atomic_rmw("add", counter, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(types.uintp), generate


_take: Any = intrinsic(_atomic_increment)


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
def put_back(constants: Constants, tables: Tables, world: int, states: Any) -> None:
    """What `write_simulation` does, in a world; states: Of all worlds, as `SimulationState.flat` has them."""
    model, data = tables.robots.models[world], tables.robots.datas[world]
    row = states.ctypes.data + np.uintp(world * states.strides[0])
    flat = carray(_doubles(row), states.shape[1])
    _reset_data(model, data)
    _set_state(model, data, row, np.int32(constants.state))
    # Who sleeps is no part of MuJoCo's state: bodies that do are not moved, so all are put in place first.
    _forward(model, data)
    place = tables.states[world]
    for k in range(tables.whole.shape[1]):
        values = carray(_integers(tables.whole[world, k]), tables.wholes[world, k])
        for i in range(len(values)):
            values[i] = np.int32(flat[place + i])
        place += len(values)
    for offset in constants.fields.awake:
        carray(_integers(data + np.uintp(offset)), 1)[0] = np.int32(flat[place])
        place += 1
    _set_state(model, data, row, np.int32(constants.state))
    _step1(model, data)
    for k in range(tables.real.shape[1]):
        values = carray(_doubles(tables.real[world, k]), tables.reals[world, k])
        values[:] = flat[place : place + len(values)]
        place += len(values)


@_compiled
def _warns(fields: DataFields, data: Any, warnings: Any) -> bool:
    """Whether MuJoCo has warned of any of these, by their numbers, since the data were last reset."""
    for warning in warnings:
        address = data + np.uintp(fields.warnings + warning * fields.warning_bytes)
        if carray(_integers(address), 1)[0] > 0:
            return True
    return False


@_compiled
def _read(constants: Constants, tables: Tables, world: int, states: Any) -> None:
    """A world's state, as `SimulationState.flat` has it; the rest is zero but for what was left out in the last steps."""
    flat = states[world]
    model, data = tables.robots.models[world], tables.robots.datas[world]
    _get_state(model, data, flat.ctypes.data, np.int32(constants.state))
    place = tables.states[world]
    for k in range(tables.whole.shape[1]):
        count = tables.wholes[world, k]
        flat[place : place + count] = carray(_integers(tables.whole[world, k]), count)
        place += count
    for offset in constants.fields.awake:
        flat[place] = carray(_integers(data + np.uintp(offset)), 1)[0]
        place += 1
    for k in range(tables.real.shape[1]):
        count = tables.reals[world, k]
        flat[place : place + count] = carray(_doubles(tables.real[world, k]), count)
        place += count
    flat[place:] = 0
    if _warns(constants.fields, data, constants.full):
        flat[-1] = 1


@_compiled
def _measure(constants: Constants, tables: Tables, world: int, seen: Seen) -> None:
    """What `measurement.measure` gives, of a world, and whether MuJoCo warns of it."""
    fields, data = constants.fields, tables.robots.datas[world]
    for k in range(seen.values.shape[1]):
        seen.values[world, k] = carray(_doubles(tables.measured[world, k]), 1)[0]
    seen.contacts[world] = False
    first = carray(_addresses(data + np.uintp(fields.contacts)), 1)[0]
    for contact in range(carray(_integers(data + np.uintp(fields.contact_count)), 1)[0]):
        address = first + np.uintp(contact * fields.contact_bytes + fields.contact_geoms)
        geoms = carray(_integers(address), 2)
        one, other = tables.owners[world, geoms[0]], tables.owners[world, geoms[1]]
        kind, slot = min(one, other), max(one, other)
        if kind <= constants.right_pad and slot >= constants.first:
            seen.contacts[world, kind, slot - constants.first] = True
    seen.diverged[world] = _warns(fields, data, constants.diverged)


@_compiled
def advance(
    constants: Constants,
    tables: Tables,
    states: Any,
    targets: Any,
    kept: Any,
    seen: Seen,
    taken: Any,
) -> None:
    """A control step of all worlds; threads that call it at once share them.

    A world is put back, stepped and read while its data are at hand in the processor's cache.

    Args:
      constants, tables: Of all worlds.
      states: Whence the worlds go on, (worlds, values).
      targets: Joint angles [rad] and openings [m], (worlds, substeps, 8).
      kept: The states that the worlds' data are in, before and afterwards.
      seen: To be written.
      taken: How many worlds a thread has begun with, [0] at first; one array for all threads.
    """
    room = np.empty(7)
    while True:
        world = _take(taken.ctypes.data)
        if world >= len(states):
            return
        if _differ(states, kept, world):
            put_back(constants, tables, world, states)
        robots, full = tables.robots, states[world, -1]
        model, data = robots.models[world], robots.datas[world]
        for substep in range(targets.shape[1]):
            follow(constants, robots, world, targets[world, substep], room)
            # The second half of a step, then the first of the next, as the CPU's environment steps.
            _step2(model, data)
            _step1(model, data)
        _read(constants, tables, world, seen.states)
        seen.states[world, -1] = max(seen.states[world, -1], full)
        _measure(constants, tables, world, seen)
        kept[world] = seen.states[world]


@_compiled
def _differ(states: Any, kept: Any, world: int) -> bool:
    """Whether any bit does."""
    size = states.shape[1]
    row = states.ctypes.data + np.uintp(world * states.strides[0])
    one, other = carray(_words(row), size), carray(_words(kept[world].ctypes.data), size)
    difference = np.uint64(0)
    for i in range(size):
        difference |= one[i] ^ other[i]
    return difference != 0
