"""Which action of a mode sends the servos where they should go: control modes read backwards."""

from __future__ import annotations

from functools import singledispatch

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.control.modes.joint_position import DELTA, JointDelta, JointTargetDelta
from manipose_mj.control.modes.joint_velocity import (
    JointDeltaVelocity,
    JointPositionVelocity,
    JointVelocity,
    servo_lag,
)
from manipose_mj.control.modes.tcp_motion import (
    STEP,
    TURN,
    TcpDelta,
    TcpPose,
    TcpTargetDelta,
    euler_angles,
)
from manipose_mj.mjcf.panda import MAX_OPENING, Panda
from manipose_mj.tasks.action_mode import ActionMode, JointPositions

_LOCKED = np.zeros(7)  # velocities


@singledispatch
def arm_action(
    mode: ActionMode,
    physics: mjcf.Physics,
    robot: Panda,
    joints: Float[np.ndarray, "7"],
    timestep: float,
) -> Float[np.ndarray, "n"]:
    """The arm's part of the action that sends the joints to these angles, whatever its limits.

    Modes that move the TCP send it where these angles would have it.

    Args:
      mode: As it is before the action.
      physics: The scene's, as it is before the action.
      robot: In it.
      joints: Joint targets [rad].
      timestep: Control step [s].
    """
    raise TypeError(f"no way back is known for control mode {mode.name}")


def action_towards(
    mode: ActionMode,
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
    arm = arm_action(mode, physics, robot, joints, timestep)
    spec = mode.spec()
    limited = _shortened(mode, arm, spec.minimum[:-1], spec.maximum[:-1])
    action = np.append(limited, np.clip(opening, 0.0, MAX_OPENING))
    return action, bool(np.abs(limited - arm).max() < 1e-6)


def _shortened(
    mode: ActionMode,
    arm: Float[np.ndarray, "n"],
    lower: Float[np.ndarray, "n"],
    upper: Float[np.ndarray, "n"],
) -> Float[np.ndarray, "n"]:
    """The action within its limits, in the same direction where it is a difference."""
    if isinstance(mode, TcpDelta):
        # Position and turn go on together, so that the hand keeps to its path.
        excess = max(float(np.abs(arm[:3]).max()), float(np.linalg.norm(arm[3:])))
        return arm / max(1.0, excess)
    if isinstance(mode, (JointDelta, JointTargetDelta, JointVelocity)):
        return arm / max(1.0, float(np.abs(arm).max()))
    return np.clip(arm, lower, upper)


@arm_action.register
def _(mode: JointPositions, physics, robot, joints, timestep) -> Float[np.ndarray, "7"]:
    return joints


@arm_action.register
def _(mode: JointDelta, physics, robot, joints, timestep) -> Float[np.ndarray, "7"]:
    return (joints - robot.configuration(physics)[0]) / DELTA


@arm_action.register
def _(mode: JointTargetDelta, physics, robot, joints, timestep) -> Float[np.ndarray, "7"]:
    return (joints - mode.joint_targets) / DELTA


@arm_action.register
def _(mode: JointPositionVelocity, physics, robot, joints, timestep) -> Float[np.ndarray, "14"]:
    return np.concatenate([joints, _LOCKED])


@arm_action.register
def _(mode: JointDeltaVelocity, physics, robot, joints, timestep) -> Float[np.ndarray, "14"]:
    return np.concatenate([(joints - robot.configuration(physics)[0]) / DELTA, _LOCKED])


@arm_action.register
def _(mode: JointVelocity, physics, robot, joints, timestep) -> Float[np.ndarray, "7"]:
    # At the end of the step the servos are sent the target and the velocity's lead on it.
    return (joints - mode.joint_targets) / (timestep + servo_lag(physics, robot))


@arm_action.register
def _(mode: TcpPose, physics, robot, joints, timestep) -> Float[np.ndarray, "6"]:
    pose = mode.solver.pose(joints)
    return np.concatenate([pose[:3, 3], euler_angles(pose[:3, :3])])


@arm_action.register
def _(mode: TcpDelta, physics, robot, joints, timestep) -> Float[np.ndarray, "n"]:
    here = mode.solver.pose(robot.configuration(physics)[0])
    return _difference(mode, here, joints)


@arm_action.register
def _(mode: TcpTargetDelta, physics, robot, joints, timestep) -> Float[np.ndarray, "n"]:
    return _difference(mode, mode.target_pose, joints)


def _difference(
    mode: TcpDelta, here: Float[np.ndarray, "4 4"], joints: Float[np.ndarray, "7"]
) -> Float[np.ndarray, "n"]:
    goal = mode.solver.pose(joints)
    turn = euler_angles(goal[:3, :3] @ here[:3, :3].T)
    both = np.concatenate([(goal[:3, 3] - here[:3, 3]) / STEP, turn / TURN])
    return both[: len(mode.lower)]
