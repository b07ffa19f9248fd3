"""From the images of batched worlds to what sensors make of them: noisy depth, and clouds of objects with normals.

The noise and the fit of normals are those of the CPU's cameras. What differs: the angle of incidence comes from the
depth, not from the surfaces, and normals are always fitted, also to ideal depth.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, PRNGKeyArray

from manipose_mj.batch.perception.cameras import Images
from manipose_mj.mjcf.cameras.depth_noise import KINECT, Draws, StructuredLight, measure_with
from manipose_mj.mjcf.cameras.depth_normals import GATE, MAX_RADIUS_PX, RADIUS, SOFT, fit_planes
from manipose_mj.poses import Array

_SIDE = np.arange(-MAX_RADIUS_PX, MAX_RADIUS_PX + 1)
_ROWS, _COLUMNS = (g.ravel() for g in np.meshgrid(_SIDE, _SIDE, indexing="ij"))


class Clouds(NamedTuple):
    """What one camera of each world sees of one instance.

    Attributes:
      points: In the camera's frame [m]; 0 in padding.
      normals: Unit, towards the camera; 0 in padding.
      mask: False: padding, which comes last.
    """

    points: Float[Array, "worlds n 3"]
    normals: Float[Array, "worlds n 3"]
    mask: Bool[Array, "worlds n"]


def noisy_images(images: Images, key: PRNGKeyArray, sensor: StructuredLight = KINECT) -> Images:
    """The images with the depth, and the outlines, that a structured-light camera measures.

    Args:
      images: Exact.
      key: Of the noise.
      sensor: Its figures.
    """
    shape = images.depth.shape

    def one(
        depth: Array, instance: Array, pinhole: Array, key: PRNGKeyArray
    ) -> tuple[Array, Array]:
        shift, noise, fate = jax.random.split(key, 3)
        draws = Draws(
            jax.random.normal(shift, (2, *depth.shape)),
            jax.random.normal(noise, depth.shape),
            jax.random.uniform(fate, depth.shape),
        )
        found = measure_with(depth, incidence(depth, pinhole), pinhole[0], draws, sensor)
        return found.depth, found.moved(instance)

    keys = jax.random.split(key, shape[:2])
    depth, instance = jax.vmap(jax.vmap(one))(images.depth, images.instance, images.pinholes, keys)
    return images._replace(depth=depth, instance=instance)


def incidence(
    depth: Float[Array, "height width"], pinhole: Float[Array, "4"]
) -> Float[Array, "height width"]:
    """Cosine of the angle between each pixel's surface and the way to the camera, from exact depth.

    The inverse depth of a plane is linear in the image; of the differences to both neighbours the smaller one is of
    the same surface.
    """
    inverse = jnp.where(depth > 0, 1 / jnp.where(depth > 0, depth, 1.0), 0.0)
    fx, fy = pinhole[0], pinhole[1]
    a, b = _smaller_difference(inverse, 1) * fx, _smaller_difference(inverse, 0) * fy
    x, y = _slopes(depth.shape, pinhole)
    normal = jnp.stack([a, b, inverse - a * x - b * y], axis=-1)
    along = inverse * jnp.sqrt(1 / (x**2 + y**2 + 1))
    return jnp.clip(along / jnp.maximum(jnp.linalg.norm(normal, axis=-1), 1e-9), 0.0, 1.0)


def object_clouds(
    images: Images,
    camera: int,
    instance: Int[Array, " worlds"],
    size: int,
    key: PRNGKeyArray,
) -> Clouds:
    """Clouds of one instance of each world.

    Args:
      images: Of the worlds.
      camera: Which of their cameras.
      instance: Of each world, as segmentation numbers it; 0: none, whose cloud is empty.
      size: Points; fewer where fewer are seen.
      key: Chooses the pixels.
    """

    def one(depth: Array, seen: Array, pinhole: Array, wanted: Array, key: PRNGKeyArray) -> Clouds:
        mask = (seen == wanted) & (depth > 0) & (wanted > 0)
        chance = jnp.where(mask.ravel(), jax.random.uniform(key, (depth.size,)), -1.0)
        chance, pixels = jax.lax.top_k(chance, size)
        valid = chance >= 0
        row, column = pixels // depth.shape[1], pixels % depth.shape[1]
        x, y = (each.ravel()[pixels] for each in _slopes(depth.shape, pinhole))
        points = jnp.stack([x, y, jnp.ones_like(x)], axis=-1) * depth.ravel()[pixels][:, None]
        normals = fitted_normals(depth, mask, row, column, valid, pinhole)
        keep = valid[:, None]
        return Clouds(jnp.where(keep, points, 0.0), jnp.where(keep, normals, 0.0), valid)

    keys = jax.random.split(key, len(images.depth))
    return jax.vmap(one)(
        images.depth[:, camera],
        images.instance[:, camera],
        images.pinholes[:, camera],
        instance,
        keys,
    )


def fitted_normals(
    depth: Float[Array, "height width"],
    mask: Bool[Array, "height width"],
    row: Int[Array, " n"],
    column: Int[Array, " n"],
    valid: Bool[Array, " n"],
    pinhole: Float[Array, "4"],
) -> Float[Array, "n 3"]:
    """`mjcf.cameras.depth_normals` of these pixels, in arrays of fixed size."""
    fx, fy, cx, cy = pinhole
    own = depth[row, column]
    middle = jnp.nanmedian(jnp.where(valid, own, jnp.nan))
    middle = jnp.where(jnp.isfinite(middle), middle, 1.0)
    reach = jnp.clip(jnp.rint(RADIUS * fx / middle), 1, MAX_RADIUS_PX)
    inside = (np.abs(_ROWS) <= reach) & (np.abs(_COLUMNS) <= reach)
    padded = jnp.pad(jnp.where(mask, depth, 0.0), MAX_RADIUS_PX)
    near = padded[row[:, None] + MAX_RADIUS_PX + _ROWS, column[:, None] + MAX_RADIUS_PX + _COLUMNS]
    own = own[:, None]
    gate = GATE * jnp.maximum(RADIUS, reach * middle / fx)
    weight = ((near > 0) & (jnp.abs(near - own) < gate) & inside).astype(depth.dtype)
    relative = own / jnp.where(near > 0, near, jnp.where(own > 0, own, 1.0))
    at = jnp.asarray(np.stack([_COLUMNS, _ROWS, np.ones_like(_ROWS)], axis=-1), depth.dtype)
    plane = fit_planes(at, relative, weight)
    left = (relative - plane @ at.T) * (own / SOFT)
    plane = fit_planes(at, relative, weight * jnp.exp2(-left * left))
    a, b = plane[:, 0] * fx, plane[:, 1] * fy
    x, y = (column - cx) / fx, (row - cy) / fy
    normal = -jnp.stack([a, b, plane[:, 2] - a * x - b * y], axis=-1)
    return normal / jnp.maximum(jnp.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)


def _slopes(shape: tuple[int, ...], pinhole: Float[Array, "4"]) -> tuple[Array, Array]:
    """`x / z` and `y / z` of each pixel's ray."""
    fx, fy, cx, cy = pinhole
    row, column = jnp.indices(shape)
    return (column - cx) / fx, (row - cy) / fy


def _smaller_difference(image: Float[Array, "height width"], axis: int) -> Array:
    """To the neighbour on either side along an axis, the smaller one."""
    padded = jnp.pad(image, [(1, 1) if i == axis else (0, 0) for i in range(2)], mode="edge")
    steps = jnp.diff(padded, axis=axis)
    before = jax.lax.slice_in_dim(steps, 0, image.shape[axis], axis=axis)
    after = jax.lax.slice_in_dim(steps, 1, image.shape[axis] + 1, axis=axis)
    # At the image's border one of both is of no neighbour.
    count = image.shape[axis]
    place = jnp.arange(count).reshape([-1 if i == axis else 1 for i in range(2)])
    before = jnp.where(place == 0, after, before)
    after = jnp.where(place == count - 1, before, after)
    return jnp.where(jnp.abs(before) < jnp.abs(after), before, after)
