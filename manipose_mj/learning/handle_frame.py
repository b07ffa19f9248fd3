"""What a learnt policy sees and does, in the frame of a handle: the same wherever the furniture stands.

The *grip frame* has its origin in the handle and the axes that the TCP has where it grips the handle's bar from the
front: z into the furniture, y across the bar. Of the two half turns about z it is the one nearer to the hand.
Pure functions of observations with any leading dimensions.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from manipose_mj.learning import grip
from manipose_mj.learning.grip import Observation
from manipose_mj.poses import Array, compose, invert
from manipose_mj.small_matrices import product

NEEDS: str = "a task that opens or shuts one drawer or door"
SEEN: tuple[str, ...] = (
    "pose/robot/handle",
    "pose/robot/joint",
    "pose/opening",
    "panda/tcp_pose",
    "panda/gripper_opening",
    "panda/joint_positions",
    "panda/joint_velocities",
)


def grip_frame(observation: Observation) -> Float[Array, "*b 4 4"]:
    """`T_base_grip`."""
    handle = observation["pose/robot/handle"]
    into = -handle[..., :3, 1]
    across = grip.nearer_half_turn(handle[..., :3, 2], grip.tcp_pose(observation))
    columns = (jnp.linalg.cross(across, into), across, into)
    return compose(jnp.stack(columns, axis=-1), handle[..., :3, 3])


def features(observation: Observation) -> Float[Array, "*b n"]:
    """What the networks see: hand, robot, joint of the furniture and the vertical, in the grip frame."""
    to_grip = invert(grip_frame(observation))
    joint = product(to_grip, observation["pose/robot/joint"])
    seen = (
        *grip.pose_features(product(to_grip, grip.tcp_pose(observation))),
        *grip.pose_features(joint),
        to_grip[..., :3, 3],  # the robot's base
        to_grip[..., :3, 2],  # the vertical
        observation["pose/opening"],
        *grip.robot_features(observation),
    )
    return jnp.concatenate(seen, axis=-1).astype(jnp.float32)


def command(observation: Observation, action: Float[Array, "*b 7"]) -> Float[Array, "*b 7"]:
    """An action of the control mode `pd_ee_pose`, as of `grip.command`."""
    return grip.command(grip_frame(observation), grip.tcp_pose(observation), action)
