"""Partial clouds with their labels, and the padded batches that networks are fed with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup

Array = Any  # a NumPy or a JAX array

MAX_POINTS = 1024  # of a cloud as it is kept
SAMPLE_POINTS = 256  # of a cloud as the network sees it


@dataclass(frozen=True)
class LabelledCloud:
    """What one camera saw of one object, and where the object's label was.

    Attributes:
      points: `(n, 3)` float32 [m], camera frame (OpenCV's: x right, y down, z forward).
      normals: `(n, 3)` float32, unit, towards the camera.
      pose: `(4, 4)` float32, `T_camera_label`.
      extents: `(3,)` float32 [m], the bounding box along the label's axes.
      symmetry: Proper rotations, in the label frame, that leave the shape unchanged.
      name: The object and the view, `mug_003/17`.
      category: What estimators are told.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    pose: Float[np.ndarray, "4 4"]
    extents: Float[np.ndarray, "3"]
    symmetry: SymmetryGroup
    name: str
    category: str

    def __len__(self) -> int:
        return len(self.points)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class CloudBatch:
    """Clouds of one padded size; a pytree whose leaves are NumPy arrays or JAX's.

    Attributes:
      points: `(b, n, 3)` float32 [m], camera frames; 0 in padding.
      normals: `(b, n, 3)` float32, unit, towards the camera; 0 in padding.
      mask: `(b, n)`, true for points, false for padding, which comes last.
      pose: `(b, 4, 4)` float32, `T_camera_label`.
      extents: `(b, 3)` float32 [m].
      turns: `(b, k, 3, 3)` float32, the discrete members of the symmetry groups, the identity
        first; identities in padding.
      turn_mask: `(b, k)`, true for members, false for padding.
      axial: `(b,)`, whether every turn about the label's X belongs to the group as well.
    """

    points: Float[Array, "b n 3"]
    normals: Float[Array, "b n 3"]
    mask: Bool[Array, "b n"]
    pose: Float[Array, "b 4 4"]
    extents: Float[Array, "b 3"]
    turns: Float[Array, "b k 3 3"]
    turn_mask: Bool[Array, "b k"]
    axial: Bool[Array, "b"]

    def __len__(self) -> int:
        return len(self.points)


def most_turns(clouds: Sequence[LabelledCloud]) -> int:
    """The size of the largest discrete part of the clouds' symmetry groups, at least 1."""
    return max((len(cloud.symmetry.rotations) for cloud in clouds), default=1)


def batch_clouds(
    clouds: Sequence[LabelledCloud],
    *,
    rng: np.random.Generator,
    points: int = SAMPLE_POINTS,
    turns: int | None = None,
) -> CloudBatch:
    """A batch with `points` random points of every cloud, or all of a smaller one and padding.

    Args:
      clouds: At least one.
      rng: Draws the points, and so their order.
      points: Rows of each cloud.
      turns: Rows of each symmetry group, so that all batches of a training have one shape; as many
        as the largest needs if not given.

    Raises:
      InputError: No clouds, an empty one, or a group larger than `turns`.
    """
    if not clouds:
        raise InputError("no clouds to batch; expected at least one")
    members = most_turns(clouds)
    turns = members if turns is None else turns
    if members > turns:
        raise InputError(f"a symmetry group has {members} members; the batch has room for {turns}")
    count = len(clouds)
    xyz, normals = np.zeros((2, count, points, 3), np.float32)
    mask = np.zeros((count, points), bool)
    groups = np.tile(np.eye(3, dtype=np.float32), (count, turns, 1, 1))
    group_mask = np.zeros((count, turns), bool)
    for i, cloud in enumerate(clouds):
        if not len(cloud):
            raise InputError(f"{cloud.name}: the cloud has no points")
        rows = rng.permutation(len(cloud))[:points]
        xyz[i, : len(rows)], normals[i, : len(rows)] = cloud.points[rows], cloud.normals[rows]
        mask[i, : len(rows)] = True
        size = len(cloud.symmetry.rotations)
        groups[i, :size], group_mask[i, :size] = cloud.symmetry.rotations, True
    return CloudBatch(
        points=xyz,
        normals=normals,
        mask=mask,
        pose=np.stack([cloud.pose for cloud in clouds]).astype(np.float32),
        extents=np.stack([cloud.extents for cloud in clouds]).astype(np.float32),
        turns=groups,
        turn_mask=group_mask,
        axial=np.array([cloud.symmetry.axial for cloud in clouds]),
    )
