"""What an action means: the interface of control modes, and the one that tasks start with."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from dm_control import mjcf
from dm_env import specs
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda import MAX_OPENING, POSITION_LIMITS, Panda


class ActionMode(Protocol):
    """Turns actions into targets of the robot's position servos; the physics stays the same.

    Attributes:
      name: As users write it.
    """

    name: str

    def spec(self) -> specs.BoundedArray:
        """Shape and limits of an action, named for the mode."""
        ...

    def reset(self, physics: mjcf.Physics, robot: Panda) -> None:
        """Start an episode; the robot is home and at rest."""
        ...

    def begin(self, physics: mjcf.Physics, robot: Panda, action: Float[np.ndarray, "n"]) -> None:
        """Take the action of this control step, checked already for shape and finiteness."""
        ...

    def targets(
        self, physics: mjcf.Physics, robot: Panda, share: float
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint targets [rad] and opening [m] for the next physics step.

        Args:
          physics: The scene's.
          robot: In it.
          share: Of the control step that will have passed after this physics step, in (0, 1].
        """
        ...

    def memory(self) -> Float[np.ndarray, "m"]:
        """What the mode remembers between steps, for a saved state; of one length."""
        ...

    def remember(self, memory: Float[np.ndarray, "m"]) -> None:
        """Go on from a saved memory."""
        ...


class JointPositions:
    """`pd_joint_pos`: seven joint targets [rad] and the gripper's opening [m]."""

    name = "pd_joint_pos"

    def __init__(self) -> None:
        self._action = np.zeros(8)

    def spec(self) -> specs.BoundedArray:
        """Shape and limits of an action."""
        minimum = np.append(POSITION_LIMITS[:, 0], 0.0)
        maximum = np.append(POSITION_LIMITS[:, 1], MAX_OPENING)
        return specs.BoundedArray((8,), np.float64, minimum, maximum, name=self.name)

    def reset(self, physics: mjcf.Physics, robot: Panda) -> None:
        """Start an episode."""
        joints, opening = robot.configuration(physics)
        self._action = np.append(joints, opening)

    def begin(self, physics: mjcf.Physics, robot: Panda, action: Float[np.ndarray, "8"]) -> None:
        """Take the action of this control step."""
        self._action = np.array(action)

    def targets(
        self, physics: mjcf.Physics, robot: Panda, share: float
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """The action itself."""
        return self._action[:7], float(self._action[7])

    def memory(self) -> Float[np.ndarray, "8"]:
        """The last action."""
        return self._action.copy()

    def remember(self, memory: Float[np.ndarray, "8"]) -> None:
        """Go on from a saved memory."""
        self._action = np.array(memory)


def checked_action(mode: str, shape: tuple[int, ...], action: object) -> Float[np.ndarray, "n"]:
    """The action as an array of the shape that the mode of this name takes.

    Raises:
      InputError: It has another shape, or a value that is no finite number.
    """
    try:
        array = np.asarray(action, float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != shape or not np.isfinite(array).all():
        raise InputError(
            f"action has shape {array.shape} and values {array.ravel()[:8].tolist()}; "
            f"{mode} expects {shape[0]} finite numbers"
        )
    return array
