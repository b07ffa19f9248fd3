"""What pairs of oriented points say about each other, whatever the pose of the cloud.

CPPF's pair feature is `(n_a.d, n_b.d, n_a.n_b, |ab|)` with the sign of the normals left open. Here normals
point to the camera, which gives every feature its sign, and the view direction joins in: it is part of
the scene that turns with the cloud. Two triple products tell a shape from its mirror image.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

PAIR_FEATURES = 10
_TINY = 1e-8
STRAY = 5.0  # times the median distance from the middle; a hammer's ends are at 2.5


class Cloud(eqx.Module):
    """A cloud moved to its mean and divided by its size; points first, padding last.

    Attributes:
      points: `(n, 3)`, in units of `scale` about `centre`; 0 in padding.
      normals: `(n, 3)`, unit, towards the camera; 0 in padding.
      views: `(n, 3)`, unit, from each point to the camera; 0 in padding.
      mask: `(n,)`, true for points.
      centre: `(3,)` [m], camera frame.
      scale: [m], the median distance from `centre`.
    """

    points: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]
    views: Float[Array, "n 3"]
    mask: Bool[Array, "n"]
    centre: Float[Array, "3"]
    scale: Float[Array, ""]

    @property
    def count(self) -> Int[Array, ""]:
        """How many rows are points."""
        return jnp.sum(self.mask)


def normalised(
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    eyes: Float[Array, "n 3"] | None = None,
) -> Cloud:
    """A cloud in its own units; turning or moving it with its cameras changes nothing but `centre`.

    Args:
      points: [m], camera frame.
      normals: Unit, towards the camera.
      mask: True for points.
      eyes: Where the camera that saw each point is [m]; None: at the origin.
    """
    views = -_unit(points) if eyes is None else _unit(eyes - points)
    points, normals, views, mask = _without_strays(points, normals, views, mask)
    rows = mask[:, None]
    centre = _mean(points, mask)
    offsets = jnp.where(rows, points - centre, 0.0)
    scale = jnp.maximum(_median_distance(points, mask, centre), 1e-4)
    return Cloud(
        points=offsets / scale,
        normals=jnp.where(rows, normals, 0.0),
        views=jnp.where(rows, views, 0.0),
        mask=mask,
        centre=centre,
        scale=scale,
    )


def sampled(
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    *,
    count: int,
    key: PRNGKeyArray,
) -> tuple[Float[Array, "count 3"], Float[Array, "count 3"], Bool[Array, "count"]]:
    """`count` random rows of a cloud, its points before its padding."""
    order = sampled_rows(mask, count=count, key=key)
    return points[order], normals[order], mask[order]


def sampled_rows(mask: Bool[Array, "n"], *, count: int, key: PRNGKeyArray) -> Int[Array, "count"]:
    """The rows that `sampled` takes."""
    order = jax.random.uniform(key, mask.shape) + 2.0 * ~mask
    # The same rows as of `argsort`, in a third of the time.
    return jax.lax.top_k(-order, min(count, len(mask)))[1]


def pair_features(
    point_a: Float[Array, "*#b 3"],
    normal_a: Float[Array, "*#b 3"],
    view_a: Float[Array, "*#b 3"],
    point_b: Float[Array, "*#b 3"],
    normal_b: Float[Array, "*#b 3"],
) -> Float[Array, "*#b features"]:
    """The `PAIR_FEATURES` invariants of two oriented points and the view of the first."""
    offset = point_b - point_a
    distance = jnp.sqrt(_dot(offset, offset) + _TINY)
    along = offset / distance[..., None]
    features = (
        _dot(normal_a, along),
        _dot(normal_b, along),
        _dot(normal_a, normal_b),
        distance,
        _dot(jnp.cross(normal_a, normal_b), along),
        _dot(view_a, along),
        _dot(view_a, normal_a),
        _dot(view_a, normal_b),
        _dot(jnp.cross(normal_a, view_a), along),
        _dot(jnp.cross(normal_b, view_a), along),
    )
    return jnp.stack(jnp.broadcast_arrays(*features), axis=-1)


def neighbours(cloud: Cloud, count: int) -> tuple[Int[Array, "n k"], Bool[Array, "n k"]]:
    """The nearest other points of every point, and which of them are points and not padding.

    Distances are compared without their last bits, which hold the rows instead: a few minima of
    integers take a third of the time of sorting floats and rows.
    """
    size = len(cloud.points)
    columns = jax.lax.stop_gradient(cloud.points.T)
    offsets = columns[:, :, None] - columns[:, None]
    distances = offsets[0] ** 2 + offsets[1] ** 2 + offsets[2] ** 2
    far = jnp.eye(size, dtype=bool) | ~cloud.mask[:, None]
    last_bits = (1 << (size - 1).bit_length()) - 1
    order = jax.lax.bitcast_convert_type(jnp.where(far, jnp.inf, distances), jnp.int32)
    order = (order & ~last_bits) | jnp.arange(size)[:, None]

    def farther(nearest: Array, _: None) -> tuple[Array, Array]:
        beyond = jnp.where(order > nearest, order, jnp.iinfo(jnp.int32).max)
        nearest = jnp.min(beyond, axis=0)
        return nearest, nearest

    nearest = jax.lax.scan(farther, jnp.full(size, -1, jnp.int32), None, length=count)[1].T
    infinite = np.array(np.inf, np.float32).view(np.int32)
    return nearest & last_bits, nearest < infinite


def edge_features(cloud: Cloud, others: Int[Array, "n k"]) -> Float[Array, "n k features"]:
    """`pair_features` from every point to its row of `others`."""
    return pair_features(
        cloud.points[:, None],
        cloud.normals[:, None],
        cloud.views[:, None],
        cloud.points[others],
        cloud.normals[others],
    )


def random_pairs(
    cloud: Cloud, count: int, *, key: PRNGKeyArray
) -> tuple[Int[Array, "pairs"], Int[Array, "pairs"]]:
    """Rows of two different points each, drawn evenly but for 1 in 65,536; clouds have fewer points."""
    # Both of the same bits: random bits are a good part of what an estimate takes.
    bits = jax.random.bits(key, (count,), jnp.uint32)
    there = jnp.maximum(cloud.count, 1).astype(jnp.uint32)
    a = ((bits >> 16) * there) >> 16
    step = 1 + (((bits & 0xFFFF) * jnp.maximum(there - 1, 1)) >> 16)
    return a.astype(jnp.int32), ((a + step) % there).astype(jnp.int32)


def _without_strays(
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    views: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"], Float[Array, "n 3"], Bool[Array, "n"]]:
    """The same rows, those that are far from all else among the padding.

    A few points of what is behind an object would move the mean by centimetres.
    """
    centre, near = _mean(points, mask), mask
    for _ in range(2):  # the first middle is off by what the strays weigh
        offsets = jnp.linalg.norm(points - centre, axis=-1)
        near = mask & (offsets < STRAY * _median_distance(points, mask, centre) + _TINY)
        centre = _mean(points, near)
    order = jnp.argsort(~near, stable=True)
    return points[order], normals[order], views[order], near[order]


def _mean(points: Float[Array, "n 3"], mask: Bool[Array, "n"]) -> Float[Array, "3"]:
    total = jnp.sum(jnp.where(mask[:, None], points, 0.0), axis=0)
    return total / jnp.maximum(jnp.sum(mask), 1)


def _median_distance(
    points: Float[Array, "n 3"], mask: Bool[Array, "n"], centre: Float[Array, "3"]
) -> Float[Array, ""]:
    """Of the points from `centre`."""
    return masked_median(jnp.linalg.norm(points - centre, axis=-1), mask)


def masked_median(values: Float[Array, "n"], mask: Bool[Array, "n"]) -> Float[Array, ""]:
    """The lower median of those that count; infinite where none do."""
    ordered = jnp.sort(jnp.where(mask, values, jnp.inf))
    return ordered[(jnp.maximum(jnp.sum(mask), 1) - 1) // 2]


def _unit(vectors: Float[Array, "*b 3"]) -> Float[Array, "*b 3"]:
    return vectors / jnp.sqrt(_dot(vectors, vectors) + _TINY)[..., None]


def _dot(a: Float[Array, "*#b 3"], b: Float[Array, "*#b 3"]) -> Float[Array, "*#b"]:
    """Written out: it then fuses with all around it, which a sum over an axis of three does not."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
