"""What pairs of oriented points say about each other, whatever the pose of the cloud.

CPPF's pair feature is `(n_a.d, n_b.d, n_a.n_b, |ab|)` with the sign of the normals left open. Here normals
point to the camera, which gives every feature its sign, and the view direction joins in: it is part of
the scene that turns with the cloud. Two triple products tell a shape from its mirror image.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

PAIR_FEATURES = 10
_TINY = 1e-8
_STRAY = 5.0  # times the median distance from the middle; a hammer's ends are at 2.5


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
    points: Float[Array, "n 3"], normals: Float[Array, "n 3"], mask: Bool[Array, "n"]
) -> Cloud:
    """A cloud in its own units; turning or moving it with the camera changes nothing but `centre`.

    Args:
      points: [m], camera frame, the camera at the origin.
      normals: Unit, towards the camera.
      mask: True for points.
    """
    points, normals, mask = _without_strays(points, normals, mask)
    rows = mask[:, None]
    centre = _mean(points, mask)
    offsets = jnp.where(rows, points - centre, 0.0)
    scale = jnp.maximum(_median_distance(points, mask, centre), 1e-4)
    return Cloud(
        points=offsets / scale,
        normals=jnp.where(rows, normals, 0.0),
        views=jnp.where(rows, -_unit(points), 0.0),
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
    return jnp.argsort(jax.random.uniform(key, mask.shape) + 2.0 * ~mask)[:count]


def pair_features(
    point_a: Float[Array, "*b 3"],
    normal_a: Float[Array, "*b 3"],
    view_a: Float[Array, "*b 3"],
    point_b: Float[Array, "*b 3"],
    normal_b: Float[Array, "*b 3"],
) -> Float[Array, "*b features"]:
    """The `PAIR_FEATURES` invariants of two oriented points and the view of the first."""
    offset = point_b - point_a
    distance = jnp.sqrt(jnp.sum(offset**2, axis=-1) + _TINY)
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
    """The nearest other points of every point, and which of them are points and not padding."""
    squares = jnp.sum(cloud.points**2, axis=-1)
    distances = squares[:, None] + squares[None] - 2 * cloud.points @ cloud.points.T
    far = jnp.eye(len(squares), dtype=bool) | ~cloud.mask[None]
    nearest, rows = jax.lax.top_k(-jnp.where(far, jnp.inf, distances), count)
    return rows, jnp.isfinite(nearest)


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
    """Rows of two different points each, drawn evenly."""
    first, second = jax.random.split(key)
    a = jax.random.randint(first, (count,), 0, jnp.maximum(cloud.count, 1))
    step = jax.random.randint(second, (count,), 1, jnp.maximum(cloud.count, 2))
    return a, (a + step) % jnp.maximum(cloud.count, 1)


def _without_strays(
    points: Float[Array, "n 3"], normals: Float[Array, "n 3"], mask: Bool[Array, "n"]
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"], Bool[Array, "n"]]:
    """The same rows, those that are far from all else among the padding.

    A few points of what is behind an object would move the mean by centimetres.
    """
    centre, near = _mean(points, mask), mask
    for _ in range(2):  # the first middle is off by what the strays weigh
        offsets = jnp.linalg.norm(points - centre, axis=-1)
        near = mask & (offsets < _STRAY * _median_distance(points, mask, centre) + _TINY)
        centre = _mean(points, near)
    order = jnp.argsort(~near, stable=True)
    return points[order], normals[order], near[order]


def _mean(points: Float[Array, "n 3"], mask: Bool[Array, "n"]) -> Float[Array, "3"]:
    total = jnp.sum(jnp.where(mask[:, None], points, 0.0), axis=0)
    return total / jnp.maximum(jnp.sum(mask), 1)


def _median_distance(
    points: Float[Array, "n 3"], mask: Bool[Array, "n"], centre: Float[Array, "3"]
) -> Float[Array, ""]:
    """Of the points from `centre`."""
    distances = jnp.sort(jnp.where(mask, jnp.linalg.norm(points - centre, axis=-1), jnp.inf))
    return distances[(jnp.maximum(jnp.sum(mask), 1) - 1) // 2]


def _unit(vectors: Float[Array, "*b 3"]) -> Float[Array, "*b 3"]:
    return vectors / jnp.sqrt(jnp.sum(vectors**2, axis=-1, keepdims=True) + _TINY)


def _dot(a: Float[Array, "*b 3"], b: Float[Array, "*b 3"]) -> Float[Array, "*b"]:
    return jnp.sum(a * b, axis=-1)
