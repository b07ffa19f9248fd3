"""Modes that move the joint targets by a difference; `pd_joint_pos` itself is the tasks' default.

Limits and meaning are those of ManiSkill 3's Panda (`mani_skill/agents/robots/panda/panda.py`,
`controllers/pd_joint_pos.py`): an action of 1 is 0.1 rad.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.modes.arm_mode import ArmMode

DELTA = 0.1  # of a joint, for an action of 1 [rad]


class JointDelta(ArmMode):
    """`pd_joint_delta_pos`: seven differences, in tenths of a radian, to the measured angles.

    As in ManiSkill, an arm that a load holds back starts every step from where the load has put it.
    """

    name = "pd_joint_delta_pos"
    lower, upper = -np.ones(7), np.ones(7)

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "7"]
    ) -> Float[np.ndarray, "7"]:
        """From the measured angles."""
        return joints + DELTA * action


class JointTargetDelta(ArmMode):
    """`pd_joint_target_delta_pos`: seven differences, in tenths of a radian, to the last targets.

    Unlike ManiSkill's, targets stop at the joint limits, so that none runs away behind one.
    """

    name = "pd_joint_target_delta_pos"
    lower, upper = -np.ones(7), np.ones(7)

    def arm_targets(
        self, joints: Float[np.ndarray, "7"], action: Float[np.ndarray, "7"]
    ) -> Float[np.ndarray, "7"]:
        """From the last targets."""
        return self._joints + DELTA * action
