"""How many points there are along a line, in bins of equal width."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


def binned_counts(
    along: Float[Array, "n"], there: Bool[Array, "n"], span: tuple[float, float], width: float
) -> Float[Array, "bins"]:
    """Points in each bin.

    Args:
      along: Where the points are [m].
      there: Which of them count.
      span: From where to where; what lies outside does not count [m].
      width: Of a bin [m].
    """
    bins = round((span[1] - span[0]) / width)
    index = jnp.floor((along - span[0]) / width).astype(jnp.int32)
    there = there & (index >= 0) & (index < bins)
    return jnp.bincount(jnp.clip(index, 0, bins - 1), there.astype(jnp.float32), length=bins)
