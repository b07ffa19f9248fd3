"""Depth images to world point clouds of a fixed size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int, UInt8

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.mjcf.cameras.ray_casting import rotated

NO_INSTANCE = -1
_STEEPEST = 4.0  # depth step between neighbours, in footprints, that ends a surface: 76 deg
_CREASE = 0.7  # change of that step from which the two sides are not averaged


@dataclass(frozen=True)
class PointCloud:
    """Points seen by one or more cameras.

    Attributes:
      points_world: `(n, 3)` float32 [m].
      normals_world: `(n, 3)` float32, unit, towards the camera that saw the point; zero where
        unknown.
      colours: `(n, 3)` uint8, red, green, blue as displays take them; black where unknown.
      instance: `(n,)` int32, which object the point is on; -1 marks padding.
    """

    points_world: Float[np.ndarray, "n 3"]
    normals_world: Float[np.ndarray, "n 3"]
    colours: UInt8[np.ndarray, "n 3"]
    instance: Int[np.ndarray, "n"]

    def __len__(self) -> int:
        return len(self.points_world)

    @property
    def valid(self) -> np.ndarray:
        """`(n,)` bool: the rows that are points, not padding."""
        return self.instance != NO_INSTANCE

    def of_instance(self, instance: int) -> PointCloud:
        """The points on one object."""
        return self._rows(np.flatnonzero(self.instance == instance))

    def resized(self, count: int) -> PointCloud:
        """Exactly `count` rows, for observations of one shape.

        A larger cloud loses points as `subset` says; a smaller one is padded with rows of zeros and
        instance -1. Order is kept; padding comes last.

        Raises:
          InputError: `count` is not positive.
        """
        if count < 1:
            raise InputError(f"cloud size {count}: expected at least one point")
        cloud = self._points()
        if len(cloud) >= count:
            return cloud._rows(subset(len(cloud), count))
        padding = count - len(cloud)
        return PointCloud(
            np.pad(cloud.points_world, ((0, padding), (0, 0))),
            np.pad(cloud.normals_world, ((0, padding), (0, 0))),
            np.pad(cloud.colours, ((0, padding), (0, 0))),
            np.pad(cloud.instance, (0, padding), constant_values=NO_INSTANCE),
        )

    def _points(self) -> PointCloud:
        """Itself without padding."""
        valid = self.valid
        return self if valid.all() else self._rows(np.flatnonzero(valid))

    def _rows(self, rows: Int[np.ndarray, "m"]) -> PointCloud:
        return PointCloud(
            self.points_world[rows],
            self.normals_world[rows],
            self.colours[rows],
            self.instance[rows],
        )


def subset(size: int, count: int) -> Int[np.ndarray, "n"]:
    """At most `count` of `size` rows, in their order.

    They are drawn by a permutation that depends on the size alone, so equal clouds give equal
    observations and no random state is touched.
    """
    if size <= count:
        return np.arange(size)
    return np.sort(np.random.default_rng(size).permutation(size)[:count])


def cloud_from_depth(
    depth: Float[np.ndarray, "height width"],
    instance: Int[np.ndarray, "height width"],
    intrinsics: Intrinsics,
    T_world_camera: Float[np.ndarray, "4 4"],
    *,
    normal: Float[np.ndarray, "height width 3"] | None = None,
    colour: UInt8[np.ndarray, "height width 3"] | None = None,
) -> PointCloud:
    """The points of the pixels that have a depth and an instance.

    Args:
      depth: Along the optical axis [m]; 0, negative or not finite means nothing was seen.
      instance: Per pixel, as from `pixel_instances`; negative pixels are left out.
      intrinsics: Of an image of this size.
      T_world_camera: Camera frame of OpenCV (x right, y down, z forward), as from `camera_pose`.
      normal: World normals; estimated from the depth's differences if not given.
      colour: Of the pixels; black if not given.

    Raises:
      InputError: An image's shape is not that of the intrinsics.
    """
    shape = (intrinsics.height, intrinsics.width)
    images = {"depth": depth, "instance": instance, "normal": normal, "colour": colour}
    for name, image in images.items():
        if image is not None and image.shape[:2] != shape:
            raise InputError(f"{name} image is {image.shape[:2]}; the intrinsics say {shape}")
    kept = np.isfinite(depth) & (depth > 0) & (instance >= 0)
    keep = np.flatnonzero(kept.ravel())
    if normal is None:
        rays = np.concatenate([intrinsics.slopes(), np.ones((*shape, 1))], axis=-1)
        estimated = normals_from_points(rays * np.where(kept, depth, 0.0)[..., None])
        normals = rotated(estimated.reshape(-1, 3)[keep], T_world_camera[:3, :3])
    else:
        normals = normal.reshape(-1, 3)[keep]
    slopes = intrinsics.slopes().reshape(-1, 2)[keep]
    rays = np.concatenate([slopes, np.ones((len(keep), 1))], axis=1)
    rays *= depth.ravel()[keep, None]
    points = rotated(rays, T_world_camera[:3, :3]) + T_world_camera[:3, 3]
    colours = np.zeros((len(keep), 3), np.uint8)
    if colour is not None:
        colours = colour.reshape(-1, 3)[keep]
    return PointCloud(
        points.astype(np.float32),
        normals.astype(np.float32),
        colours,
        instance.ravel()[keep].astype(np.int32),
    )


def fuse(clouds: Sequence[PointCloud]) -> PointCloud:
    """Several cameras' clouds as one, in the order given, padding left out."""
    clouds = [c._points() for c in clouds]
    if not clouds:
        empty = np.empty((0, 3), np.float32)
        return PointCloud(empty, empty, empty.astype(np.uint8), np.empty(0, np.int32))
    return PointCloud(
        np.concatenate([c.points_world for c in clouds]),
        np.concatenate([c.normals_world for c in clouds]),
        np.concatenate([c.colours for c in clouds]),
        np.concatenate([c.instance for c in clouds]),
    )


def geom_instances(model: mujoco.MjModel, bodies: Sequence[int]) -> Int[np.ndarray, "ngeom"]:
    """For each geom the index in `bodies` of the body whose subtree it belongs to, else -1.

    Of nested bodies the innermost counts: a drawer listed beside its cabinet keeps its own index.
    """
    owner = np.full(model.nbody, NO_INSTANCE, np.int32)
    index_of = {int(body): index for index, body in enumerate(bodies)}
    for body in range(model.nbody):  # parents come before children
        inherited = owner[model.body_parentid[body]] if body else NO_INSTANCE
        owner[body] = index_of.get(body, inherited)
    return owner[model.geom_bodyid]


def pixel_instances(
    geom_id: Int[np.ndarray, "height width"], instance_of_geom: Int[np.ndarray, "ngeom"]
) -> Int[np.ndarray, "height width"]:
    """The instance of every pixel; -1 where nothing was seen or the geom has no instance."""
    # Index -1, nothing, picks the entry appended at the end.
    return np.append(instance_of_geom, NO_INSTANCE).astype(np.int32)[geom_id]


def normals_from_points(
    points: Float[np.ndarray, "height width 3"],
) -> Float[np.ndarray, "height width 3"]:
    """Normals towards the camera of an organised cloud in the camera frame.

    The cross product of the steps across and down the image. On each axis a step is the mean of
    those to both neighbours where the surface goes on smoothly, else the one with the smaller
    change of depth, which stays on the pixel's own surface. Zero where the surface is steeper than
    76 deg on both sides, or nothing was seen (depth 0).
    """
    across, across_known = _surface_step(points, axis=1)
    down, down_known = _surface_step(points, axis=0)
    normal = np.cross(down, across)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    known = across_known & down_known & (length[..., 0] > 0)
    normal = normal / np.where(length > 0, length, 1.0)
    away = np.sum(normal * points, axis=-1, keepdims=True) > 0
    return np.where(known[..., None], np.where(away, -normal, normal), 0.0)


def _surface_step(
    points: Float[np.ndarray, "height width 3"], axis: int
) -> tuple[np.ndarray, np.ndarray]:
    """The step along an image axis, and whether there is one on the pixel's own surface."""
    depth = points[..., 2:]
    slope = points[..., :2] / np.where(depth > 0, depth, 1.0)
    first, second = np.delete(depth[..., 0], -1, axis), np.delete(depth[..., 0], 0, axis)
    seen = (first > 0) & (second > 0)
    footprint = np.minimum(first, second) * np.linalg.norm(np.diff(slope, axis=axis), axis=-1)
    step = np.diff(points, axis=axis)
    rise = np.where(seen, step[..., 2] / np.where(seen, footprint, 1.0), np.inf)
    rise[np.abs(rise) > _STEEPEST] = np.inf
    step_after, step_before = _pad(step, axis, (0, 1), 0.0), _pad(step, axis, (1, 0), 0.0)
    after, before = _pad(rise, axis, (0, 1), np.inf), _pad(rise, axis, (1, 0), np.inf)
    known_after, known_before = np.isfinite(after), np.isfinite(before)
    both = known_after & known_before
    smooth = both & (np.abs(np.where(both, after, 0) - np.where(both, before, 0)) < _CREASE)
    one_sided = np.where((np.abs(after) <= np.abs(before))[..., None], step_after, step_before)
    step = np.where(smooth[..., None], 0.5 * (step_after + step_before), one_sided)
    return step, known_after | known_before


def _pad(values: np.ndarray, axis: int, width: tuple[int, int], value: float) -> np.ndarray:
    widths = [(0, 0)] * values.ndim
    widths[axis] = width
    return np.pad(values, widths, constant_values=value)
