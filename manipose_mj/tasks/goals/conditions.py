"""What counts as success, written once as functions of arrays (NumPy or JAX).

Definitions: a pose goal is met when the symmetric pose error is within tolerance, the object is at
rest and the gripper has let go; an object is stored when all of it, by its bounding box or cylinder, lies
in the cavity and the part that closes it is shut.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.poses import Array, SymmetryGroup, namespace, pose_error
from manipose_mj.small_matrices import product


@dataclass(frozen=True)
class Tolerance:
    """Attributes: translation [m], rotation [rad], linear_speed [m/s], angular_speed [rad/s];
    shut: how far from its shut limit a joint may stay [m or rad]; cavity_slack: how far the
    object may stick out of the cavity [m]."""

    translation: float = 0.02
    rotation: float = radians(15)
    linear_speed: float = 0.01
    angular_speed: float = 0.1
    shut: float = 0.01
    cavity_slack: float = 0.002


def at_rest(
    linear_speed: Float[Array, "*#b"], angular_speed: Float[Array, "*#b"], tolerance: Tolerance
) -> Bool[Array, "*#b"]:
    """Whether both speeds are under their limits."""
    return (linear_speed < tolerance.linear_speed) & (angular_speed < tolerance.angular_speed)


def pose_goal_met(
    label_pose: Float[Array, "*#b 4 4"],
    goal_pose: Float[Array, "*#b 4 4"],
    linear_speed: Float[Array, "*#b"],
    angular_speed: Float[Array, "*#b"],
    touched: Bool[Array, "*#b"],
    symmetry: SymmetryGroup,
    tolerance: Tolerance,
) -> Bool[Array, "*#b"]:
    """Whether the object rests at its goal, released.

    Args:
      label_pose: `T_world_label` of the object.
      goal_pose: `T_world_label` it should have.
      linear_speed: Of the object [m/s].
      angular_speed: Of the object [rad/s].
      touched: Whether the gripper touches the object.
      symmetry: The object's.
      tolerance: How close is close enough.
    """
    xp = namespace(label_pose)
    distance = xp.sqrt(xp.sum((label_pose[..., :3, 3] - goal_pose[..., :3, 3]) ** 2, axis=-1))
    near = distance < tolerance.translation
    met = near & at_rest(linear_speed, angular_speed, tolerance) & ~touched
    if xp is np and not met.any():
        return met  # as of most states: the angle, which takes longest, is not asked for
    _, angle = pose_error(label_pose, goal_pose, symmetry)
    return met & (angle < tolerance.rotation)


def inside_cavity(
    label_pose_cavity: Float[Array, "*#b 4 4"],
    label_extents: Float[Array, "*#b 3"],
    axial: bool | Bool[Array, "*#b"],
    cavity_extents: Float[Array, "*#b 3"],
    slack: float,
) -> Bool[Array, "*#b"]:
    """Whether the object's bounding box, or cylinder if it is axial, lies in the cavity.

    Below only the label's origin counts: nothing rests under a floor, and a corner of the box of
    what lies askew may, a mug's on its handle by 4 cm.

    Args:
      label_pose_cavity: `T_cavity_label`; the cavity's frame is centred in it.
      label_extents: Of the object's bounding box along the label's axes [m].
      axial: Whether the label's X is an axis of revolution.
      cavity_extents: Full lengths [m].
      slack: How far a corner may stick out [m].
    """
    xp = namespace(label_pose_cavity)
    dtype = label_pose_cavity.dtype
    half = xp.asarray(label_extents, dtype=dtype) / 2
    rotation = xp.abs(label_pose_cavity[..., :3, :3])
    box = product(rotation, half[..., None])[..., 0]
    along = rotation[..., 0]
    radius = xp.max(half[..., 1:], axis=-1, keepdims=True)
    cylinder = along * half[..., :1] + xp.sqrt(xp.clip(1 - along**2, 0.0, 1.0)) * radius
    reach = xp.where(xp.asarray(axial)[..., None], cylinder, box)
    limit = xp.asarray(cavity_extents, dtype=dtype) / 2 + slack
    place = label_pose_cavity[..., :3, 3]
    above_floor = place[..., 2] >= -limit[..., 2]
    sideways = xp.all(xp.abs(place[..., :2]) + reach[..., :2] <= limit[..., :2], axis=-1)
    return sideways & above_floor & (place[..., 2] + reach[..., 2] <= limit[..., 2])
