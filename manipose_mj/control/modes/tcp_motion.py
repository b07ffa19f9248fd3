"""Modes that move the tool centre point (TCP), in the robot's base frame.

Limits and meaning are those of ManiSkill 3's Panda (`controllers/pd_ee_pose.py`, frame
`root_translation:root_aligned_body_rotation`): an action of 1 is 0.1 m along an axis of the base, or
0.1 rad about one, the turn's length limited rather than each of its numbers; angles are Euler angles
XYZ, `R = Rx Ry Rz`. Where ours differ:

- A positive angle turns the hand the positive way. ManiSkill scales the turn by its lower limit, which
  is negative, and so turns the other way (its issue 1469).
- A pose out of reach is approached as near as the joint limits allow; ManiSkill stays where it is.
- Target poses stop where the arm does, so that none runs away.
"""

from __future__ import annotations

import numpy as np
from dm_control import mjcf
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from manipose_mj.control.modes.arm_mode import ArmMode
from manipose_mj.control.modes.tcp_solver import TcpSolver
from manipose_mj.mjcf.panda import VELOCITY_LIMITS, Panda
from manipose_mj.poses import compose

STEP = 0.1  # of the TCP, for an action of 1 [m]
TURN = 0.1  # of the hand, for an action of length 1 [rad]
# Nothing of the arm gets further from its base along any axis [m].
_REACH = 1.3
# Of the joints' velocity limits, at which targets go to an absolute pose.
_SPEED = 0.5
# Further from a pose than this the arm counts as unable to take it [m].
_UNREACHED = 1e-3


class TcpPose(ArmMode):
    """`pd_ee_pose`: `T_base_tcp` as x, y, z [m] and Euler angles XYZ [rad].

    The joint targets go straight to the nearest configuration that has this pose, at half the joints'
    top speed at most; ManiSkill's jump there, which throws the arm about.

    Euler angles, because ManiSkill 3 has them here and because they have finite limits. Their
    singularity, a second angle of a right angle, is far from a hand that points down (pi, 0, yaw);
    and a pose at it is still a pose: nothing is integrated.
    """

    name = "pd_ee_pose"
    lower = np.array([-_REACH] * 3 + [-np.pi] * 3)
    upper = np.array([_REACH] * 3 + [np.pi] * 3)

    def __init__(self) -> None:
        super().__init__()
        self.solver = TcpSolver()
        self._goal = np.zeros(7)

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "6"]
    ) -> Float[np.ndarray, "7"]:
        """From the last targets, so that an action that is repeated changes nothing."""
        pose = compose(euler_rotation(action[3:]), action[:3])
        self._goal, _ = self.solver.reach(pose, self._joints)
        return self._joints

    def targets(
        self, physics: mjcf.Physics, robot: Panda, share: float
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """On the straight way of the joints, by one physics step."""
        way = self._goal - self._joints
        needed = float(np.max(np.abs(way) / (_SPEED * VELOCITY_LIMITS)))
        self._joints = self._joints + way * min(1.0, physics.timestep() / max(needed, 1e-12))
        return super().targets(physics, robot, share)


class TcpDelta(ArmMode):
    """`pd_ee_delta_pose`: x, y, z in tenths of a metre and Euler angles XYZ in tenths of a radian,
    from the measured pose of the TCP."""

    name = "pd_ee_delta_pose"
    lower, upper = -np.ones(6), np.ones(6)

    def __init__(self) -> None:
        super().__init__()
        self.solver = TcpSolver()

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "n"]
    ) -> Float[np.ndarray, "7"]:
        """From the measured joints."""
        return self.solver.reach(moved(self.solver.pose(joints), action), joints)[0]


class TcpPositionDelta(TcpDelta):
    """`pd_ee_delta_pos`: x, y, z in tenths of a metre from where the TCP is; the hand does not turn."""

    name = "pd_ee_delta_pos"
    lower, upper = -np.ones(3), np.ones(3)


class TcpTargetDelta(TcpDelta):
    """`pd_ee_target_delta_pose`: as `pd_ee_delta_pose`, from the last target pose."""

    name = "pd_ee_target_delta_pose"

    def __init__(self) -> None:
        super().__init__()
        self._pose = np.eye(4)

    @property
    def target_pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_base_tcp` that the last action asked for."""
        return self._pose.copy()

    def reset(self, physics: mjcf.Physics, robot: Panda) -> None:
        """Start an episode: the target is where the TCP is."""
        super().reset(physics, robot)
        self._pose = self.solver.pose(self._joints)

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "n"]
    ) -> Float[np.ndarray, "7"]:
        """From the last targets."""
        pose = moved(self._pose, action)
        targets, left = self.solver.reach(pose, self._joints)
        self._pose = pose if left < _UNREACHED else self.solver.pose(targets)
        return targets

    def memory(self) -> Float[np.ndarray, "20"]:
        """Joint targets [rad], the opening [m], and three rows of the target pose."""
        return np.append(super().memory(), self._pose[:3])

    def remember(self, memory: Float[np.ndarray, "20"]) -> None:
        """Go on from a saved memory."""
        super().remember(memory)
        self._pose = np.vstack([np.reshape(memory[8:], (3, 4)), [0.0, 0.0, 0.0, 1.0]])


class TcpTargetPositionDelta(TcpTargetDelta):
    """`pd_ee_target_delta_pos`: as `pd_ee_delta_pos`, from the last target pose."""

    name = "pd_ee_target_delta_pos"
    lower, upper = -np.ones(3), np.ones(3)


def moved(
    pose: Float[np.ndarray, "4 4"], action: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "4 4"]:
    """A pose after a delta action of 3 or 6 numbers, from -1 to 1."""
    result = pose.copy()
    result[:3, 3] += STEP * action[:3]
    angles = action[3:]
    if angles.any():
        angles = TURN * angles / max(1.0, float(np.linalg.norm(angles)))
        result[:3, :3] = euler_rotation(angles) @ pose[:3, :3]
    return result


def euler_rotation(angles: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """`Rx Ry Rz` of three angles [rad]."""
    return Rotation.from_euler("XYZ", angles).as_matrix()


def euler_angles(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3"]:
    """The inverse of `euler_rotation`; where the second angle is a right one, the third is zero."""
    r = rotation
    across = float(np.hypot(r[0, 0], r[0, 1]))
    second = np.arctan2(r[0, 2], across)
    if across < 1e-9:
        return np.array([np.arctan2(r[2, 1], r[1, 1]), second, 0.0])
    return np.array([np.arctan2(-r[1, 2], r[2, 2]), second, np.arctan2(-r[0, 1], r[0, 0])])
