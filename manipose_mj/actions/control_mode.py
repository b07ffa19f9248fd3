"""Hosts a control law in a simulated scene: reads the robot, and keeps what the law remembers."""

from __future__ import annotations

from typing import Any

import numpy as np
from dm_control import mjcf
from dm_env import specs
from jaxtyping import Float

from manipose_mj.actions.control_law import Arm, ControlLaw, Memory
from manipose_mj.actions.tcp_solver import TcpSolver
from manipose_mj.errors import InputError, brief
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING, Panda

_NO_LAG = np.zeros(7)


class ControlMode:
    """Turns actions into targets of the robot's position servos; the physics stays the same."""

    def __init__(self, law: ControlLaw) -> None:
        self.law = law
        self.kinematics = TcpSolver() if law.moves_tcp else None
        self._memory = Memory.at(HOME, np.asarray(MAX_OPENING))
        self._timestep = 0.0

    @property
    def name(self) -> str:
        """As users write it."""
        return self.law.name

    @property
    def remembered(self) -> Memory:
        """What the law remembers now."""
        return self._memory

    def spec(self) -> specs.BoundedArray:
        """Shape and limits of an action, named for the mode."""
        law = self.law
        minimum, maximum = np.append(law.lower, 0.0), np.append(law.upper, MAX_OPENING)
        return specs.BoundedArray(minimum.shape, np.float64, minimum, maximum, name=law.name)

    def arm(self, physics: mjcf.Physics, robot: Panda) -> Arm:
        """What the law may know of the robot now."""
        joints, _ = robot.configuration(physics)
        lag = robot.servo_lag(physics) if self.law.sets_velocities else _NO_LAG
        return Arm(joints, lag, self.kinematics)

    def reset(self, physics: mjcf.Physics, robot: Panda) -> None:
        """Start an episode; the robot is home and at rest."""
        self._timestep = physics.timestep()
        opening = np.asarray(robot.configuration(physics)[1])
        self._memory = self.law.start(opening, self.arm(physics, robot))

    def begin(self, physics: mjcf.Physics, robot: Panda, action: Float[np.ndarray, "n"]) -> None:
        """Take the action of this control step, checked already for shape and finiteness."""
        arm = self.arm(physics, robot)
        self._memory = self.law.begin(self._memory, np.array(action), arm)

    def targets(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint targets [rad] and opening [m] for the next physics step; to be called before each."""
        joints, self._memory = self.law.targets(self._memory, self._timestep)
        return joints, float(self._memory.opening)

    def memory(self) -> Float[np.ndarray, "m"]:
        """What the mode remembers between steps, for a saved state; of one length."""
        return np.concatenate([np.ravel(field) for field in self._memory])

    def remember(self, memory: Float[np.ndarray, "m"]) -> None:
        """Go on from a saved memory."""
        fields, start = [], 0
        for field in self._memory:
            fields.append(np.array(memory[start : start + np.size(field)]).reshape(np.shape(field)))
            start += np.size(field)
        self._memory = Memory(*fields)


def checked_action(mode: str, shape: tuple[int, ...], action: Any) -> Float[np.ndarray, "n"]:
    """The action as an array of the shape that the mode of this name takes.

    Raises:
      InputError: It has another shape, or a value that is no finite number.
    """
    array = real_array(action)
    if array is None or array.shape != shape or not np.isfinite(array).all():
        raise InputError(f"action {in_words(action)}; {mode} expects {shape[0]} finite numbers")
    return array


def real_array(action: Any) -> np.ndarray | None:
    """The action as an array of real numbers, if it is one."""
    try:
        return None if np.iscomplexobj(action) else np.asarray(action, float)
    except (TypeError, ValueError):
        return None


def in_words(action: Any) -> str:
    """What an action is, in words that follow "action" in an error."""
    array = real_array(action)
    if array is None:
        return f"is {brief(action)}, which is no array of real numbers"
    return f"has shape {array.shape} and values {array.ravel()[:8].tolist()}"
