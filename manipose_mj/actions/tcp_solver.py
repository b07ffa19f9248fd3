"""Kinematics of the arm alone, in its base frame: MuJoCo's for the CPU, the published ones for JAX."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.actions.tcp_search import TcpSolverConfig, search
from manipose_mj.mjcf.panda.kinematics import DH, FLANGE_OFFSET, HAND_YAW, TCP_OFFSET
from manipose_mj.mjcf.panda.model import build_panda
from manipose_mj.poses import Array, compose, namespace, rotation_to_quaternion
from manipose_mj.small_matrices import product

# Modified Denavit-Hartenberg parameters of the joints, and of the TCP on the last link.
_ROWS = np.concatenate([DH, [[0.0, FLANGE_OFFSET + TCP_OFFSET, 0.0]]])


class TcpSolver:
    """By MuJoCo, in NumPy; a millisecond at most, without any scene."""

    def __init__(self, config: TcpSolverConfig | None = None) -> None:
        self._config = config or TcpSolverConfig()
        self._model = _arm_model()
        self._data = mujoco.MjData(self._model)
        self._site = self._model.site("tcp").id
        self._jacobian = np.zeros((6, self._model.nv))

    def __reduce__(self) -> tuple[type[TcpSolver], tuple[TcpSolverConfig]]:
        # Solvers remember nothing: what is copied or sent to another process is the configuration.
        return TcpSolver, (self._config,)

    def pose(self, joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
        """`T_base_tcp` of a configuration [rad]."""
        self._place(joints)
        return compose(
            self._data.site_xmat[self._site].reshape(3, 3), self._data.site_xpos[self._site]
        )

    def reach(
        self, pose: Float[np.ndarray, "4 4"], start: Float[np.ndarray, "7"]
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """The configuration next to `start` whose TCP is nearest to a pose, within the joint limits.

        Args:
          pose: `T_base_tcp`.
          start: Joint angles to start from [rad].

        Returns:
          Joint angles [rad], and the error that is left: distance [m] and tilt times the lever.
        """
        goal = np.empty(4)
        mujoco.mju_mat2Quat(goal, pose[:3, :3].ravel())
        position = pose[:3, 3]
        return search(
            lambda joints: self._error(position, goal, joints),
            self._jacobian_at,
            start,
            self._config,
        )

    def _place(self, joints: Float[np.ndarray, "7"]) -> None:
        self._data.qpos[:7] = joints
        mujoco.mj_kinematics(self._model, self._data)

    def _error(
        self,
        position: Float[np.ndarray, "3"],
        quaternion: Float[np.ndarray, "4"],
        joints: Float[np.ndarray, "7"],
    ) -> Float[np.ndarray, "6"]:
        """From the TCP to the pose, in the base frame: position, then turn times the lever [m]."""
        self._place(joints)
        own, turn = np.empty(4), np.empty(3)
        matrix = self._data.site_xmat[self._site]
        mujoco.mju_mat2Quat(own, matrix)
        mujoco.mju_subQuat(turn, quaternion, own)
        turned = self._config.lever * (matrix.reshape(3, 3) @ turn)
        return np.concatenate([position - self._data.site_xpos[self._site], turned])

    def _jacobian_at(self, joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "6 7"]:
        jacobian = self._jacobian
        self._place(joints)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_jacSite(self._model, self._data, jacobian[:3], jacobian[3:], self._site)
        jacobian[3:] *= self._config.lever
        return jacobian[:, :7]


@dataclass(frozen=True)
class PureTcpSolver:
    """By the published kinematics; pure functions of one world, for `jax.jit` and `jax.vmap`."""

    config: TcpSolverConfig = TcpSolverConfig()

    def pose(self, joints: Float[Array, "7"]) -> Float[Array, "4 4"]:
        """`T_base_tcp` of a configuration [rad]."""
        return _axes_and_tcp(joints)[1]

    def reach(
        self, pose: Float[Array, "4 4"], start: Float[Array, "7"]
    ) -> tuple[Float[Array, "7"], Float[Array, ""]]:
        """As `TcpSolver.reach`."""
        lever = self.config.lever

        def error_at(joints: Float[Array, "7"]) -> Float[Array, "6"]:
            xp, own = namespace(joints), self.pose(joints)
            turn = _rotation_vector(product(pose[:3, :3], own[:3, :3].T))
            return xp.concat([pose[:3, 3] - own[:3, 3], lever * turn])

        def jacobian_at(joints: Float[Array, "7"]) -> Float[Array, "6 7"]:
            xp = namespace(joints)
            frames, tcp = _axes_and_tcp(joints)
            axes = frames[:, :3, 2]
            moved = xp.linalg.cross(axes, tcp[:3, 3] - frames[:, :3, 3])
            return xp.concat([moved, lever * axes], axis=-1).T

        return search(error_at, jacobian_at, start, self.config)


def _axes_and_tcp(joints: Float[Array, "7"]) -> tuple[Float[Array, "7 4 4"], Float[Array, "4 4"]]:
    """Poses of the links, which turn about their z, and of the TCP (Craig, Introduction to Robotics, 3.6)."""
    xp = namespace(joints)
    a, d, alpha = xp.asarray(_ROWS.T, dtype=joints.dtype)
    angles = xp.concat([joints, xp.asarray([HAND_YAW], dtype=joints.dtype)])
    ct, st, ca, sa = xp.cos(angles), xp.sin(angles), xp.cos(alpha), xp.sin(alpha)
    rows = [
        [ct, -st, xp.zeros_like(ct), a],
        [st * ca, ct * ca, -sa, -d * sa],
        [st * sa, ct * sa, ca, d * ca],
        [xp.zeros_like(ct), xp.zeros_like(ct), xp.zeros_like(ct), xp.ones_like(ct)],
    ]
    steps = xp.stack([xp.stack(row, axis=-1) for row in rows], axis=-2)
    poses = [steps[0]]
    for step in steps[1:]:
        poses.append(product(poses[-1], step))
    return xp.stack(poses[:7]), poses[7]


def _rotation_vector(rotation: Float[Array, "3 3"]) -> Float[Array, "3"]:
    """Axis times angle [rad], at most half a turn."""
    xp = namespace(rotation)
    quaternion = rotation_to_quaternion(rotation)
    sine = xp.sqrt(xp.vecdot(quaternion[1:], quaternion[1:]))
    angle = 2 * xp.atan2(sine, quaternion[0])
    return quaternion[1:] * xp.where(sine > 1e-12, angle / xp.maximum(sine, 1e-12), 2.0)


@cache
def _arm_model() -> mujoco.MjModel:
    """Compiled once per process; solvers only read it."""
    return mjcf.Physics.from_mjcf_model(build_panda("panda", None)).model.ptr
