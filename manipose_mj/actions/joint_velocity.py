"""Modes with joint velocities, on the position servos that every mode uses.

ManiSkill 3's drives (`controllers/pd_joint_vel.py`, `pd_joint_pos_vel.py`) push with
`k (q* - q) + d (v* - v)`, and set k to zero for `pd_joint_vel`. A mode here changes no gain: a servo
that is sent `q* + (d / k) v*` pushes exactly as hard as a drive with both targets, once it has got
there: in every mode what servos are sent moves no faster than the joints can.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.actions.control_law import Arm, ControlLaw, Memory, within_limits
from manipose_mj.actions.joint_position import DELTA
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.poses import Array, namespace

MAX_SPEED = 1.0  # [rad/s]
# The servos give all their torque long before a target is this far ahead of its joint [rad].
_MAX_LEAD = 0.05


class JointPositionVelocity(ControlLaw):
    """`pd_joint_pos_vel`: seven joint targets [rad], then seven velocity targets [rad/s], up to 1."""

    name = "pd_joint_pos_vel"
    lower = np.append(POSITION_LIMITS[:, 0], np.full(7, -MAX_SPEED))
    upper = np.append(POSITION_LIMITS[:, 1], np.full(7, MAX_SPEED))
    sets_velocities = True

    def command(self, memory: Memory, action: Float[Array, "*b 14"], arm: Arm) -> Memory:
        """Both as they are."""
        return memory._replace(joints=action[..., :7], lead=arm.servo_lag * action[..., 7:])

    def targets(self, memory: Memory, timestep: float) -> tuple[Float[Array, "*b 7"], Memory]:
        """What makes a position servo push as one with both targets."""
        return memory.joints + memory.lead, memory


class JointDeltaVelocity(JointPositionVelocity):
    """`pd_joint_delta_pos_vel`: differences to the measured angles, in tenths of a radian, then seven
    velocity targets [rad/s]; all from -1 to 1."""

    name = "pd_joint_delta_pos_vel"
    lower, upper = -np.ones(14), np.ones(14)

    def command(self, memory: Memory, action: Float[Array, "*b 14"], arm: Arm) -> Memory:
        """From the measured angles."""
        joints = arm.joints + DELTA * action[..., :7]
        return memory._replace(joints=joints, lead=arm.servo_lag * action[..., 7:])


class JointVelocity(JointPositionVelocity):
    """`pd_joint_vel`: seven joint velocities [rad/s], from -1 to 1.

    The joint targets move at this velocity in every physics step, and the servos damp the
    difference to it. ManiSkill's drive has no stiffness: there an arm at velocity zero gives way to
    a load, here it stays. A target that the arm cannot follow waits 0.05 rad ahead of it.
    """

    name = "pd_joint_vel"
    lower, upper = np.full(7, -MAX_SPEED), np.full(7, MAX_SPEED)

    def command(self, memory: Memory, action: Float[Array, "*b 7"], arm: Arm) -> Memory:
        """Where the targets are before they move on."""
        joints = self.departure(memory, arm)
        return memory._replace(joints=joints, velocity=action, lead=arm.servo_lag * action)

    def departure(self, memory: Memory, arm: Arm) -> Float[Array, "*b 7"]:
        """The targets [rad] that the next step starts from: those before, no farther ahead than they wait."""
        xp = namespace(memory.joints)
        return xp.clip(memory.joints, arm.joints - _MAX_LEAD, arm.joints + _MAX_LEAD)

    def targets(self, memory: Memory, timestep: float) -> tuple[Float[Array, "*b 7"], Memory]:
        """Moved on by one physics step."""
        joints = within_limits(memory.joints + timestep * memory.velocity)
        return super().targets(memory._replace(joints=joints), timestep)
