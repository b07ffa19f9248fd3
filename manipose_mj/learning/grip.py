"""Moving a hand about a *grip frame*, the pose that the TCP has where it grips a thing: shared by handles and objects.

Pure functions with any leading dimensions.
"""

from __future__ import annotations

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from manipose_mj.actions.tcp_motion import euler_angles
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.poses import Array, compose, invert, rotation_to_quaternion, vector_to_pose
from manipose_mj.small_matrices import product

CONTROL_MODE, OBS_MODE = "pd_ee_pose", "state+pose"
ACTIONS = 7
# How far from the grip an action can ask the TCP to go, and how far from the grip's rotation [m, rad].
_REACH, _TILT = 0.15, 0.6
# How far from where it is the TCP is sent at once [m, rad].
_STEP, _TURN = 0.12, 0.6

Observation = Mapping[str, Array]


def command(
    grip: Float[Array, "*b 4 4"], tcp: Float[Array, "*b 4 4"], action: Float[Array, "*b 7"]
) -> Float[Array, "*b 7"]:
    """An action of the control mode `pd_ee_pose`.

    Args:
      grip: `T_base_grip`.
      tcp: `T_base_tcp` of the present.
      action: Numbers from -1 to 1: where the TCP shall go, in the grip frame; how it shall be turned from it, as a
        rotation vector; and the opening.
    """
    action = jnp.clip(action, -1.0, 1.0)
    now = product(invert(grip), tcp)
    away = _REACH * action[..., :3] - now[..., :3, 3]
    turn = rotation_vector(
        product(rotation_matrix(_TILT * action[..., 3:6]), jnp.swapaxes(now[..., :3, :3], -1, -2))
    )
    position = now[..., :3, 3] + _at_most(away, _STEP)
    rotation = product(rotation_matrix(_at_most(turn, _TURN)), now[..., :3, :3])
    target = product(grip, compose(rotation, position))
    opening = MAX_OPENING * (action[..., 6:] + 1) / 2
    return jnp.concatenate(
        [target[..., :3, 3], euler_angles(target[..., :3, :3]), opening], axis=-1
    )


def nearer_half_turn(
    across: Float[Array, "*b 3"], tcp: Float[Array, "*b 4 4"]
) -> Float[Array, "*b 3"]:
    """An axis across which fingers close, or its opposite: the one nearer to the TCP's y."""
    alike = jnp.sum(tcp[..., :3, 1] * across, axis=-1, keepdims=True)
    return jnp.where(alike < 0, -across, across)


def tcp_pose(observation: Observation) -> Float[Array, "*b 4 4"]:
    """`T_base_tcp`."""
    return vector_to_pose(jnp.asarray(observation["panda/tcp_pose"]))


def pose_features(pose: Float[Array, "*b 4 4"]) -> tuple[Array, Array, Array]:
    """Position, and two columns of the rotation."""
    return pose[..., :3, 3], pose[..., :3, 0], pose[..., :3, 1]


def robot_features(observation: Observation) -> tuple[Array, Array, Array]:
    """Opening of the gripper, joint angles from home, joint velocities."""
    return (
        observation["panda/gripper_opening"] / MAX_OPENING,
        observation["panda/joint_positions"] - HOME.astype(np.float32),
        0.2 * observation["panda/joint_velocities"],
    )


def rotation_matrix(vector: Float[Array, "*b 3"]) -> Float[Array, "*b 3 3"]:
    """Of a rotation vector: axis times angle [rad] (Rodrigues)."""
    angle = jnp.sqrt(jnp.sum(vector**2, axis=-1) + 1e-12)[..., None, None]
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    none = jnp.zeros_like(x)
    rows = [none, -z, y, z, none, -x, -y, x, none]
    skew = jnp.stack(rows, axis=-1).reshape(*x.shape, 3, 3) / angle
    return jnp.eye(3) + jnp.sin(angle) * skew + (1 - jnp.cos(angle)) * product(skew, skew)


def rotation_vector(rotation: Float[Array, "*b 3 3"]) -> Float[Array, "*b 3"]:
    """Axis times angle [rad], at most half a turn."""
    quaternion = rotation_to_quaternion(rotation)
    quaternion = jnp.where(quaternion[..., :1] < 0, -quaternion, quaternion)
    sine = jnp.sqrt(jnp.sum(quaternion[..., 1:] ** 2, axis=-1, keepdims=True) + 1e-12)
    return quaternion[..., 1:] * (2 * jnp.arctan2(sine, quaternion[..., :1]) / sine)


def _at_most(vector: Float[Array, "*b 3"], length: float) -> Float[Array, "*b 3"]:
    own = jnp.sqrt(jnp.sum(vector**2, axis=-1, keepdims=True) + 1e-12)
    return vector * jnp.minimum(1.0, length / own)
