"""Which action of a mode sends the servos where they should go: control modes read backwards."""

from __future__ import annotations

from functools import singledispatch

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.actions.control_law import Arm, ControlLaw, Kinematics, Memory
from manipose_mj.actions.control_mode import ControlMode
from manipose_mj.actions.joint_position import DELTA, JointDelta, JointPositions, JointTargetDelta
from manipose_mj.actions.joint_velocity import (
    JointDeltaVelocity,
    JointPositionVelocity,
    JointVelocity,
)
from manipose_mj.actions.tcp_motion import (
    STEP,
    TURN,
    TcpDelta,
    TcpPose,
    TcpTargetDelta,
    euler_angles,
)
from manipose_mj.mjcf.panda.robot import MAX_OPENING, Panda

_LOCKED = np.zeros(7)  # velocities


@singledispatch
def arm_action(
    law: ControlLaw, memory: Memory, arm: Arm, joints: Float[np.ndarray, "7"], timestep: float
) -> Float[np.ndarray, "n"]:
    """The arm's part of the action that sends the joints to these angles, whatever its limits.

    Laws that move the TCP send it where these angles would have it.

    Args:
      law: That the action is for.
      memory: As it is before the action.
      arm: As it is before the action.
      joints: Joint targets [rad].
      timestep: Control step [s].
    """
    raise TypeError(f"no way back is known for control mode {law.name}")


def action_towards(
    mode: ControlMode,
    physics: mjcf.Physics,
    robot: Panda,
    joints: Float[np.ndarray, "7"],
    opening: float,
    timestep: float,
) -> tuple[Float[np.ndarray, "n"], bool]:
    """The action within the mode's limits that goes furthest towards joint targets and an opening.

    Args:
      mode: As it is before the action.
      physics: The scene's, as it is before the action.
      robot: In it.
      joints: Joint targets [rad].
      opening: Between the pads [m].
      timestep: Control step [s].

    Returns:
      The action, and whether it goes all the way.
    """
    law = mode.law
    free = arm_action(law, mode.remembered, mode.arm(physics, robot), joints, timestep)
    limited = _shortened(law, free)
    action = np.append(limited, np.clip(opening, 0.0, MAX_OPENING))
    return action, bool(np.abs(limited - free).max() < 1e-6)


def _shortened(law: ControlLaw, action: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """The action within its limits, in the same direction where it is a difference."""
    if isinstance(law, TcpDelta):
        # Position and turn go on together, so that the hand keeps to its path.
        excess = max(float(np.abs(action[:3]).max()), float(np.linalg.norm(action[3:])))
        return action / max(1.0, excess)
    if isinstance(law, (JointDelta, JointTargetDelta, JointVelocity)):
        return action / max(1.0, float(np.abs(action).max()))
    return np.clip(action, law.lower, law.upper)


@arm_action.register
def _(law: JointPositions, memory, arm, joints, timestep) -> Float[np.ndarray, "7"]:
    return joints


@arm_action.register
def _(law: JointDelta, memory, arm, joints, timestep) -> Float[np.ndarray, "7"]:
    return (joints - arm.joints) / DELTA


@arm_action.register
def _(law: JointTargetDelta, memory, arm, joints, timestep) -> Float[np.ndarray, "7"]:
    return (joints - memory.joints) / DELTA


@arm_action.register
def _(law: JointPositionVelocity, memory, arm, joints, timestep) -> Float[np.ndarray, "14"]:
    return np.concatenate([joints, _LOCKED])


@arm_action.register
def _(law: JointDeltaVelocity, memory, arm, joints, timestep) -> Float[np.ndarray, "14"]:
    return np.concatenate([(joints - arm.joints) / DELTA, _LOCKED])


@arm_action.register
def _(law: JointVelocity, memory, arm, joints, timestep) -> Float[np.ndarray, "7"]:
    # At the end of the step the servos are sent the target and the velocity's lead on it.
    return (joints - law.departure(memory, arm)) / (timestep + arm.servo_lag)


@arm_action.register
def _(law: TcpPose, memory, arm, joints, timestep) -> Float[np.ndarray, "6"]:
    pose = arm.tcp.pose(joints)
    return np.concatenate([pose[:3, 3], euler_angles(pose[:3, :3])])


@arm_action.register
def _(law: TcpDelta, memory, arm, joints, timestep) -> Float[np.ndarray, "n"]:
    return _difference(law, arm.tcp, arm.tcp.pose(arm.joints), joints)


@arm_action.register
def _(law: TcpTargetDelta, memory, arm, joints, timestep) -> Float[np.ndarray, "n"]:
    return _difference(law, arm.tcp, memory.pose, joints)


def _difference(
    law: TcpDelta,
    kinematics: Kinematics,
    here: Float[np.ndarray, "4 4"],
    joints: Float[np.ndarray, "7"],
) -> Float[np.ndarray, "n"]:
    goal = kinematics.pose(joints)
    turn = euler_angles(goal[:3, :3] @ here[:3, :3].T)
    both = np.concatenate([(goal[:3, 3] - here[:3, 3]) / STEP, turn / TURN])
    return both[: len(law.lower)]
