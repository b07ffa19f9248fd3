"""Region-of-interest resampling: which points to use when it is known about where handles are.

Of a whole piece of furniture, a random sample shows a knob by a handful of points. Half of the resampled
points are from around the supposed handles: as many from each, and of each half from what stands out as far
as its handle does, whatever part of the picture that is.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray


@dataclass(frozen=True)
class RegionOfInterest:
    """How points are resampled.

    Attributes:
      radius: How near to a supposed handle's centre its points are [m].
      out: How far above such a centre, along the handle's Y, points stand out [m]; panels are lower.
      share: Of the points that are from there, at most.
      frames: In how many frames of the body, the likeliest: only then the best is chosen.
    """

    radius: float = 0.09
    out: float = -0.010
    share: float = 0.5
    frames: int = 3


def region_rows(
    points: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    places: Float[Array, "k 3"],
    outward: Float[Array, "k 3"],
    likely: Bool[Array, "k"],
    count: int,
    region: RegionOfInterest,
    *,
    key: PRNGKeyArray,
) -> Int[Array, "count"]:
    """`count` rows of a cloud, in random order but for padding, which comes last.

    Args:
      points: [m].
      mask: True for points, false for padding.
      places: Supposed centres of handles [m].
      outward: The Y of each, unit.
      likely: Which of them count.
      count: Of the rows.
      region: How they are chosen.
      key: Draws them.
    """
    race_key, rest_key, order_key = jax.random.split(key, 3)
    offset = points[:, None] - places  # (n, k, 3)
    squares = jnp.where(likely, jnp.sum(offset**2, axis=-1), jnp.inf)
    place = jnp.argmin(squares, axis=1)
    near = (jnp.min(squares, axis=1) < region.radius**2) & mask
    height = jnp.take_along_axis(jnp.sum(offset * outward, axis=-1), place[:, None], axis=1)[:, 0]
    group = 2 * place + (height > region.out)
    sizes = jnp.sum(near[:, None] & (group[:, None] == jnp.arange(2 * len(places))), axis=0)
    # The fewer points a group has, the sooner each of them comes: all groups get about as many.
    race = jax.random.exponential(race_key, mask.shape) * sizes[group]
    _, first = jax.lax.top_k(-jnp.where(near, race, jnp.inf), int(region.share * count))
    rank = jax.random.uniform(rest_key, mask.shape) + 2.0 * ~mask
    rank = rank.at[first].set(jnp.where(near[first], -1.0, rank[first]))
    chosen = jax.lax.top_k(-rank, count)[1]
    order = jax.random.uniform(order_key, chosen.shape) + 2.0 * ~mask[chosen]
    return chosen[jnp.argsort(order)]


def region_training_rows(
    points: Float[np.ndarray, "n 3"],
    even: Bool[np.ndarray, "n"],
    places: Float[np.ndarray, "k 3"],
    outward: Float[np.ndarray, "k 3"],
    count: int,
    region: RegionOfInterest,
    rng: np.random.Generator,
) -> Int[np.ndarray, "count"]:
    """What `region_rows` would choose of a cloud that is whole around the places and thinned elsewhere.

    Args:
      points: [m].
      even: Which of them are an even sample of the whole.
      places: Supposed centres of handles [m], at least one.
      outward: The Y of each, unit.
      count: Rows at most.
      region: How they are chosen.
      rng: Draws them.
    """
    places, outward = places.astype(np.float32), outward.astype(np.float32)
    squares = np.sum(places**2, axis=1) - 2 * points @ places.T
    place = squares.argmin(axis=1)
    squares = squares.min(axis=1) + np.einsum("ni,ni->n", points, points)
    near = np.flatnonzero(squares < region.radius**2)
    own = place[near]
    height = np.einsum("ni,ni->n", points[near] - places[own], outward[own])
    group = 2 * own + (height > region.out)
    sizes = np.bincount(group, minlength=2 * len(places))
    race = rng.standard_exponential(len(near)) * sizes[group]
    near = near[np.argsort(race)[: int(region.share * count)]]
    left = even.copy()
    left[near] = False
    rest = rng.permutation(np.flatnonzero(left))[: count - len(near)]
    return rng.permutation(np.concatenate([near, rest]))
