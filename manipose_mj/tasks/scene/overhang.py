"""Resting over the table's edge: there the hand has room beneath what lies on its rim.

A plate upside down lies on its rim, and so would the fingers that hold it there. Over the edge they come from below,
with the near side lifted a little; let go, it sinks onto them, and they leave downwards.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Asset, GraspSet
from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.assets.label import PoseLabel
from manipose_mj.grasp_sampling.gripper_clearance import STANDOFF
from manipose_mj.mjcf.arena import TABLE_CENTER, TABLE_HALF_EXTENTS
from manipose_mj.poses import invert, rotation_about, transform
from manipose_mj.tasks.scene.resting import (
    placements_between,
    resting_in_use,
    usable_poses,
)

_OVER = 0.85  # share of half its length by which an object lies over the edge: its middle stays on the table
# The edge behind the robot: of the four it is the one that the arm reaches around. Beside its base, along the edge [m].
_EDGE_X = TABLE_CENTER[0] - TABLE_HALF_EXTENTS[0]
_BESIDE = (0.40, 0.50, 0.32, 0.60)
_LIFTS = tuple(
    float(angle) for angle in np.radians((5, 10, 15, 20))
)  # of the near side, before it is let go
_ENOUGH = 40  # grasps with room for the hand, of which the arm can have some
_UPWARDS = 0.2  # of an approach from below [sine]
_CLEARANCE = 0.003  # of the hand from the table [m]
_CORNERS = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_YAWS = np.linspace(0.0, 2 * np.pi, 8, endpoint=False)


def poses_over_edge(
    label: PoseLabel, rotation: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "lifts places 4 4"]:
    """`T_world_label` over the edge behind the robot, the side there lifted more and more.

    Args:
      label: Of the object; it touches the table with its bounding box, or with its cylinder.
      rotation: `R_world_label` once it is let go.
    """
    x = _EDGE_X + (1 - _OVER) * label.reach(rotation)[0]
    found = np.tile(np.eye(4), (len(_LIFTS), 2 * len(_BESIDE), 1, 1))
    for k, lift in enumerate(_LIFTS):
        lifted = rotation_about(np.array([0.0, 1.0, 0.0]), lift) @ rotation
        ats = [(x, side * y, label.reach(lifted)[2]) for y in _BESIDE for side in (1.0, -1.0)]
        found[k, :, :3, :3], found[k, :, :3, 3] = lifted, np.array(ats) - lifted @ label.center
    return found


def edge_pairs(asset: Asset) -> list[tuple[int, int]]:
    """Stable poses in which the gripper takes the object, each with one to which it brings it over the table's edge only."""
    assert asset.grasps is not None
    usable, needed = usable_poses(asset), placements_between(asset)
    return [
        (start, goal)
        for start in usable
        for goal in resting_in_use(asset)
        if needed[start, goal] < 0
        and lifts_with_room(
            asset.label,
            asset.stable_poses[goal].rotation @ asset.label.rotation,
            asset.grasps,
            start,
        )
    ]


def lifts_with_room(
    label: PoseLabel, rotation: Float[np.ndarray, "3 3"], grasps: GraspSet, start: int
) -> tuple[int, ...]:
    """At which lifts of `poses_over_edge` enough grasps leave the hand room, the least lift first.

    Args:
      label: Of the object.
      rotation: `R_world_label` once it is let go; turns about the vertical count as the same.
      grasps: Of the object.
      start: Index of the stable pose that it is taken from.
    """
    kept = grasps.clear[:, start].astype(bool)
    kept &= grasps.widths < MAX_OPENING - ParallelJaw().min_clearance
    in_label, widths = invert(label.pose) @ grasps.poses[kept], grasps.widths[kept]
    room = np.zeros((len(_LIFTS), len(widths)), bool)
    for yaw in _YAWS:
        turned = rotation_about(np.array([0.0, 0.0, 1.0]), yaw) @ rotation
        for lift, label_pose in enumerate(poses_over_edge(label, turned)[:, 0]):
            room[lift] |= _clear_over_edge(label_pose @ in_label, widths)
    return tuple(np.flatnonzero(room.sum(axis=1) >= _ENOUGH).tolist())


def _clear_over_edge(
    tcp_poses: Float[np.ndarray, "n 4 4"], widths: Float[np.ndarray, "n"]
) -> Bool[np.ndarray, "n"]:
    """Whether each box of the open hand, at the grasp and 10 cm back, is above the table or beyond its edge."""
    gripper = ParallelJaw()
    boxes = gripper.boxes(gripper.opening(widths))
    low, high = boxes[:, :, None, 0], boxes[:, :, None, 1]
    corners = transform(tcp_poses[:, None], low + _CORNERS * (high - low))
    back = corners - STANDOFF * tcp_poses[:, None, None, :3, 2]
    over = np.minimum(corners[..., 2], back[..., 2]).min(axis=2) > _CLEARANCE
    beyond = np.maximum(corners[..., 0], back[..., 0]).max(axis=2) < _EDGE_X - _CLEARANCE
    return (over | beyond).all(axis=1)


def from_below(tcp_pose: Float[np.ndarray, "4 4"]) -> bool:
    """Whether a hand at `T_world_tcp` points up beyond the table's edge."""
    return bool(tcp_pose[0, 3] < _EDGE_X and tcp_pose[2, 2] > _UPWARDS)
