"""Something that stands in front of an object and hides a part of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import compose
from manipose_mj.ppf_jax.data.rasteriser import Raster, Triangles, pixel_rays, rasterise

LEFT_OVER = (0.3, 0.9)  # share of its pixels that something in front leaves of an object
_DRAWS = 6
_LEAST_DISTANCE = 0.25  # of something in front from the camera [m]


@dataclass(frozen=True)
class Occluder:
    """Something to put in front.

    Attributes:
      triangles: About the centre of its bounding box, which has a half diagonal of 1.
    """

    triangles: Triangles

    @classmethod
    def of_mesh(cls, mesh: trimesh.Trimesh) -> Occluder:
        """Any mesh, moved and scaled."""
        bounds = np.asarray(mesh.bounds)
        radius = 0.5 * np.linalg.norm(bounds[1] - bounds[0])
        own = Triangles.of_mesh(mesh)
        return cls(replace(own, corners=(own.corners - bounds.mean(axis=0)) / radius))

    @classmethod
    def random_box(cls, rng: np.random.Generator) -> Occluder:
        """A box with edges of any proportion up to 1 : 5."""
        return cls.of_mesh(trimesh.creation.box(extents=rng.uniform(0.2, 1.0, 3)))


def occluded(
    drawn: Raster,
    radius: float,
    window: Intrinsics,
    rng: np.random.Generator,
    occluders: Sequence[Occluder],
) -> Raster:
    """The same with something in front of a part, as item 1, if a few draws find a place for it.

    Args:
      drawn: The object, as item 0.
      radius: Half the diagonal of its box [m].
      window: Of the image.
      rng: Draws what stands where.
      occluders: What may, besides boxes.
    """
    pixels = np.argwhere(drawn.item == 0)
    if not len(pixels):
        return drawn
    rays, nearest = pixel_rays(window), drawn.depth[drawn.item == 0].min()
    for _ in range(_DRAWS):
        kind = int(rng.integers(len(occluders) + 1))
        occluder = occluders[kind - 1] if kind else Occluder.random_box(rng)
        size = radius * rng.uniform(0.3, 0.8)
        depth = min(nearest - size, nearest * rng.uniform(0.6, 0.95))
        if depth - size < _LEAST_DISTANCE:
            continue
        row, column = pixels[rng.integers(len(pixels))]
        position = rays[row, column] * depth
        position[:2] += rng.normal(0.0, 0.4 * size, 2)
        # A pose that also scales: the occluder has unit size.
        pose = compose(size * Rotation.random(random_state=rng).as_matrix(), position)
        front = rasterise([(occluder.triangles, pose)], window)
        merged = nearer(drawn, replace(front, item=np.where(front.item == 0, 1, front.item)))
        left = np.count_nonzero(merged.item == 0) / len(pixels)
        if LEFT_OVER[0] < left < LEFT_OVER[1]:
            return merged
    return drawn


def nearer(first: Raster, second: Raster) -> Raster:
    """The nearer of two images in every pixel."""
    there = (second.depth > 0) & ((first.depth == 0) | (second.depth < first.depth))
    return Raster(
        np.where(there, second.depth, first.depth),
        np.where(there, second.item, first.item),
        np.where(there[..., None], second.normal, first.normal),
    )
