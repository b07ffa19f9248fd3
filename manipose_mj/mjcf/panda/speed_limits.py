"""How fast the set-points of the joints may move: a pure function, of NumPy or JAX."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from manipose_mj.mjcf.panda.kinematics import (
    DH,
    FLANGE_OFFSET,
    POSITION_LIMITS,
    TCP_OFFSET,
    TCP_SPEED_LIMIT,
    VELOCITY_LIMITS,
)
from manipose_mj.mjcf.panda.model import SERVO_LAG
from manipose_mj.poses import Array, namespace

_LOWEST, _HIGHEST = POSITION_LIMITS.T.copy()
# A servo whose set-point stays this far ahead drives its joint, or the TCP, at the limit of its speed.
JOINT_LEADS = SERVO_LAG * VELOCITY_LIMITS  # [rad]
TCP_LEAD = SERVO_LAG * TCP_SPEED_LIMIT  # [m]
# The TCP is never further than this from each joint's axis [m].
_LINKS = np.append(np.hypot(DH[1:, 0], DH[1:, 1]), FLANGE_OFFSET + TCP_OFFSET)
TCP_REACH = np.cumsum(_LINKS[::-1])[::-1]


@lru_cache(maxsize=8)
def most_motion(timestep: float) -> Float[np.ndarray, "7"]:
    """How far the set-points may move in a time step [rad]."""
    return timestep * VELOCITY_LIMITS


def allowed_set_points(
    targets: Float[Array, "7"],
    set_points: Float[Array, "7"],
    joints: Float[Array, "7"],
    tcp_jacobian: Callable[[], Float[Array, "3 7"]],
    most: Float[Array, "7"],
) -> Float[Array, "7"]:
    """The set-points of the next physics step [rad]: towards the targets, no faster than is allowed.

    They stay within one step's motion of where they are, and near enough to the joints and the TCP for
    neither to be driven faster than it may go.

    Args:
      targets: Where the joints shall go [rad].
      set_points: Of the last step [rad].
      joints: Measured angles [rad].
      tcp_jacobian: Of the TCP's position [m/rad]; in NumPy not asked for far below its limit.
      most: That a set-point may move in one step [rad].
    """
    xp = namespace(targets)
    allowed = allowed_for_joints(targets, set_points, joints, most)
    leads = allowed - joints
    if xp is not np or np.abs(leads).dot(TCP_REACH) > TCP_LEAD:
        motion = _sum_in_order(tcp_jacobian() * leads)
        length = xp.sqrt(_sum_in_order(motion * motion))
        slowed = joints + (TCP_LEAD / xp.maximum(length, TCP_LEAD)) * leads
        allowed = xp.where(length > TCP_LEAD, slowed, allowed)
    return xp.minimum(xp.maximum(allowed, _LOWEST), _HIGHEST)


def allowed_for_joints(
    targets: Float[Array, "*b 7"],
    set_points: Float[Array, "*b 7"],
    joints: Float[Array, "*b 7"],
    most: Float[Array, "7"],
) -> Float[Array, "*b 7"]:
    """The set-points that drive no joint too fast, whatever the TCP does; arguments as of `allowed_set_points`."""
    xp = namespace(targets)
    allowed = xp.minimum(xp.maximum(targets, set_points - most), set_points + most)
    return xp.minimum(xp.maximum(allowed, joints - JOINT_LEADS), joints + JOINT_LEADS)


def _sum_in_order(values: Float[Array, "*b n"]) -> Float[Array, "*b"]:
    """Sums whose bits in NumPy depend on no processor, as those of a product by BLAS do."""
    return values.cumsum(axis=-1)[..., -1] if namespace(values) is np else values.sum(axis=-1)
