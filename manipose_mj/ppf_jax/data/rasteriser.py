"""Depth images of triangle meshes by scan conversion: no GL, exact at pixel centres.

For the few thousand small triangles of one object this is several times faster than casting a ray
through each pixel, and sees the same (a test holds it against the ray camera).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int

from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import transform

NEAR = 0.02  # triangles that reach nearer than this are left out [m]
NOTHING = -1


@dataclass(frozen=True)
class Triangles:
    """A mesh as the rasteriser wants it.

    Attributes:
      corners: `(f, 3, 3)` float64 [m], mesh frame.
      closed: Whether faces turned away from the camera are always hidden by others.
    """

    corners: Float[np.ndarray, "f 3 3"]
    closed: bool

    @classmethod
    def of_mesh(cls, mesh: trimesh.Trimesh) -> Triangles:
        """The faces of a mesh; those seen from behind are drawn as well if it has holes."""
        welded = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
        return cls(np.asarray(mesh.triangles, float), bool(welded.is_volume))


@dataclass(frozen=True)
class Raster:
    """What a camera sees, pixel by pixel.

    Attributes:
      depth: `(height, width)` [m], along the optical axis; 0 where nothing is.
      item: `(height, width)` int32, which of the drawn meshes; -1 where nothing is.
      normal: `(height, width, 3)`, of the triangle, camera frame, towards the camera; 0 where
        nothing is.
    """

    depth: Float[np.ndarray, "height width"]
    item: Int[np.ndarray, "height width"]
    normal: Float[np.ndarray, "height width 3"]


def rasterise(
    items: list[tuple[Triangles, Float[np.ndarray, "4 4"]]], intrinsics: Intrinsics
) -> Raster:
    """Draw meshes, the nearest surface in every pixel.

    Args:
      items: Each mesh with its `T_camera_mesh` (camera frame of OpenCV).
      intrinsics: Of the image, or of the window of an image that is to be drawn.
    """
    corners, owner = [], []
    for index, (triangles, pose) in enumerate(items):
        placed = transform(pose, triangles.corners.reshape(-1, 3)).reshape(-1, 3, 3)
        shown = placed[..., 2].min(axis=1) > NEAR
        if triangles.closed:
            shown &= _facing(placed)
        corners.append(placed[shown])
        owner.append(np.full(int(shown.sum()), index, np.int32))
    return _draw(np.concatenate(corners), np.concatenate(owner), intrinsics)


def pixel_rays(intrinsics: Intrinsics) -> Float[np.ndarray, "height width 3"]:
    """The ray through each pixel's centre, camera frame, with z = 1."""
    slopes = intrinsics.slopes()
    return np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=-1)


def _facing(corners: Float[np.ndarray, "f 3 3"]) -> np.ndarray:
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.einsum("fi,fi->f", np.cross(b - a, c - a), a) < 0


def _draw(
    corners: Float[np.ndarray, "f 3 3"], owner: Int[np.ndarray, "f"], intrinsics: Intrinsics
) -> Raster:
    height, width = intrinsics.height, intrinsics.width
    u = intrinsics.fx * corners[..., 0] / corners[..., 2] + intrinsics.cx
    v = intrinsics.fy * corners[..., 1] / corners[..., 2] + intrinsics.cy
    # A plane has 1 / z affine in the pixel: normal . (slope, 1) / (normal . corner).
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    offset = np.einsum("fi,fi->f", normal, corners[:, 0])
    face, row = _rows(v, offset != 0, height)
    left, right = _spans(u[face], v[face], row)
    first = np.maximum(np.ceil(left), 0).astype(np.int64)
    count = np.minimum(np.floor(right), width - 1).astype(np.int64) - first + 1
    span, column = _ranges(first, count)
    face, row = face[span], row[span]
    slope_x, slope_y = (
        (column - intrinsics.cx) / intrinsics.fx,
        (row - intrinsics.cy) / intrinsics.fy,
    )
    n = normal[face]
    inverse = (n[:, 0] * slope_x + n[:, 1] * slope_y + n[:, 2]) / offset[face]
    # Of repeated indices NumPy keeps the last value: the nearest, after sorting.
    order = np.argsort(inverse, kind="stable")
    pixel = (row * width + column)[order]
    winner = np.full(height * width, NOTHING, np.int64)
    winner[pixel] = order
    seen = np.flatnonzero(winner >= 0)
    best = winner[seen]
    depth, item = np.zeros(height * width), np.full(height * width, NOTHING, np.int32)
    towards = np.zeros((height * width, 3))
    depth[seen], item[seen] = 1.0 / inverse[best], owner[face[best]]
    chosen = n[best]
    chosen /= -np.sign(offset[face[best]])[:, None] * np.linalg.norm(chosen, axis=1, keepdims=True)
    towards[seen] = chosen
    shape = (height, width)
    return Raster(depth.reshape(shape), item.reshape(shape), towards.reshape(*shape, 3))


def _rows(
    v: Float[np.ndarray, "f 3"], kept: np.ndarray, height: int
) -> tuple[np.ndarray, np.ndarray]:
    """Face and image row of every crossing of a triangle with a row of pixel centres."""
    first = np.maximum(np.ceil(v.min(axis=1)), 0).astype(np.int64)
    last = np.minimum(np.floor(v.max(axis=1)), height - 1).astype(np.int64)
    return _ranges(first, np.where(kept, last - first + 1, 0))


def _spans(
    u: Float[np.ndarray, "r 3"], v: Float[np.ndarray, "r 3"], row: Int[np.ndarray, "r"]
) -> tuple[np.ndarray, np.ndarray]:
    """Where each triangle's outline crosses the row: its first and last abscissa."""
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for i in range(3):
        u0, v0, u1, v1 = u[:, i], v[:, i], u[:, i - 1], v[:, i - 1]
        rise = v1 - v0
        level = rise == 0
        share = (row - v0) / np.where(level, 1.0, rise)
        crossed = ~level & (share >= 0) & (share <= 1)
        x = u0 + share * (u1 - u0)
        left = np.where(crossed, np.minimum(left, x), left)
        right = np.where(crossed, np.maximum(right, x), right)
    empty = left > right
    return np.where(empty, 0.0, left), np.where(empty, -1.0, right)


def _ranges(first: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The numbers `first[i] ... first[i] + count[i] - 1` of all ranges, each with its range's index."""
    count = np.maximum(count, 0)
    index = np.repeat(np.arange(len(first)), count)
    start = np.cumsum(count) - count
    return index, np.arange(len(index)) - start[index] + first[index]
