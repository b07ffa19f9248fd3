"""What the control modes share: an action is the arm's part, then the gripper's opening."""

from __future__ import annotations

import abc

import numpy as np
from dm_control import mjcf
from dm_env import specs
from jaxtyping import Float

from manipose_mj.mjcf.panda import MAX_OPENING, POSITION_LIMITS, Panda


class ArmMode(abc.ABC):
    """A mode whose joint targets are a function of the action, the joints and its memory.

    The last number of an action is always the opening between the pads [m], 0 to 0.08; what lies
    beyond a limit counts as the limit, so ManiSkill's -1 and 1 shut and open the gripper here too.

    Attributes:
      name: As users write it.
      lower, upper: Limits of the arm's part of an action.
    """

    name: str
    lower: Float[np.ndarray, "n"]
    upper: Float[np.ndarray, "n"]

    def __init__(self) -> None:
        self._joints = np.zeros(7)
        self._opening = 0.0

    @abc.abstractmethod
    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "n"]
    ) -> Float[np.ndarray, "7"]:
        """Joint targets [rad] for the coming control step.

        Args:
          joints: Measured joint angles [rad].
          action: The arm's part, within its limits.
        """

    def spec(self) -> specs.BoundedArray:
        """Shape and limits of an action."""
        minimum, maximum = np.append(self.lower, 0.0), np.append(self.upper, MAX_OPENING)
        return specs.BoundedArray(minimum.shape, np.float64, minimum, maximum, name=self.name)

    def reset(self, physics: mjcf.Physics, robot: Panda) -> None:
        """Start an episode: the targets are where the robot is."""
        self._joints, self._opening = robot.configuration(physics)

    def begin(self, physics: mjcf.Physics, robot: Panda, action: Float[np.ndarray, "n"]) -> None:
        """Take the action of this control step."""
        arm = np.clip(action[:-1], self.lower, self.upper)
        self._opening = float(np.clip(action[-1], 0.0, MAX_OPENING))
        self._joints = within_limits(self.arm_targets(robot.configuration(physics)[0], arm))

    def targets(
        self, physics: mjcf.Physics, robot: Panda, share: float
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """The same targets during the whole control step."""
        return self._joints, self._opening

    @property
    def joint_targets(self) -> Float[np.ndarray, "7"]:
        """Where the last action sent the joints [rad]."""
        return self._joints.copy()

    def memory(self) -> Float[np.ndarray, "m"]:
        """Joint targets [rad], then the opening [m]."""
        return np.append(self._joints, self._opening)

    def remember(self, memory: Float[np.ndarray, "m"]) -> None:
        """Go on from a saved memory."""
        self._joints, self._opening = np.array(memory[:7]), float(memory[7])


def within_limits(joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "7"]:
    """The nearest angles [rad] that the joints can take."""
    return np.clip(joints, *POSITION_LIMITS.T)
