"""Inverse kinematics of many targets at once: which of hundreds of grasps can the arm reach?

Levenberg-Marquardt on the published kinematics, vectorised over targets and seeds in NumPy; a
filter and a source of start configurations for the differential IK that executes motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.mjcf.panda.kinematics import (
    DH,
    FLANGE_OFFSET,
    HAND_YAW,
    HOME,
    POSITION_LIMITS,
    TCP_OFFSET,
)

_LOW, _HIGH = POSITION_LIMITS.T
# Stay this far from the joint limits, so that tracking errors never meet them [rad].
_LIMIT_MARGIN = 0.03


@dataclass(frozen=True)
class BatchIkConfig:
    """Attributes: iterations; damping: added to `J J^T`; position [m] and rotation [rad] tolerance;
    max_step: of a joint in one iteration [rad]."""

    iterations: int = 40
    damping: float = 1e-3
    position_tolerance: float = 5e-4
    rotation_tolerance: float = 2e-3
    max_step: float = 0.4


def forward(joints: Float[np.ndarray, "n 7"]) -> tuple[np.ndarray, np.ndarray]:
    """TCP poses `(n, 4, 4)` in the base frame and geometric Jacobians `(n, 6, 7)`, linear first."""
    n = len(joints)
    # Components first: rows of thousands of numbers instead of thousands of small matrices.
    x, y, z = np.repeat(np.eye(3)[..., None], n, axis=2)
    position = np.zeros((3, n))
    axes, origins = np.empty((2, 3, 7, n))
    cosines, sines = np.cos(joints.T), np.sin(joints.T)
    for k, (a, d, alpha) in enumerate(DH):
        position = position + a * x
        y, z = _turned(y, z, np.cos(alpha), np.sin(alpha))
        position += d * z
        x, y = _turned(x, y, cosines[k], sines[k])
        axes[:, k], origins[:, k] = z, position
    position = position + z * (FLANGE_OFFSET + TCP_OFFSET)
    x, y = _turned(x, y, np.cos(HAND_YAW), np.sin(HAND_YAW))
    arm = position[:, None] - origins
    linear = axes[[1, 2, 0]] * arm[[2, 0, 1]] - axes[[2, 0, 1]] * arm[[1, 2, 0]]
    jacobian = np.concatenate([linear, axes]).transpose(2, 0, 1)
    pose = np.zeros((n, 4, 4))
    pose[:, :3] = np.stack([x, y, z, position]).transpose(2, 1, 0)
    pose[:, 3, 3] = 1.0
    return pose, jacobian


def _turned(
    u: Float[np.ndarray, "3 n"],
    v: Float[np.ndarray, "3 n"],
    cosine: Float[np.ndarray, "n"] | np.floating | float,
    sine: Float[np.ndarray, "n"] | np.floating | float,
) -> tuple[np.ndarray, np.ndarray]:
    """Two axes, turned from the first towards the second."""
    return cosine * u + sine * v, cosine * v - sine * u


def rotation_vector(rotation: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3"]:
    """The axis times the angle [rad], in [0, pi]."""
    skew = (rotation - rotation.transpose(0, 2, 1)) / 2
    sine_axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1)
    sine = np.linalg.norm(sine_axis, axis=-1)
    cosine = (np.trace(rotation, axis1=1, axis2=2) - 1) / 2
    angle = np.arctan2(sine, cosine)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    vector = sine_axis * scale[:, None]
    # Half a turn leaves no sine to divide by: R + I is then twice the axis times itself.
    for i in np.flatnonzero((sine <= 1e-9) & (cosine < 0)):
        column = (rotation[i] + np.eye(3))[:, np.argmax(np.diag(rotation[i]))]
        vector[i] = np.pi * column / np.linalg.norm(column)
    return vector


def seeds_for(targets: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "s n 7"]:
    """Start configurations: the arm turned towards the target, four turns of wrist and forearm."""
    azimuth = np.arctan2(targets[:, 1, 3], targets[:, 0, 3])
    seeds = []
    for elbow, wrist in ((0.0, 0.0), (0.0, np.pi / 2), (0.0, -np.pi / 2), (0.9, 0.8), (-0.9, -0.8)):
        seed = np.tile(HOME, (len(targets), 1))
        seed[:, 0] = np.clip(azimuth - elbow / 2, _LOW[0] + 0.1, _HIGH[0] - 0.1)
        seed[:, 2] = elbow
        seed[:, 6] = HOME[6] + wrist
        seeds.append(seed)
    return np.stack(seeds)


def solve(
    targets: Float[np.ndarray, "n 4 4"],
    seeds: Float[np.ndarray, "s n 7"],
    config: BatchIkConfig | None = None,
) -> tuple[Float[np.ndarray, "s n 7"], Bool[np.ndarray, "s n"]]:
    """Joint angles [rad] that bring the TCP to each target, from each seed.

    Args:
      targets: `T_base_tcp`.
      seeds: Start configurations [rad].
      config: Iterations and tolerances.

    Returns:
      The configurations, and which of them reach their target within the joint limits.
    """
    config = config or BatchIkConfig()
    count, n = seeds.shape[:2]
    q = seeds.reshape(-1, 7).copy()
    goal = np.broadcast_to(targets, (count, n, 4, 4)).reshape(-1, 4, 4)
    low, high = _LOW + _LIMIT_MARGIN, _HIGH - _LIMIT_MARGIN
    done = np.zeros(len(q), bool)
    active = np.arange(len(q))
    for _ in range(config.iterations):
        pose, jacobian = forward(q[active])
        error = np.empty((len(active), 6))
        error[:, :3] = goal[active, :3, 3] - pose[:, :3, 3]
        error[:, 3:] = rotation_vector(goal[active, :3, :3] @ pose[:, :3, :3].transpose(0, 2, 1))
        reached = (np.linalg.norm(error[:, :3], axis=1) < config.position_tolerance) & (
            np.linalg.norm(error[:, 3:], axis=1) < config.rotation_tolerance
        )
        done[active[reached]] = True
        active, error, jacobian = active[~reached], error[~reached], jacobian[~reached]
        if not len(active):
            break
        gram = jacobian @ jacobian.transpose(0, 2, 1) + config.damping * np.eye(6)
        step = jacobian.transpose(0, 2, 1) @ np.linalg.solve(gram, error[..., None])
        largest = np.abs(step).max(axis=(1, 2), keepdims=True)
        step = step * np.minimum(1.0, config.max_step / np.maximum(largest, 1e-12))
        q[active] = np.clip(q[active] + step[..., 0], low, high)
    return q.reshape(count, n, 7), done.reshape(count, n)
