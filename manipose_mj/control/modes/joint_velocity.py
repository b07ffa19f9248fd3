"""Modes with joint velocities, on the position servos that every mode uses.

ManiSkill 3's drives (`controllers/pd_joint_vel.py`, `pd_joint_pos_vel.py`) push with
`k (q* - q) + d (v* - v)`, and set k to zero for `pd_joint_vel`. A mode here changes no gain: a servo
that is sent `q* + (d / k) v*` pushes exactly as hard as a drive with both targets, once it has got
there: in every mode what servos are sent moves no faster than the joints can.
"""

from __future__ import annotations

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.control.modes.arm_mode import ArmMode, within_limits
from manipose_mj.control.modes.joint_position import DELTA
from manipose_mj.mjcf.panda import POSITION_LIMITS, Panda

MAX_SPEED = 1.0  # [rad/s]
# The servos give all their torque long before a target is this far ahead of its joint [rad].
_MAX_LEAD = 0.05


def servo_lag(physics: mjcf.Physics, robot: Panda) -> Float[np.ndarray, "7"]:
    """Damping over stiffness of the joints' servos [s]."""
    bias = np.asarray(physics.bind(robot.actuators).biasprm)
    return bias[:, 2] / bias[:, 1]


class JointPositionVelocity(ArmMode):
    """`pd_joint_pos_vel`: seven joint targets [rad], then seven velocity targets [rad/s], up to 1."""

    name = "pd_joint_pos_vel"
    lower = np.append(POSITION_LIMITS[:, 0], np.full(7, -MAX_SPEED))
    upper = np.append(POSITION_LIMITS[:, 1], np.full(7, MAX_SPEED))

    def __init__(self) -> None:
        super().__init__()
        self._lead = np.zeros(7)

    def reset(self, physics: mjcf.Physics, robot: Panda) -> None:
        """Start an episode, at rest."""
        super().reset(physics, robot)
        self._lead = np.zeros(7)

    def begin(self, physics: mjcf.Physics, robot: Panda, action: Float[np.ndarray, "n"]) -> None:
        """Take the action of this control step."""
        super().begin(physics, robot, action)
        velocity = np.clip(action[-8:-1], self.lower[-7:], self.upper[-7:])
        self._lead = servo_lag(physics, robot) * velocity

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "14"]
    ) -> Float[np.ndarray, "7"]:
        """The first seven."""
        return action[:7]

    def targets(
        self, physics: mjcf.Physics, robot: Panda, share: float
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """What makes a position servo push as one with both targets."""
        return self._joints + self._lead, self._opening

    def memory(self) -> Float[np.ndarray, "15"]:
        """Joint targets [rad], the opening [m], and what velocities add to the targets [rad]."""
        return np.append(super().memory(), self._lead)

    def remember(self, memory: Float[np.ndarray, "15"]) -> None:
        """Go on from a saved memory."""
        super().remember(memory)
        self._lead = np.array(memory[8:])


class JointDeltaVelocity(JointPositionVelocity):
    """`pd_joint_delta_pos_vel`: differences to the measured angles, in tenths of a radian, then seven
    velocity targets [rad/s]; all from -1 to 1."""

    name = "pd_joint_delta_pos_vel"
    lower, upper = -np.ones(14), np.ones(14)

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "14"]
    ) -> Float[np.ndarray, "7"]:
        """From the measured angles."""
        return joints + DELTA * action[:7]


class JointVelocity(JointPositionVelocity):
    """`pd_joint_vel`: seven joint velocities [rad/s], from -1 to 1.

    The joint targets move at this velocity in every physics step, and the servos damp the
    difference to it. ManiSkill's drive has no stiffness: there an arm at velocity zero gives way to
    a load, here it stays. A target that the arm cannot follow waits 0.05 rad ahead of it.
    """

    name = "pd_joint_vel"
    lower, upper = np.full(7, -MAX_SPEED), np.full(7, MAX_SPEED)

    def __init__(self) -> None:
        super().__init__()
        self._velocity = np.zeros(7)

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "7"]
    ) -> Float[np.ndarray, "7"]:
        """Where the targets are before they move on."""
        self._velocity = action
        return np.clip(self._joints, joints - _MAX_LEAD, joints + _MAX_LEAD)

    def targets(
        self, physics: mjcf.Physics, robot: Panda, share: float
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """Moved on by one physics step."""
        self._joints = within_limits(self._joints + physics.timestep() * self._velocity)
        return super().targets(physics, robot, share)
