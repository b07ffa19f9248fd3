"""CPPF's inference as published: histogram votes for the centre, back-vote, cones on a sphere, signs.

You et al., "CPPF: Towards Robust Category-Level 9D Pose Estimation in the Wild", CVPR 2022, as in the
authors' public code. Votes are counted in integers: sums of floats depend on their order and are slow
on GPUs.
"""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, Shaped

from manipose_mj.poses import compose
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.model import Estimates
from manipose_mj.ppf_jax.rigid.voting import fibonacci_sphere

_CHUNK = 1000  # pairs whose circles are in memory together
_WHOLE = 64  # what one vote counts in the histogram
# GPUs round factors to ten bits unless told not to: more than a cosine of 1.5 deg allows.
EXACT = jax.lax.Precision.HIGHEST


@dataclass(frozen=True)
class CppfConfig:
    """CPPF's settings; the defaults are the published ones.

    Attributes:
      reach: The largest `|mu|` and `nu` that bins can say [m].
      mean_log_extents: Of the category's objects, of lengths in m.
      symmetry: Which angles are folded; an axis of revolution has no right.
      points: Of the sample that is looked at.
      neighbours: Of the point encoder.
      center_bins: For mu and nu each.
      angle_bins: For the angle to up and to right each.
      pairs: At inference.
      circle: Votes of each pair on its circle, and on its cone.
      cell: Of the grid [m].
      cells: Most cells along a side, about the median point: strays may be metres away.
      cone_pairs: That vote for directions.
      directions: On the Fibonacci sphere; what "1.5 deg" comes to there.
      angle: Between a vote and a direction it counts for [rad].
      backvote: Cells from the winner within which a pair's vote is kept.
    """

    reach: tuple[float, float]
    mean_log_extents: tuple[float, float, float]
    symmetry: CommonSymmetry = CommonSymmetry()
    points: int = 512
    neighbours: int = 60
    center_bins: int = 32
    angle_bins: int = 36
    pairs: int = 100_000
    circle: int = 72
    cell: float = 0.005
    cells: int = 100
    cone_pairs: int = 10_000
    directions: int = 480
    angle: float = float(np.radians(1.5))
    backvote: float = 3.0


class CppfOutputs(eqx.Module):
    """What each pair says: logits over bins, logits of signs, logarithm of the extents over the mean."""

    mu: Float[Array, "p center_bins"]
    nu: Float[Array, "p center_bins"]
    angles: Float[Array, "p 2 angle_bins"]
    signs: Float[Array, "p 2"]
    log_extents: Float[Array, "p 3"]


def voted_estimate(
    out: CppfOutputs,
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    first: Int[Array, "p"],
    second: Int[Array, "p"],
    config: CppfConfig,
    *,
    key: PRNGKeyArray,
) -> Estimates:
    """One hypothesis; its confidence is the share of the pairs whose circle passes the winning cell.

    Args:
      out: Of the pairs.
      points: [m], from any origin.
      normals: Of either sign.
      mask: True for points.
      first: Rows of the pairs' first points.
      second: Rows of their second points.
      config: How votes are counted.
      key: Draws the bins.
    """
    keys = jax.random.split(key, 4)
    along, _ = directed(points, first, second)
    mu = _drawn(out.mu, 2 * config.reach[0], keys[0]) - config.reach[0]
    nu = _drawn(out.nu, config.reach[1], keys[1])
    foot = points[first] - mu[:, None] * along
    centre = _voted_centre(foot, along, nu, points, mask, config)
    beyond = jnp.sum((centre - foot) * along, axis=-1)
    across = jnp.linalg.norm(centre - foot - beyond[:, None] * along, axis=-1)
    kept = jnp.hypot(beyond, across - nu) <= config.backvote * config.cell

    facing = towards(normals[first], along)
    order = jnp.argsort(~kept)[: config.cone_pairs]  # pairs are in random order already
    axes = []
    for i in range(2):
        angle = _drawn(out.angles[order, i], jnp.pi, keys[2 + i])
        axis = _voted_direction(along[order], angle, kept[order], config)
        logits = jnp.where(kept, out.signs[:, i] * jnp.sign(facing @ axis), 0.0)
        # The cross entropies of the two signs differ by the sum of the signed logits.
        axes.append(jnp.where(jnp.sum(logits) < 0, -axis, axis))
    x, y = axes
    if config.symmetry.axial:
        y = jnp.stack([jnp.zeros(()), -x[2], x[1]])
    y = y - (y @ x) * x
    length = jnp.linalg.norm(y)
    spare = jnp.cross(x, jnp.eye(3)[jnp.argmin(jnp.abs(x))])
    y = jnp.where(length > 1e-3, y / jnp.maximum(length, 1e-3), spare / jnp.linalg.norm(spare))
    weight = kept / jnp.maximum(jnp.sum(kept), 1)
    log_extents = weight @ out.log_extents + jnp.asarray(config.mean_log_extents)
    pose = compose(jnp.stack([x, y, jnp.cross(x, y)], axis=-1), centre)[None]
    return Estimates(pose, jnp.exp(log_extents)[None], jnp.mean(kept)[None], pose)


def directed(
    points: Float[Array, "n 3"], first: Int[Array, "p"], second: Int[Array, "p"]
) -> tuple[Float[Array, "p 3"], Float[Array, "p"]]:
    """The unit direction from the second to the first point of each pair, as CPPF has it; the distance."""
    offset = points[first] - points[second]
    length = jnp.sqrt(jnp.sum(offset**2, axis=-1) + 1e-14)
    return offset / length[:, None], length


def towards(normals: Float[Array, "p 3"], along: Float[Array, "p 3"]) -> Float[Array, "p 3"]:
    """The normals, each on the side of its pair's direction."""
    return jnp.where(jnp.sum(normals * along, axis=-1, keepdims=True) < 0, -normals, normals)


def _drawn(logits: Float[Array, "p bins"], longest: float, key: PRNGKeyArray) -> Float[Array, "p"]:
    """A bin of each pair, drawn with its probability, as the value that it stands for."""
    return jax.random.categorical(key, logits) * (longest / (logits.shape[-1] - 1))


def _perpendiculars(along: Float[Array, "p 3"]) -> tuple[Array, Array]:
    """Two unit vectors across each direction."""
    helper = jnp.where(jnp.abs(along[:, :1]) < 0.9, jnp.eye(3)[0], jnp.eye(3)[1])
    one = jnp.cross(along, helper)
    one = one / jnp.maximum(jnp.linalg.norm(one, axis=-1, keepdims=True), 1e-9)
    return one, jnp.cross(along, one)


def _circle(along: Float[Array, "p 3"], count: int) -> Float[Array, "p count 3"]:
    """`count` unit vectors across each direction."""
    one, other = _perpendiculars(along)
    angles = jnp.arange(count)[:, None] * (2 * np.pi / count)
    return jnp.cos(angles) * one[:, None] + jnp.sin(angles) * other[:, None]


def _chunked(array: Shaped[Array, "p *f"]) -> Shaped[Array, "chunks chunk *f"]:
    """Rows in chunks; padding repeats nothing: it is zeros."""
    size = min(_CHUNK, len(array))
    padding = -len(array) % size
    array = jnp.pad(array, ((0, padding), *((0, 0),) * (array.ndim - 1)))
    return array.reshape(-1, size, *array.shape[1:])


def _voted_centre(
    foot: Float[Array, "p 3"],
    along: Float[Array, "p 3"],
    nu: Float[Array, "p"],
    points: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    config: CppfConfig,
) -> Float[Array, "3"]:
    """The fullest cell of the grid over the visible cloud's box, after trilinear votes on all circles."""
    ordered = jnp.sort(jnp.where(mask[:, None], points, jnp.inf), axis=0)
    count = jnp.maximum(jnp.sum(mask), 1)
    middle, reach = ordered[(count - 1) // 2], 0.5 * config.cells * config.cell
    low = jnp.maximum(ordered[0], middle - reach)
    high = jnp.minimum(ordered[count - 1], middle + reach)
    cells = jnp.minimum(((high - low) / config.cell).astype(jnp.int32) + 1, config.cells)
    strides = jnp.array([config.cells**2, config.cells, 1])
    corners = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(8, 3)
    real = jnp.ones(len(foot), bool)

    def add(grid: Array, chunk: tuple[Array, ...]) -> tuple[Array, None]:
        foot, along, nu, real = chunk
        votes = foot[:, None] + nu[:, None, None] * _circle(along, config.circle)
        place = ((votes - low) / config.cell).reshape(-1, 3)
        inside = jnp.all((place >= 0.01) & (place < cells - 1.01), axis=-1)
        inside &= jnp.repeat(real, config.circle)
        base = jnp.floor(place)
        part = (place - base)[:, None]
        share = jnp.prod(jnp.where(corners == 1, part, 1 - part), axis=-1)
        rows = (base.astype(jnp.int32)[:, None] + corners) @ strides
        counted = jnp.where(inside[:, None], jnp.round(_WHOLE * share), 0).astype(jnp.int32)
        return grid.at[jnp.where(inside[:, None], rows, 0)].add(counted), None

    chunks = tuple(_chunked(leaf) for leaf in (foot, along, nu, real))
    grid, _ = jax.lax.scan(add, jnp.zeros(config.cells**3, jnp.int32), chunks)
    best = jnp.argmax(grid)
    return low + config.cell * (best // strides % config.cells)


def _voted_direction(
    along: Float[Array, "p 3"],
    angle: Float[Array, "p"],
    kept: Bool[Array, "p"],
    config: CppfConfig,
) -> Float[Array, "3"]:
    """The direction of the sphere that most cone samples are next to."""
    sphere = jnp.asarray(fibonacci_sphere(config.directions), along.dtype)

    def add(counts: Array, chunk: tuple[Array, ...]) -> tuple[Array, None]:
        along, angle, kept = chunk
        across = jnp.sin(angle)[:, None, None] * _circle(along, config.circle)
        samples = jnp.cos(angle)[:, None, None] * along[:, None] + across
        cosines = jnp.matmul(samples.reshape(-1, 3), sphere.T, precision=EXACT)
        near = cosines > np.cos(config.angle)
        near &= jnp.repeat(kept, config.circle)[:, None]
        return counts + jnp.sum(near, axis=0, dtype=jnp.int32), None

    chunks = tuple(_chunked(leaf) for leaf in (along, angle, kept))
    counts, _ = jax.lax.scan(add, jnp.zeros(len(sphere), jnp.int32), chunks)
    return sphere[jnp.argmax(counts)]
