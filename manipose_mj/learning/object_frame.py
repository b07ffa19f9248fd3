"""What a learnt policy sees and does, in the frame of an object that is taken from above: the same wherever it lies.

The *grip frame* has its origin in the object's label and the axes of a TCP that comes from above: z down, y level and
across the label's X, which is the long axis of most things; along the label's Z where X stands upright. Of the two half
turns about z it is the one nearer to the hand. Pure functions of observations with any leading dimensions.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from manipose_mj.learning import grip
from manipose_mj.learning.grip import Observation
from manipose_mj.poses import Array, compose, invert

NEEDS: str = "a task about one object"
SEEN: tuple[str, ...] = (
    "pose/robot/object",
    "panda/tcp_pose",
    "panda/gripper_opening",
    "panda/joint_positions",
    "panda/joint_velocities",
)
_UPRIGHT = 0.9  # of X's height: above it Z tells the direction


def grip_frame(observation: Observation) -> Float[Array, "*b 4 4"]:
    """`T_base_grip`."""
    label = observation["pose/robot/object"]
    x, z = label[..., :3, 0], label[..., :3, 2]
    upright = jnp.abs(x[..., 2:]) > _UPRIGHT
    across = jnp.where(upright, z, jnp.stack([-x[..., 1], x[..., 0], x[..., 2]], axis=-1))
    across = across * jnp.asarray([1.0, 1.0, 0.0])
    across = across / jnp.sqrt(jnp.sum(across**2, axis=-1, keepdims=True) + 1e-12)
    across = grip.nearer_half_turn(across, grip.tcp_pose(observation))
    down = jnp.broadcast_to(jnp.asarray([0.0, 0.0, -1.0], across.dtype), across.shape)
    columns = (jnp.linalg.cross(across, down), across, down)
    return compose(jnp.stack(columns, axis=-1), label[..., :3, 3])


def features(observation: Observation) -> Float[Array, "*b n"]:
    """What the networks see: hand, robot and object in the grip frame, of which z is the vertical."""
    to_grip = invert(grip_frame(observation))
    _, *label = grip.pose_features(to_grip @ observation["pose/robot/object"])
    seen = (
        *grip.pose_features(to_grip @ grip.tcp_pose(observation)),
        *label,
        to_grip[..., :3, 3],  # the robot's base, which is as high as the table
        *grip.robot_features(observation),
    )
    return jnp.concatenate(seen, axis=-1).astype(jnp.float32)


def command(observation: Observation, action: Float[Array, "*b 7"]) -> Float[Array, "*b 7"]:
    """An action of the control mode `pd_ee_pose`, as of `grip.command`."""
    return grip.command(grip_frame(observation), grip.tcp_pose(observation), action)
