"""The Panda's servos in a compiled model and its data: where they are, and how they follow targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda.speed_limits import (
    JOINT_LEADS,
    TCP_LEAD,
    allowed_set_points,
    most_motion,
    tcp_motion_change,
    tcp_surely_slow,
)

_LOWEST, _HIGHEST = POSITION_LIMITS.T.copy()


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


class ServoGroup:
    """Many robots whose servos follow together, whose physics have the same time step."""

    def __init__(self, servos: Sequence[Servos]) -> None:
        """Keeps views of the robots' data and room for what every step computes."""
        self._servos = tuple(servos)
        self._angle_views = [each.joint_angles for each in servos]
        self._controls = [each.control for each in servos]
        self._sites = [(each.model, each.data, each.jacobian, None, each.at.tcp) for each in servos]
        self._arms = [each.jacobian[:, each.at.dofs] for each in servos]
        self._most = most_motion(servos[0].options.timestep)
        count = len(self._servos)
        self._sent, self._openings = np.empty((count, 7)), np.empty(count)
        # Room; the rows are views that are made once.
        self._joints, self._allowed, self._leads = (np.empty((count, 7)) for _ in range(3))
        self._low, self._high = np.empty((count, 7)), np.empty((count, 7))
        self._allowed_rows, self._lead_rows = list(self._allowed), list(self._leads)
        # Of the TCP, as last asked for, and the joints then.
        self._jacobians, self._bent = np.zeros((count, 3, 7)), np.full((count, 7), np.inf)

    def read_set_points(self) -> None:
        """Where the servos have been sent, as the data say; to be called after others have written there."""
        np.concatenate(self._controls, out=self._sent.reshape(-1))
        self._openings[:] = [each.opening[0] for each in self._servos]

    def follow(self, targets: Float[np.ndarray, "worlds 8"]) -> None:
        """What `Servos.follow` does, bit for bit, for all."""
        joints, allowed = self._joints, self._allowed
        np.concatenate(self._angle_views, out=joints.reshape(-1))
        self._allow(targets[:, :7])
        leads = np.subtract(allowed, joints, out=self._leads)
        slow = tcp_surely_slow(leads)
        if not slow.all():
            slow |= self._still_slow(leads)
            self._slow_down(np.flatnonzero(~slow))
        np.maximum(allowed, _LOWEST, out=allowed)
        np.minimum(allowed, _HIGHEST, out=allowed)
        controls, rows = self._controls, self._allowed_rows
        for i in np.flatnonzero((allowed != self._sent).any(axis=1)).tolist():
            controls[i][:] = rows[i]
        self._sent[:] = allowed
        openings = np.clip(targets[:, 7], 0.0, MAX_OPENING)
        for i in np.flatnonzero(openings != self._openings).tolist():
            self._servos[i].opening[0] = openings[i]
        self._openings = openings

    def _allow(self, targets: Float[np.ndarray, "worlds 7"]) -> None:
        """`allowed_for_joints`, without an array that is new."""
        joints, allowed, low, high = self._joints, self._allowed, self._low, self._high
        np.subtract(self._sent, self._most, out=low)
        np.add(self._sent, self._most, out=high)
        np.maximum(targets, low, out=allowed)
        np.minimum(allowed, high, out=allowed)
        np.subtract(joints, JOINT_LEADS, out=low)
        np.add(joints, JOINT_LEADS, out=high)
        np.maximum(allowed, low, out=allowed)
        np.minimum(allowed, high, out=allowed)

    def _still_slow(self, leads: Float[np.ndarray, "worlds 7"]) -> Bool[np.ndarray, " worlds"]:
        """Whose TCP is slow by the Jacobian as last asked for, however the joints have turned it since."""
        motion = (self._jacobians @ leads[..., None])[..., 0]
        length = np.sqrt(np.einsum("ni,ni->n", motion, motion))
        with np.errstate(invalid="ignore"):
            return length + tcp_motion_change(leads, self._joints - self._bent) < 0.999 * TCP_LEAD

    def _slow_down(self, which: Int[np.ndarray, " some"]) -> None:
        """As `allowed_set_points` does, where these robots' TCP would move too fast."""
        chosen = which.tolist()
        if not chosen:
            return
        lengths = []
        for i in chosen:
            mujoco.mj_jacSite(*self._sites[i])
            # One by one, since a product of many has other bits.
            motion = self._arms[i].dot(self._lead_rows[i])
            lengths.append(motion.dot(motion))
            self._jacobians[i] = self._arms[i]
        self._bent[which] = self._joints[which]
        length = np.sqrt(lengths)
        fast = length > TCP_LEAD
        which = which[fast]
        share = (TCP_LEAD / length[fast])[:, None]
        self._allowed[which] = self._joints[which] + share * self._leads[which]
