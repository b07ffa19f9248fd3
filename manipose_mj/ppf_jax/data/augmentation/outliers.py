"""Training clouds with points that belong to nothing, as sensors and bad segmentations add them."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from manipose_mj.ppf_jax.points.clouds import CloudBatch

_CHANCE = 0.25  # of a cloud to get any
_SPREAD = 1.5  # outliers fill a ball of so many times the object's largest half length


def outlier_augmented(sample: CloudBatch, most: float, *, key: PRNGKeyArray) -> CloudBatch:
    """One cloud, a quarter of the time with a share of its points anywhere around the object.

    Args:
      sample: A `CloudBatch` without its first axis.
      most: The largest share; the share is drawn evenly up to it.
      key: Draws whether, which and where to.
    """
    share_key, chance_key, row_key, way_key, reach_key, normal_key = jax.random.split(key, 6)
    count = len(sample.points)
    share = most * jax.random.uniform(share_key) * jax.random.bernoulli(chance_key, _CHANCE)
    moved = jax.random.bernoulli(row_key, share, (count,)) & sample.mask
    direction, normals = (jax.random.normal(k, (count, 3)) for k in (way_key, normal_key))
    direction, normals = (
        v / jnp.linalg.norm(v, axis=-1, keepdims=True) for v in (direction, normals)
    )
    radius = _SPREAD * jnp.max(sample.extents) / 2
    reach = radius * jnp.cbrt(jax.random.uniform(reach_key, (count, 1)))
    points = jnp.where(moved[:, None], sample.pose[:3, 3] + reach * direction, sample.points)
    away = jnp.sum(normals * (points - sample.eyes), axis=-1, keepdims=True) > 0
    normals = jnp.where(away, -normals, normals)
    return replace(
        sample, points=points, normals=jnp.where(moved[:, None], normals, sample.normals)
    )
