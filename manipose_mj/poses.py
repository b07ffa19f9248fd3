"""Rigid transforms, symmetry groups and the symmetric pose error.

Every function takes NumPy or JAX arrays and computes in the namespace of what it was given
(Python array API), so that CPU tasks and batched worlds share one definition of success.
Poses are 4x4 matrices `T_ab` with `p_a = T_ab @ p_b`; quaternions are `wxyz`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.small_matrices import product, sum_of_squares

Array = Any  # a NumPy or a JAX array


def namespace(array: Array) -> Any:
    """The array-API namespace of `array`; plain sequences count as NumPy."""
    if isinstance(array, (np.ndarray, np.generic)):  # quicker than to ask
        return np
    get = getattr(array, "__array_namespace__", None)
    return np if get is None else get()


def compose(rotation: Float[Array, "*#b 3 3"], translation: Float[Array, "*#b 3"]) -> Array:
    """The pose with this rotation matrix and translation, shape `(*b, 4, 4)`."""
    xp = namespace(rotation)
    if xp is np and np.ndim(rotation) == 2:  # in less than half the time
        # Laid out in memory as what it is made of, on which the last digit of products depends.
        columns_first = abs(rotation.strides[0]) < abs(rotation.strides[1])
        dtype = np.result_type(rotation, translation)
        pose = np.zeros((4, 4), dtype, order="F" if columns_first else "C")
        pose[:3, :3], pose[:3, 3], pose[3, 3] = rotation, translation, 1.0
        return pose
    top = xp.concat([rotation, translation[..., None]], axis=-1)
    bottom = xp.broadcast_to(
        xp.asarray([[0.0, 0.0, 0.0, 1.0]], dtype=top.dtype), (*top.shape[:-2], 1, 4)
    )
    return xp.concat([top, bottom], axis=-2)


def invert(pose: Float[Array, "*b 4 4"]) -> Float[Array, "*b 4 4"]:
    """The inverse of a rigid transform."""
    xp = namespace(pose)
    rotation = xp.matrix_transpose(pose[..., :3, :3])
    return compose(rotation, -product(rotation, pose[..., :3, 3:])[..., 0])


def transform(pose: Float[Array, "*#b 4 4"], points: Float[Array, "*#b n 3"]) -> Array:
    """Points given in frame b, mapped by `T_ab` into frame a."""
    xp = namespace(pose)
    return points @ xp.matrix_transpose(pose[..., :3, :3]) + pose[..., None, :3, 3]


def quaternion_to_rotation(quaternion: Float[Array, "*b 4"]) -> Float[Array, "*b 3 3"]:
    """The rotation matrix of a `wxyz` quaternion of any non-zero length."""
    xp = namespace(quaternion)
    q = quaternion / xp.sqrt(xp.sum(quaternion**2, axis=-1, keepdims=True))
    w, x, y, z = (q[..., i] for i in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return xp.stack([xp.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_to_quaternion(rotation: Float[Array, "*b 3 3"]) -> Float[Array, "*b 4"]:
    """The `wxyz` quaternion of a rotation matrix, whose w is not negative.

    Of the four formulas that divide by one component each, the one with the largest component
    is taken (Shepperd 1978), without branches.
    """
    xp = namespace(rotation)
    r = rotation
    m = [[r[..., i, j] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    outer = xp.stack(  # four times q q^T, row by row
        [
            xp.stack([1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]], axis=-1),
            xp.stack(
                [
                    m[2][1] - m[1][2],
                    1 + 2 * m[0][0] - trace,
                    m[0][1] + m[1][0],
                    m[0][2] + m[2][0],
                ],
                axis=-1,
            ),
            xp.stack(
                [
                    m[0][2] - m[2][0],
                    m[0][1] + m[1][0],
                    1 + 2 * m[1][1] - trace,
                    m[1][2] + m[2][1],
                ],
                axis=-1,
            ),
            xp.stack(
                [
                    m[1][0] - m[0][1],
                    m[0][2] + m[2][0],
                    m[1][2] + m[2][1],
                    1 + 2 * m[2][2] - trace,
                ],
                axis=-1,
            ),
        ],
        axis=-2,
    )
    diagonal = xp.stack([outer[..., i, i] for i in range(4)], axis=-1)
    best = xp.argmax(diagonal, axis=-1)
    row = xp.take_along_axis(outer, best[..., None, None], axis=-2)[..., 0, :]
    q = row / xp.sqrt(xp.sum(row**2, axis=-1, keepdims=True))
    return xp.where(q[..., :1] < 0, -q, q)


def pose_to_vector(pose: Float[Array, "*b 4 4"]) -> Float[Array, "*b 7"]:
    """Position and `wxyz` quaternion, the order MuJoCo's free joint has."""
    xp = namespace(pose)
    return xp.concat([pose[..., :3, 3], rotation_to_quaternion(pose[..., :3, :3])], axis=-1)


def vector_to_pose(vector: Float[Array, "*b 7"]) -> Float[Array, "*b 4 4"]:
    """The inverse of `pose_to_vector`."""
    return compose(quaternion_to_rotation(vector[..., 3:]), vector[..., :3])


def rotation_about(axis: Float[Array, "3"], angle: float) -> Float[np.ndarray, "3 3"]:
    """The rotation by `angle` [rad] about a unit `axis` (Rodrigues)."""
    x, y, z = np.asarray(axis, float)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def rotation_angle(a: Float[Array, "*#b 3 3"], b: Float[Array, "*#b 3 3"]) -> Float[Array, "*#b"]:
    """The geodesic angle [rad] between two rotations, exact to rounding near 0 as well.

    Uses `|a - b|_F = 2 sqrt(2) sin(angle / 2)`; the trace formula loses half the digits near 0.
    """
    return _angle_of(_squared_chord(a - b))


@dataclass(frozen=True)
class SymmetryGroup:
    """The proper rotations about the label's origin that leave a shape unchanged.

    One group, or one per world: `*b` are batch dimensions. Groups of different sizes are padded with
    identities, which change no minimum over the members.

    Attributes:
      rotations: In the label frame, the identity first.
      axial: Whether every rotation about the label's X belongs to the group as well.
    """

    rotations: Float[Array, "*b n 3 3"]
    axial: bool | Bool[Array, "*b"] = False

    @classmethod
    def stack(cls, groups: Sequence[SymmetryGroup]) -> SymmetryGroup:
        """One batched group of several, along a new first axis, padded to the largest."""
        most = max(group.rotations.shape[-3] for group in groups)
        xp = namespace(groups[0].rotations)
        return cls(
            xp.stack([group.padded(most).rotations for group in groups]),
            xp.stack([xp.asarray(group.axial) for group in groups]),
        )

    def padded(self, members: int) -> SymmetryGroup:
        """The same group as so many rotations; identities are added at the end.

        Raises:
          ValueError: It has more.
        """
        missing = members - self.rotations.shape[-3]
        if missing < 0:
            raise ValueError(f"a group of {self.rotations.shape[-3]} does not fit into {members}")
        xp = namespace(self.rotations)
        shape = (*self.rotations.shape[:-3], missing, 3, 3)
        identities = xp.broadcast_to(xp.eye(3, dtype=self.rotations.dtype), shape)
        return SymmetryGroup(xp.concat([self.rotations, identities], axis=-3), self.axial)

    @classmethod
    def identity(cls) -> SymmetryGroup:
        """No symmetry but the identity: functional tools, one mirror plane."""
        return cls(np.eye(3)[None])

    @classmethod
    def about_x(cls, *, ends_alike: bool = False) -> SymmetryGroup:
        """Every rotation about X, and the flips when both ends look alike."""
        flips = [np.eye(3), np.diag([-1.0, 1.0, -1.0])] if ends_alike else [np.eye(3)]
        return cls(np.stack(flips), axial=True)

    @classmethod
    def two_planes(cls) -> SymmetryGroup:
        """Identity and half a turn about X: planes XY and XZ."""
        return cls(np.stack([np.eye(3), np.diag([1.0, -1.0, -1.0])]))

    @classmethod
    def three_planes(cls) -> SymmetryGroup:
        """The four rotations of a box with three different lengths."""
        signs = [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)]
        return cls(np.stack([np.diag(s) for s in signs]))

    @classmethod
    def generated(cls, generators: Float[np.ndarray, "n 3 3"]) -> SymmetryGroup:
        """The finite group that these rotations generate (a square's quarter turns, say)."""
        members = [np.eye(3)]
        grown = True
        while grown:
            products = [m @ g for m in members for g in generators]
            fresh = [p for p in products if min(rotation_angle(p, m) for m in members) > 1e-3]
            grown = bool(fresh)
            if fresh:
                members.append(fresh[0])
            if len(members) > 60:
                raise ValueError(
                    "these rotations generate more than 60 members; not a finite group"
                )
        return cls(np.stack(members))

    def sampled(self, turns: int = 16) -> Float[np.ndarray, "m 3 3"]:
        """Members of the group as a list; a continuous axis is sampled at `turns` equal angles."""
        if not self.axial:
            return self.rotations
        about_x = [
            rotation_about(np.array([1.0, 0.0, 0.0]), 2 * np.pi * i / turns) for i in range(turns)
        ]
        return np.stack([member @ turn for member in self.rotations for turn in about_x])


def pose_error(
    estimate: Float[Array, "*#b 4 4"], truth: Float[Array, "*#b 4 4"], symmetry: SymmetryGroup
) -> tuple[Float[Array, "*#b"], Float[Array, "*#b"]]:
    """Translation [m] and rotation [rad] error of a label pose, the least over the symmetry group.

    Translation is between label origins, which no symmetry moves. Rotation is the geodesic angle;
    where X is an axis of revolution, the angle between the axes (closed form of the minimum).
    Batch dimensions of poses and group broadcast.
    """
    xp = namespace(estimate)
    translation = xp.sqrt(xp.sum((estimate[..., :3, 3] - truth[..., :3, 3]) ** 2, axis=-1))
    rotations = xp.asarray(symmetry.rotations, dtype=truth.dtype)
    equivalents = product(truth[..., None, :3, :3], rotations)
    apart = estimate[..., None, :3, :3] - equivalents
    if symmetry.axial is True:
        squares = _squared_axis_chord(apart)
    else:
        squares = _squared_chord(apart)
        if symmetry.axial is not False:  # differs between worlds, or is not known before it runs
            axial = xp.asarray(symmetry.axial)[..., None]
            squares = xp.where(axial, _squared_axis_chord(apart), squares)
    # The angle grows with the chord, so one arc sine does for the whole group.
    return translation, _angle_of(xp.min(squares, axis=-1))


def _squared_chord(apart: Float[Array, "*b 3 3"]) -> Float[Array, "*b"]:
    """Of the angle between two rotations, by their difference, on a circle of diameter 1."""
    return sum_of_squares(apart, axes=2) / 8


def _squared_axis_chord(apart: Float[Array, "*b 3 3"]) -> Float[Array, "*b"]:
    """Of the angle between the X axes of two rotations, on the same circle."""
    return sum_of_squares(apart[..., 0]) / 4


def _angle_of(squared_chord: Float[Array, "*b"]) -> Float[Array, "*b"]:
    xp = namespace(squared_chord)
    return 2 * xp.asin(xp.clip(xp.sqrt(squared_chord), 0.0, 1.0))
