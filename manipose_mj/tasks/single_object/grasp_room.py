"""Whether the hand finds room at a shelf: a quick check of annotated grasps, without an arm."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.mjcf.shelf import ShelfConfig
from manipose_mj.poses import invert, transform

# The hand with its wrist, half its lengths along x and y of the tcp frame, and from where to where
# along z [m]; a bit more than the boxes that grasps are sampled with.
_HAND = ((0.035, 0.110), (-0.115, -0.035))
_WRIST = ((0.060, 0.060), (-0.230, -0.100))
_SLICES = 5  # of each, where its edges are looked at
_BACK_OFF = 0.08  # the approach begins so far back [m]
# From the shoulder to the wrist, whose centre is so far behind the tcp [m]: the arm's reach, less what
# it needs to move.
_WRIST_BEHIND = 0.21
_SHOULDER = np.array([0.0, 0.0, 0.333])
_REACH = (0.25, 0.74)


def grasps_with_room(
    tcp_poses: Float[np.ndarray, "n 4 4"],
    shelf_pose: Float[np.ndarray, "4 4"],
    config: ShelfConfig,
    level: int | None,
) -> Bool[np.ndarray, "n"]:
    """Which grasps the hand can come to, as far as the shelf and the arm's length are concerned.

    Args:
      tcp_poses: `T_world_tcp`.
      shelf_pose: `T_world_shelf`.
      config: Of the shelf.
      level: In which of its levels the object is; None for outside.
    """
    wrists = tcp_poses[:, :3, 3] - _WRIST_BEHIND * tcp_poses[:, :3, 2]
    reach = np.linalg.norm(wrists - _SHOULDER, axis=1)
    room = (reach > _REACH[0]) & (reach < _REACH[1]) & (wrists[:, 2] > 0.05)
    near = invert(shelf_pose) @ tcp_poses[room]
    points = transform(near, np.broadcast_to(_HAND_POINTS, (len(near), *_HAND_POINTS.shape)))
    room[room] = ~_in_wood(points, config, level).any(axis=1)
    return room


def _in_wood(
    points: Float[np.ndarray, "n p 3"], config: ShelfConfig, level: int | None
) -> Bool[np.ndarray, "n p"]:
    """Whether points of the shelf's frame are in it, but for the free space of one level."""
    x, y, z = np.moveaxis(points, -1, 0)
    inside = (x > 0) & (np.abs(y) < config.width / 2) & (z < config.boards[-1])
    if level is None:
        return inside & (x < config.depth)
    floor, height = config.levels[level]
    free = (x < config.depth) & (np.abs(y) < config.width / 2 - config.thickness)
    free &= (z > floor) & (z < floor + height)
    return inside & ~free


def _slices(half: tuple[float, float], ends: tuple[float, float]) -> Float[np.ndarray, "p 3"]:
    xs, ys = np.array([-1.0, 1.0]) * half[0], np.linspace(-1.0, 1.0, 3) * half[1]
    zs = np.linspace(*ends, _SLICES)
    return np.stack(np.meshgrid(xs, ys, zs), -1).reshape(-1, 3)


_AT_GRASP = np.concatenate([_slices(*_HAND), _slices(*_WRIST)])
_HAND_POINTS = np.concatenate([_AT_GRASP, _AT_GRASP - [0.0, 0.0, _BACK_OFF]])
