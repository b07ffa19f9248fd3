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
    """What one camera saw of one object, or several together, and where the object's label was.

    Attributes:
      points: `(n, 3)` float32 [m], camera frame (OpenCV's: x right, y down, z forward); of several cameras, the
        frame of one of them.
      normals: `(n, 3)` float32, unit, towards the camera that saw the point.
      pose: `(4, 4)` float32, `T_camera_label`.
      extents: `(3,)` float32 [m], the bounding box along the label's axes.
      symmetry: Proper rotations, in the label frame, that leave the shape unchanged.
      name: The object and the view, `mug_003/17`.
      category: What estimators are told.
      eyes: `(n, 3)` float32 [m], where the camera that saw each point is; None where that is the origin.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    pose: Float[np.ndarray, "4 4"]
    extents: Float[np.ndarray, "3"]
    symmetry: SymmetryGroup
    name: str
    category: str
    eyes: Float[np.ndarray, "n 3"] | None = None

    def __len__(self) -> int:
        return len(self.points)


@jax.tree_util.register_pytree_node_class
@dataclass(frozen=True)
class CloudBatch:
    """Clouds of one padded size; a pytree whose leaves are NumPy arrays or JAX's.

    Attributes:
      points: `(b, n, 3)` float32 [m], camera frames; 0 in padding.
      normals: `(b, n, 3)` float32, unit, towards the camera; 0 in padding.
      eyes: `(b, n, 3)` float32 [m], where the camera that saw each point is.
      mask: `(b, n)`, true for points, false for padding, which comes last.
      pose: `(b, 4, 4)` float32, `T_camera_label`.
      extents: `(b, 3)` float32 [m].
      symmetry: One group a cloud, stacked: `(b, k, 3, 3)` float32 rotations, padded with identities, and
        `(b,)` axial.
    """

    points: Float[Array, "b n 3"]
    normals: Float[Array, "b n 3"]
    eyes: Float[Array, "b n 3"]
    mask: Bool[Array, "b n"]
    pose: Float[Array, "b 4 4"]
    extents: Float[Array, "b 3"]
    symmetry: SymmetryGroup

    def __len__(self) -> int:
        return len(self.points)

    def tree_flatten(self) -> tuple[tuple[Array, ...], None]:
        """The arrays; those of the symmetry group one by one, for it knows nothing of JAX."""
        own = (self.points, self.normals, self.eyes, self.mask, self.pose, self.extents)
        return (*own, self.symmetry.rotations, self.symmetry.axial), None

    @classmethod
    def tree_unflatten(cls, _: None, arrays: tuple[Array, ...]) -> CloudBatch:
        """The inverse of `tree_flatten`."""
        *own, rotations, axial = arrays
        return cls(*own, symmetry=SymmetryGroup(rotations, axial))


def most_members(clouds: Sequence[LabelledCloud]) -> int:
    """The size of the largest discrete part of the clouds' symmetry groups, at least 1."""
    return max((len(cloud.symmetry.rotations) for cloud in clouds), default=1)


def batch_clouds(
    clouds: Sequence[LabelledCloud],
    *,
    rng: np.random.Generator,
    points: int = SAMPLE_POINTS,
    members: int | None = None,
) -> CloudBatch:
    """A batch with `points` random points of every cloud, or all of a smaller one and padding.

    Args:
      clouds: At least one.
      rng: Draws the points, and so their order.
      points: Rows of each cloud.
      members: Rows of each symmetry group, so that all batches of a training have one shape; as many
        as the largest needs if not given.

    Raises:
      InputError: No clouds, an empty one, or a group larger than `members`.
    """
    if not clouds:
        raise InputError("no clouds to batch; expected at least one")
    most = most_members(clouds)
    members = most if members is None else members
    if most > members:
        raise InputError(f"a symmetry group has {most} members; the batch has room for {members}")
    count = len(clouds)
    xyz, normals, eyes = np.zeros((3, count, points, 3), np.float32)
    mask = np.zeros((count, points), bool)
    groups = SymmetryGroup.stack([cloud.symmetry for cloud in clouds]).padded(members)
    for i, cloud in enumerate(clouds):
        if not len(cloud):
            raise InputError(f"{cloud.name}: the cloud has no points")
        rows = rng.permutation(len(cloud))[:points]
        xyz[i, : len(rows)], normals[i, : len(rows)] = cloud.points[rows], cloud.normals[rows]
        if cloud.eyes is not None:
            eyes[i, : len(rows)] = cloud.eyes[rows]
        mask[i, : len(rows)] = True
    return CloudBatch(
        points=xyz,
        normals=normals,
        eyes=eyes,
        mask=mask,
        pose=np.stack([cloud.pose for cloud in clouds]).astype(np.float32),
        extents=np.stack([cloud.extents for cloud in clouds]).astype(np.float32),
        symmetry=SymmetryGroup(groups.rotations.astype(np.float32), groups.axial),
    )
