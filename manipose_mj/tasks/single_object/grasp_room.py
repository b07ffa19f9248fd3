"""Whether the hand finds room at a shelf: a quick check of annotated grasps, without solving for the arm."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import StablePose
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.grasp_choice import clear_of_plane
from manipose_mj.mjcf.panda.forearm import LINK_RADII, links_behind
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
_POINT = np.zeros(1)


def grasps_with_room(
    tcp_poses: Float[np.ndarray, "n 4 4"],
    shelf_pose: Float[np.ndarray, "4 4"],
    config: ShelfConfig,
    level: int | None,
) -> Bool[np.ndarray, "n"]:
    """Which grasps the hand can come to, as far as the shelf and the arm's length are concerned.

    So far as it takes room behind the hand the arm is looked at too: forearm and wrist, one way of them at least.

    Args:
      tcp_poses: `T_world_tcp`.
      shelf_pose: `T_world_shelf`.
      config: Of the shelf.
      level: In which of its levels the object is; None for outside.
    """
    wrists = tcp_poses[:, :3, 3] - _WRIST_BEHIND * tcp_poses[:, :3, 2]
    reach = np.linalg.norm(wrists - _SHOULDER, axis=1)
    room = (reach > _REACH[0]) & (reach < _REACH[1]) & (wrists[:, 2] > 0.05)
    from_shelf = invert(shelf_pose)
    near = from_shelf @ tcp_poses[room]
    hands = transform(near, np.broadcast_to(_HAND_POINTS, (len(near), *_HAND_POINTS.shape)))
    room[room] = ~_in_wood(hands, config, level).any(axis=1)
    for back in (0.0, _BACK_OFF):
        at = tcp_poses[room]
        at[:, :3, 3] -= back * at[:, :3, 2]
        owner, links = links_behind(at)
        free = ~_in_wood(transform(from_shelf, links), config, level, LINK_RADII).any(axis=1)
        room[room] = np.bincount(owner[free], minlength=len(at)) > 0
    return room


def above_floor(
    tcp_poses: Float[np.ndarray, "n 4 4"], widths: Float[np.ndarray, "n"], floor: float
) -> Bool[np.ndarray, "n"]:
    """Whether the open hand, at grasps `T_world_tcp` of these widths [m] and back, is over a floor at this height [m]."""
    lying = StablePose(np.eye(3), -floor, 1.0)
    return clear_of_plane(tcp_poses, widths, (lying,), ParallelJaw())[:, 0]


def _in_wood(
    points: Float[np.ndarray, "n p 3"],
    config: ShelfConfig,
    level: int | None,
    radii: Float[np.ndarray, "#p"] = _POINT,
) -> Bool[np.ndarray, "n p"]:
    """Whether balls in the shelf's frame are in it, or between its front and back but not in the one level."""
    x, y, z = np.moveaxis(points, -1, 0)
    between = (x > -radii) & (x < config.depth + radii)
    if level is None:
        return between & (np.abs(y) < config.width / 2 + radii) & (z < config.boards[-1] + radii)
    floor, height = config.levels[level]
    free = np.abs(y) < config.width / 2 - config.thickness - radii
    return between & ~(free & (z > floor + radii) & (z < floor + height - radii))


def _slices(half: tuple[float, float], ends: tuple[float, float]) -> Float[np.ndarray, "p 3"]:
    xs, ys = np.array([-1.0, 1.0]) * half[0], np.linspace(-1.0, 1.0, 3) * half[1]
    zs = np.linspace(*ends, _SLICES)
    return np.stack(np.meshgrid(xs, ys, zs), -1).reshape(-1, 3)


_AT_GRASP = np.concatenate([_slices(*_HAND), _slices(*_WRIST)])
_HAND_POINTS = np.concatenate([_AT_GRASP, _AT_GRASP - [0.0, 0.0, _BACK_OFF]])
