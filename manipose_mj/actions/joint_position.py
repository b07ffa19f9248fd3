"""Modes that say where the joints shall be, or by how much their targets shall change.

Limits and meaning of differences are those of ManiSkill 3's Panda
(`mani_skill/agents/robots/panda/panda.py`, `controllers/pd_joint_pos.py`): an action of 1 is 0.1 rad.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.actions.control_law import Arm, ControlLaw, Memory
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.poses import Array

DELTA = 0.1  # of a joint, for an action of 1 [rad]


class JointPositions(ControlLaw):
    """`pd_joint_pos`: seven joint targets [rad] and the gripper's opening [m]."""

    name = "pd_joint_pos"
    lower, upper = POSITION_LIMITS.T

    def begin(self, memory: Memory, action: Float[Array, "*b 8"], arm: Arm) -> Memory:
        """The action itself; limits are left to the robot."""
        return self.command(memory._replace(opening=action[..., 7]), action[..., :7], arm)

    def command(self, memory: Memory, action: Float[Array, "*b 7"], arm: Arm) -> Memory:
        """The action itself."""
        return memory._replace(joints=action)


class JointDelta(ControlLaw):
    """`pd_joint_delta_pos`: seven differences, in tenths of a radian, to the measured angles.

    As in ManiSkill, an arm that a load holds back starts every step from where the load has put it.
    """

    name = "pd_joint_delta_pos"
    lower, upper = -np.ones(7), np.ones(7)

    def command(self, memory: Memory, action: Float[Array, "*b 7"], arm: Arm) -> Memory:
        """From the measured angles."""
        return memory._replace(joints=arm.joints + DELTA * action)


class JointTargetDelta(ControlLaw):
    """`pd_joint_target_delta_pos`: seven differences, in tenths of a radian, to the last targets.

    Unlike ManiSkill's, targets stop at the joint limits, so that none runs away behind one.
    """

    name = "pd_joint_target_delta_pos"
    lower, upper = -np.ones(7), np.ones(7)

    def command(self, memory: Memory, action: Float[Array, "*b 7"], arm: Arm) -> Memory:
        """From the last targets."""
        return memory._replace(joints=memory.joints + DELTA * action)
