"""The Panda's servos in a compiled model and its data: where they are, and how they follow targets."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.mjcf.panda.speed_limits import allowed_set_points, most_motion


@dataclass(frozen=True)
class ServoAddresses:
    """Where the robot is in a compiled model.

    Attributes: arm, gripper, actuators; angles, fingers, in qpos; dofs, in qvel; tcp, the site.
    """

    arm: slice
    gripper: int
    angles: slice
    dofs: slice
    fingers: slice
    tcp: int


@dataclass(frozen=True)
class Servos:
    """The robot in a model and its data.

    Attributes: model; options, the model's; data; at, where the robot is; control, opening, joint_angles, views
    of the controls and angles in `data`; jacobian, room for the site's Jacobian.
    """

    model: mujoco.MjModel
    options: mujoco.MjOption
    data: mujoco.MjData
    at: ServoAddresses
    control: Float[np.ndarray, "7"]
    opening: Float[np.ndarray, "1"]
    joint_angles: Float[np.ndarray, "7"]
    jacobian: Float[np.ndarray, "3 nv"]

    @classmethod
    def of(cls, model: mujoco.MjModel, data: mujoco.MjData, at: ServoAddresses) -> Servos:
        """Of a model and its data, which it keeps views of."""
        return cls(
            model=model,
            options=model.opt,
            data=data,
            at=at,
            control=data.ctrl[at.arm],
            opening=data.ctrl[at.gripper : at.gripper + 1],
            joint_angles=data.qpos[at.angles],
            jacobian=np.zeros((3, model.nv)),
        )

    def follow(self, target: Float[np.ndarray, "8"]) -> None:
        """Applies joint angles [rad] and an opening [m], but no faster than joints and TCP may move.

        To be called before every physics step. The servos of a real Panda refuse set-points that jump; here
        they follow, as fast as is allowed. Nor do they run away from an arm that is stopped or falls behind:
        it would be flung after them, at several times its limits, as soon as it could move again.
        """
        most = most_motion(self.options.timestep)
        self.control[:] = allowed_set_points(
            target[:7], self.control, self.joint_angles, self.tcp_jacobian, most
        )
        self.opening[0] = min(max(float(target[7]), 0.0), MAX_OPENING)

    def lag(self) -> Float[np.ndarray, "7"]:
        """Damping over stiffness of the joints' servos [s]."""
        bias = self.model.actuator_biasprm[self.at.arm]
        return bias[:, 2] / bias[:, 1]

    def tcp_jacobian(self) -> Float[np.ndarray, "3 7"]:
        """Of the TCP's position by the arm's joints [m/rad]; overwritten by the next call."""
        mujoco.mj_jacSite(self.model, self.data, self.jacobian, None, self.at.tcp)
        return self.jacobian[:, self.at.dofs]
