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
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from manipose_mj.actions.control_law import Arm, ControlLaw, Memory
from manipose_mj.mjcf.panda.kinematics import VELOCITY_LIMITS
from manipose_mj.poses import Array, compose, namespace

STEP = 0.1  # of the TCP, for an action of 1 [m]
TURN = 0.1  # of the hand, for an action of length 1 [rad]
# Nothing of the arm gets further from its base along any axis [m].
_REACH = 1.3
# Of the joints' velocity limits, at which targets go to an absolute pose.
_SPEED = 0.5
# Further from a pose than this the arm counts as unable to take it [m].
_UNREACHED = 1e-3


class TcpPose(ControlLaw):
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
    moves_tcp = True

    def command(self, memory: Memory, action: Float[Array, "6"], arm: Arm) -> Memory:
        """From the last targets, so that an action that is repeated changes nothing."""
        pose = compose(euler_rotation(action[3:]), action[:3])
        return memory._replace(goal=arm.tcp.reach(pose, memory.joints)[0])

    def targets(self, memory: Memory, timestep: float) -> tuple[Float[Array, "7"], Memory]:
        """On the straight line between the configurations, by one physics step."""
        xp = namespace(memory.joints)
        missing = memory.goal - memory.joints
        needed = xp.max(xp.abs(missing) / (_SPEED * VELOCITY_LIMITS), axis=-1, keepdims=True)
        share = xp.minimum(1.0, timestep / xp.maximum(needed, 1e-12))
        return super().targets(memory._replace(joints=memory.joints + missing * share), timestep)


class TcpDelta(ControlLaw):
    """`pd_ee_delta_pose`: x, y, z in tenths of a metre and Euler angles XYZ in tenths of a radian,
    from the measured pose of the TCP."""

    name = "pd_ee_delta_pose"
    lower, upper = -np.ones(6), np.ones(6)
    moves_tcp = True

    def command(self, memory: Memory, action: Float[Array, "n"], arm: Arm) -> Memory:
        """From the measured joints."""
        pose = moved(arm.tcp.pose(arm.joints), action)
        return memory._replace(joints=arm.tcp.reach(pose, arm.joints)[0])


class TcpPositionDelta(TcpDelta):
    """`pd_ee_delta_pos`: x, y, z in tenths of a metre from where the TCP is; the hand does not turn."""

    name = "pd_ee_delta_pos"
    lower, upper = -np.ones(3), np.ones(3)


class TcpTargetDelta(TcpDelta):
    """`pd_ee_target_delta_pose`: as `pd_ee_delta_pose`, from the last target pose."""

    name = "pd_ee_target_delta_pose"

    def start(self, opening: Float[Array, ""], arm: Arm) -> Memory:
        """The target is where the TCP is."""
        return super().start(opening, arm)._replace(pose=arm.tcp.pose(arm.joints))

    def command(self, memory: Memory, action: Float[Array, "n"], arm: Arm) -> Memory:
        """From the last targets; where the arm stops, so does the target pose."""
        pose = moved(memory.pose, action)
        joints, error = arm.tcp.reach(pose, memory.joints)
        kept = namespace(joints).where(error < _UNREACHED, pose, arm.tcp.pose(joints))
        return memory._replace(joints=joints, pose=kept)


class TcpTargetPositionDelta(TcpTargetDelta):
    """`pd_ee_target_delta_pos`: as `pd_ee_delta_pos`, from the last target pose."""

    name = "pd_ee_target_delta_pos"
    lower, upper = -np.ones(3), np.ones(3)


def moved(pose: Float[Array, "4 4"], action: Float[Array, "n"]) -> Float[Array, "4 4"]:
    """A pose after a delta action of 3 or 6 numbers, from -1 to 1."""
    xp = namespace(pose)
    position, rotation = pose[:3, 3] + STEP * action[:3], pose[:3, :3]
    angles = action[3:]
    if angles.size:
        scale = xp.maximum(1.0, xp.sqrt(xp.vecdot(angles, angles)))
        turned = euler_rotation(TURN * angles / scale) @ rotation
        rotation = xp.where(xp.any(angles != 0), turned, rotation)
    return compose(rotation, position)


def euler_rotation(angles: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """`Rx Ry Rz` of three angles [rad]."""
    xp = namespace(angles)
    if xp is np:
        return Rotation.from_euler("XYZ", angles).as_matrix()
    (sx, sy, sz), (cx, cy, cz) = xp.sin(angles), xp.cos(angles)
    rows = [
        [cy * cz, -cy * sz, sy],
        [cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy],
        [sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy],
    ]
    return xp.stack([xp.stack(row) for row in rows])


def euler_angles(rotation: Float[Array, "*b 3 3"]) -> Float[Array, "*b 3"]:
    """The inverse of `euler_rotation`; where the second angle is a right one, the third is zero."""
    xp, r = namespace(rotation), rotation
    across = xp.hypot(r[..., 0, 0], r[..., 0, 1])
    second = xp.atan2(r[..., 0, 2], across)
    # Single precision tells no angles from what is smaller.
    singular = across < (1e-9 if r.dtype == np.float64 else 1e-6)
    first = xp.where(
        singular, xp.atan2(r[..., 2, 1], r[..., 1, 1]), xp.atan2(-r[..., 1, 2], r[..., 2, 2])
    )
    third = xp.where(singular, xp.zeros_like(across), xp.atan2(-r[..., 0, 1], r[..., 0, 0]))
    return xp.stack([first, second, third], axis=-1)
