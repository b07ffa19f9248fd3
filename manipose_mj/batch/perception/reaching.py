"""From clouds to joint angles in many worlds at once: estimate poses, choose grasps, solve for the arm; all in JAX.

The solver is the control modes' own: damped least squares within the joint limits (`actions.tcp_search`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, PRNGKeyArray

from manipose_mj.actions import PureTcpSolver
from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.poses import Array, invert
from manipose_mj.ppf_jax.rigid.model import EstimatingModel, estimate_batch

REACHED = (
    1e-3  # error of a pose that counts as reached: position, or turn times the solver's lever [m]
)
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
_MARGIN = 0.003  # between the open gripper and what it takes, in all [m]


class GraspTable(NamedTuple):
    """Grasps of several objects, the best first; of some, fewer than room is for.

    Attributes: poses, `T_label_tcp`; valid, whether there is one.
    """

    poses: Float[Array, "objects k 4 4"]
    valid: Bool[Array, "objects k"]


class Choice(NamedTuple):
    """A grasp for each world.

    Attributes:
      joints: That take it [rad].
      tcp: `T_base_tcp`.
      error: That the solver leaves: position, and turn times its lever [m].
      found: Whether one of those that were tried is in reach.
    """

    joints: Float[Array, "worlds 7"]
    tcp: Float[Array, "worlds 4 4"]
    error: Float[Array, " worlds"]
    found: Bool[Array, " worlds"]

    def actions(self, opening: float = MAX_OPENING) -> Float[Array, "worlds 8"]:
        """Of the control mode `pd_joint_pos`: there, with the gripper open so far [m]."""
        width = jnp.full((len(self.joints), 1), opening)
        return jnp.concatenate([self.joints, width], axis=-1)


def grasp_table(assets: Sequence[Asset], most: int = 64) -> GraspTable:
    """The annotated grasps that the gripper is wide enough for, `most` of each object.

    Raises:
      InputError: An object has none.
    """
    poses = np.tile(np.eye(4), (len(assets), most, 1, 1))
    valid = np.zeros((len(assets), most), bool)
    for row, asset in enumerate(assets):
        grasps = asset.grasps
        narrow = [] if grasps is None else np.flatnonzero(grasps.widths <= MAX_OPENING - _MARGIN)
        if grasps is None or not len(narrow):
            raise InputError(f"{asset.place}: has no grasps that the gripper is wide enough for")
        chosen = grasps.poses[narrow[:most]]
        poses[row, : len(chosen)] = invert(asset.label.pose) @ chosen
        valid[row, : len(chosen)] = True
    return GraspTable(jnp.asarray(poses, jnp.float32), jnp.asarray(valid))


def reach_poses(
    poses: Float[Array, "n 4 4"],
    starts: Float[Array, "n 7"],
    solver: PureTcpSolver | None = None,
) -> tuple[Float[Array, "n 7"], Float[Array, " n"]]:
    """Joint angles that bring the TCP to poses, or as near as the joint limits allow.

    Args:
      poses: `T_base_tcp`.
      starts: Joint angles to search from [rad].
      solver: How to search.

    Returns:
      Joint angles [rad], and the errors left: position, and turn times the solver's lever [m].
    """
    return jax.vmap((solver or PureTcpSolver()).reach)(poses, starts)


def choose_grasps(
    labels: Float[Array, "worlds 4 4"],
    rows: Int[Array, " worlds"],
    table: GraspTable,
    tried: int = 8,
) -> Choice:
    """Of each world's grasps from above the one that the arm reaches with the least motion from home.

    Args:
      labels: `T_base_label` of the objects.
      rows: Of the objects in the table.
      table: Grasps.
      tried: How many of a world's grasps are solved for: those that come most from above.
    """
    worlds = len(labels)
    grasps = labels[:, None] @ table.poses[rows]
    both = jnp.concatenate([grasps, grasps @ _HALF_TURN.astype(np.float32)], axis=1)
    from_above = jnp.where(jnp.tile(table.valid[rows], 2), -both[..., 2, 2], -jnp.inf)
    height, best = jax.lax.top_k(from_above, tried)
    poses = jnp.take_along_axis(both, best[..., None, None], axis=1)
    home = jnp.asarray(HOME, poses.dtype)
    starts = jnp.broadcast_to(home, (worlds * tried, 7))
    joints, error = reach_poses(poses.reshape(-1, 4, 4), starts)
    joints, error = joints.reshape(worlds, tried, 7), error.reshape(worlds, tried)
    good = (error < REACHED) & jnp.isfinite(height)
    motion = jnp.where(good, jnp.abs(joints - home).sum(-1), 1e3 * (1 + error))
    chosen = jnp.argmin(motion, axis=1)[:, None]

    def of_chosen(values: Array) -> Array:
        index = chosen.reshape(worlds, 1, *(1,) * (values.ndim - 2))
        return jnp.take_along_axis(values, index, axis=1)[:, 0]

    return Choice(of_chosen(joints), of_chosen(poses), of_chosen(error), of_chosen(good))


def estimate_and_choose(
    model: EstimatingModel,
    points: Float[Array, "worlds n 3"],
    normals: Float[Array, "worlds n 3"],
    mask: Bool[Array, "worlds n"],
    cameras: Float[Array, "worlds 4 4"],
    rows: Int[Array, " worlds"],
    table: GraspTable,
    *,
    key: PRNGKeyArray,
) -> tuple[Float[Array, "worlds 4 4"], Choice]:
    """The whole way from clouds to joint angles; nothing leaves the device.

    Args:
      model: Of the pose estimator, such as `PoseEstimator.load("mug").trained.model`.
      points, normals, mask: Clouds of the objects in camera frames; false in the mask: padding.
      cameras: `T_base_camera`, OpenCV's axes.
      rows: Of the objects in the table.
      table: Grasps.
      key: Of what the estimator draws.

    Returns:
      The estimated `T_base_label`, and the grasps chosen with them.
    """
    found = estimate_batch(model, points, normals, mask, key=key)
    labels = cameras @ found.poses[:, 0]
    return labels, choose_grasps(labels, rows, table)
