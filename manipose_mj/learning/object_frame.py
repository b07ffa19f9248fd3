"""What a learnt policy sees and does, in the frame of an object that is taken from above: the same wherever it lies.

The *grip frame* has its origin in the object's label and the axes of a TCP that comes from above: z down, y level and
across the label's X, which is the long axis of most things; where X stands upright, along the narrower of Y and Z. Of the
two half turns about z it is the one nearer to the hand. Pure functions of observations with any leading dimensions.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from manipose_mj.learning import grip
from manipose_mj.learning.grip import Observation
from manipose_mj.poses import Array, compose, invert
from manipose_mj.small_matrices import product

NEEDS: str = "a task about one object"
SEEN: tuple[str, ...] = (
    "pose/robot/object",
    "pose/bounds/object",
    "pose/axial/object",
    "panda/tcp_pose",
    "panda/gripper_opening",
    "panda/joint_positions",
    "panda/joint_velocities",
)
_UPRIGHT = 0.9  # of X's height: above it Y or Z tells the direction


def grip_frame(observation: Observation) -> Float[Array, "*b 4 4"]:
    """`T_base_grip`."""
    label = observation["pose/robot/object"]
    x, y, z = (label[..., :3, i] for i in range(3))
    upright = jnp.abs(x[..., 2:]) > _UPRIGHT
    lower, upper = _corners(observation)
    _, wide, deep = jnp.split(upper - lower, 3, axis=-1)
    across = jnp.where(
        upright,
        jnp.where(wide < deep, y, z),
        jnp.stack([-x[..., 1], x[..., 0], x[..., 2]], axis=-1),
    )
    across = across * jnp.asarray([1.0, 1.0, 0.0])
    across = across / jnp.sqrt(jnp.sum(across**2, axis=-1, keepdims=True) + 1e-12)
    across = grip.nearer_half_turn(across, grip.tcp_pose(observation))
    down = jnp.broadcast_to(jnp.asarray([0.0, 0.0, -1.0], across.dtype), across.shape)
    columns = (jnp.linalg.cross(across, down), across, down)
    return compose(jnp.stack(columns, axis=-1), label[..., :3, 3])


def features(observation: Observation) -> Float[Array, "*b n"]:
    """What the networks see: hand, robot, object and the room it takes, in the grip frame, of which z is the vertical."""
    to_grip = invert(grip_frame(observation))
    T_grip_label = product(to_grip, observation["pose/robot/object"])
    _, *label = grip.pose_features(T_grip_label)
    seen = (
        *grip.pose_features(product(to_grip, grip.tcp_pose(observation))),
        *label,
        *_room(observation, T_grip_label),
        to_grip[..., :3, 3],  # the robot's base, which is as high as the table
        *grip.robot_features(observation),
    )
    return jnp.concatenate(seen, axis=-1).astype(jnp.float32)


def _room(
    observation: Observation, T_grip_label: Float[Array, "*b 4 4"]
) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 3"]]:
    """Middle of the object in the grip frame, and half of what it takes up along its axes, as `PoseLabel.reach`."""
    lower, upper = _corners(observation)
    half, rotation = (upper - lower) / 2, T_grip_label[..., :3, :3]
    center = jnp.einsum("...ij,...j->...i", rotation, (lower + upper) / 2)
    box = jnp.einsum("...ij,...j->...i", jnp.abs(rotation), half)
    along = jnp.abs(rotation[..., 0])
    radius = jnp.max(half[..., 1:], axis=-1, keepdims=True)
    cylinder = along * half[..., :1] + jnp.sqrt(jnp.clip(1 - along**2, 0, 1)) * radius
    return center, jnp.where(observation["pose/axial/object"] > 0, cylinder, box)


def _corners(observation: Observation) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 3"]]:
    """Of its bounding box, in the label frame."""
    bounds = jnp.asarray(observation["pose/bounds/object"], jnp.float32)
    return bounds[..., 0, :], bounds[..., 1, :]


def command(observation: Observation, action: Float[Array, "*b 7"]) -> Float[Array, "*b 7"]:
    """An action of the control mode `pd_ee_pose`, as of `grip.command`, but for where the hand goes and how it turns.

    These are the finer the nearer the grip is, where a box leaves the fingers millimetres: cubes of the numbers. The
    gripper is fully open or shut, by the sign of its number, since a box leaves half open fingers no room.
    """
    motion = jnp.clip(action[..., :6], -1.0, 1.0) ** 3
    opening = jnp.where(action[..., 6:] > 0, 1.0, -1.0)
    action = jnp.concatenate([motion, opening], axis=-1)
    return grip.command(grip_frame(observation), grip.tcp_pose(observation), action)
