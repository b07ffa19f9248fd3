"""Inverse kinematics for one control step: the joints nearby that bring the TCP nearest to a pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.mjcf.panda_kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda_model import build_panda

_LOW, _HIGH = POSITION_LIMITS.T


@dataclass(frozen=True)
class TcpSolverConfig:
    """Attributes: iterations: at most; damping: added to the squared error [m^2]; lever: metres that
    a radian of tilt counts; tolerance: error that ends the search [m]; least_gain: the share of the
    squared error that may be left by an iteration that is worth another; max_step: of a joint in one
    iteration [rad]."""

    iterations: int = 25
    damping: float = 1e-5
    lever: float = 0.3
    tolerance: float = 1e-7
    least_gain: float = 0.999
    max_step: float = 0.3


class TcpSolver:
    """Kinematics of the arm alone, in its base frame; a millisecond at most, without any scene."""

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
        pose = np.eye(4)
        pose[:3, :3] = self._data.site_xmat[self._site].reshape(3, 3)
        pose[:3, 3] = self._data.site_xpos[self._site]
        return pose

    def reach(
        self, pose: Float[np.ndarray, "4 4"], start: Float[np.ndarray, "7"]
    ) -> tuple[Float[np.ndarray, "7"], float]:
        """The configuration next to `start` whose TCP is nearest to a pose, within the joint limits.

        Levenberg-Marquardt with a damping that follows the error, which converges for poses out of
        reach too (T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt
        method", T-RO 27(5), 2011); joints at a limit drop out of the step that would cross it.

        Args:
          pose: `T_base_tcp`.
          start: Joint angles to start from [rad].

        Returns:
          Joint angles [rad], and the error that is left: distance [m] and tilt times the lever.
        """
        config = self._config
        goal = np.empty(4)
        mujoco.mju_mat2Quat(goal, pose[:3, :3].ravel())
        best = np.clip(start, _LOW, _HIGH)
        error = self._error(pose[:3, 3], goal, best)
        least, caution = float(error @ error), 1.0
        for _ in range(config.iterations):
            if least < config.tolerance**2:
                break
            joints = self._stepped(best, error, caution * (0.5 * least + config.damping))
            new = self._error(pose[:3, 3], goal, joints)
            squared = float(new @ new)
            if squared >= least:
                caution *= 10.0
                continue
            # Where little is gained any more the pose is out of reach.
            done = squared > config.least_gain * least
            best, error, least, caution = joints, new, squared, max(1.0, caution / 10.0)
            if done:
                break
        return best, float(np.sqrt(least))

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

    def _stepped(
        self, joints: Float[np.ndarray, "7"], error: Float[np.ndarray, "6"], damping: float
    ) -> Float[np.ndarray, "7"]:
        """One damped step; joints that would cross a limit stay, and the others make up for it."""
        config, jacobian = self._config, self._jacobian
        self._place(joints)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_jacSite(self._model, self._data, jacobian[:3], jacobian[3:], self._site)
        jacobian[3:] *= config.lever
        moving = np.ones(7, bool)
        stepped = joints
        for _ in range(3):
            used = jacobian[:, :7] * moving
            step = used.T @ np.linalg.solve(used @ used.T + damping * np.eye(6), error)
            step *= min(1.0, config.max_step / max(float(np.abs(step).max()), 1e-12))
            free = joints + step
            stepped = np.clip(free, _LOW, _HIGH)
            crossed = stepped != free
            if not crossed.any():
                break
            moving &= ~crossed
        return stepped


@cache
def _arm_model() -> mujoco.MjModel:
    """Compiled once per process; solvers only read it."""
    return mjcf.Physics.from_mjcf_model(build_panda("panda", None)).model.ptr
