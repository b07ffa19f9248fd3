"""Ways an object can rest: which stable poses tasks start and end in, and which grasps join them."""

from __future__ import annotations

from math import cos, radians

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.robot import MAX_OPENING
from manipose_mj.poses import compose, rotation_about

# Stable poses rarer than this come up only if they are upright or upside down.
MIN_PROBABILITY = 0.02
# So many annotated grasps clear of the table in both poses make a move from one to the other.
MIN_SHARED_GRASPS = 5
# Placements on the way between start and goal, at most.
MAX_PLACEMENTS = 2
_UPRIGHT = cos(radians(10))


def require_graspable(asset: Asset) -> None:
    """Refuse what the gripper cannot hold in any stable pose.

    Raises:
      InputError: It is too wide, or no grasp of it is known.
    """
    if asset.kind != "rigid":
        raise InputError(f"{asset.place}: is an {asset.kind} asset; expected a rigid one")
    if asset.grasps is not None and asset.grasps.clear.any():
        return
    width, limit = float(min(asset.label.extents)), MAX_OPENING
    if width > limit:
        raise InputError(
            f"{asset.place}: too large for the gripper: {width * 1000:.0f} mm wide at its "
            f"narrowest, the gripper opens {limit * 1000:.0f} mm"
        )
    raise InputError(
        f"{asset.place}: {width * 1000:.0f} mm wide, has no grasp that is clear of the table in any "
        "stable pose; choose one that `manipose assets list` shows as graspable"
    )


def pose_on_table(
    asset: Asset,
    stable: int,
    label_xy: Float[np.ndarray, "2"],
    yaw: float,
    surface: float = 0.0,
) -> Float[np.ndarray, "4 4"]:
    """`T_world_object` in this stable pose, turned by `yaw`, the label's origin over `label_xy`.

    Args:
      asset: What rests.
      stable: Index of the stable pose.
      label_xy: In the world [m].
      yaw: About the vertical [rad].
      surface: Height of what it rests on [m].
    """
    rest = asset.stable_poses[stable]
    rotation = rotation_about(np.array([0.0, 0.0, 1.0]), yaw) @ rest.rotation
    offset = rotation @ asset.label.origin
    return compose(rotation, np.array([*(label_xy - offset[:2]), surface + rest.height]))


def label_ups(asset: Asset) -> Float[np.ndarray, "s 3"]:
    """The vertical in the label frame, for each stable pose."""
    return np.stack([pose.rotation[2] @ asset.label.rotation for pose in asset.stable_poses])


def resting_in_use(asset: Asset) -> list[int]:
    """Stable poses that come up in real use: the likely ones, and upright and upside down."""
    upright = np.abs(label_ups(asset)[:, 0]) > _UPRIGHT
    return [
        index
        for index, pose in enumerate(asset.stable_poses)
        if pose.probability >= MIN_PROBABILITY or upright[index]
    ]


def usable_poses(asset: Asset) -> list[int]:
    """Stable poses that come up in real use and in which the gripper can take the object."""
    assert asset.grasps is not None
    return [
        index
        for index in resting_in_use(asset)
        if asset.grasps.clear[:, index].sum() >= MIN_SHARED_GRASPS
    ]


def upright_poses(asset: Asset) -> list[int]:
    """Stable poses with the label's X, the object's up, pointing up."""
    return [int(i) for i in np.flatnonzero(label_ups(asset)[:, 0] > _UPRIGHT)]


def placements_between(asset: Asset) -> Int[np.ndarray, "s s"]:
    """How often the object must be set down on the way from one stable pose to another.

    0 where one grasp is clear of the table in both poses, -1 where no more than `MAX_PLACEMENTS`
    would do. Only the object and the table count: the arm may need more.
    """
    assert asset.grasps is not None
    return placements_joining(asset.grasps.clear, MIN_SHARED_GRASPS)


def placements_joining(clear: Bool[np.ndarray, "n s"], least: int) -> Int[np.ndarray, "s s"]:
    """`placements_between` of grasps that are `clear` in stable poses, where `least` of them make a move."""
    count_clear = clear.astype(int)
    joined = (count_clear.T @ count_clear) >= least
    needed = np.where(joined, 0, -1)
    reached = joined
    for count in range(1, MAX_PLACEMENTS + 1):
        further = (reached.astype(int) @ joined.astype(int)) > 0
        needed[further & (needed < 0)] = count
        reached = reached | further
    return needed
