"""Objects that the catalogue does not have: clouds stretched along their label's axes.

A linear map of the camera's frame takes rays to rays, so what was hidden stays hidden, and the cloud is
one that the camera would have seen of the stretched object. The label stays valid as long as the object
keeps its symmetries and the order of its lengths, by which some labels' axes are named.
"""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from manipose_mj.ppf_jax.points.clouds import CloudBatch

_EQUAL = 1.001  # lengths that differ by less are
_ABOUT_X = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.0, 0.5, 0.5]], np.float32)


def stretched(sample: CloudBatch, most: float, *, key: PRNGKeyArray) -> CloudBatch:
    """One cloud of another object of the same kind, with its label.

    Args:
      sample: A `CloudBatch` without its first axis.
      most: Logarithm of the largest factor along an axis; half of it for what looks the same upside down,
        such as a box, whose axes are told by their lengths alone.
      key: Draws the factors.
    """
    turned_over = jnp.any(sample.symmetry.rotations[:, 0, 0] < -0.5)
    own = jnp.where(turned_over, most / 2, most)
    each = jax.random.uniform(key, (3,), minval=-own, maxval=own)
    factors = jnp.exp(_symmetric(each, sample))
    kept = _longer(sample.extents) == _longer(sample.extents * factors)
    # Where the order of the lengths would change, the object keeps its proportions.
    factors = jnp.where(jnp.all(kept), factors, jnp.exp(each[0]))
    axes = sample.pose[:3, :3]
    normals = sample.normals @ ((axes / factors) @ axes.T)
    lengths = jnp.sqrt(jnp.sum(normals**2, axis=-1, keepdims=True))
    onto = (axes * factors) @ axes.T
    return replace(
        sample,
        points=sample.points @ onto,
        eyes=sample.eyes @ onto,
        normals=normals / jnp.maximum(lengths, 1e-9),
        pose=jnp.asarray(sample.pose).at[:3, 3].set(onto @ sample.pose[:3, 3]),
        extents=sample.extents * factors,
    )


def _longer(lengths: Float[Array, "3"]) -> Bool[Array, "3 3"]:
    return lengths[:, None] > _EQUAL * lengths


def _symmetric(logarithms: Float[Array, "3"], sample: CloudBatch) -> Float[Array, "3"]:
    """The mean over the symmetry group, which leaves axes that are equivalent alike."""
    rotations = sample.symmetry.rotations
    # The identity comes first; more of it are padding, which the mean must not count.
    members = jnp.any(rotations != jnp.eye(3), axis=(1, 2)).at[0].set(True)
    weights = jnp.where(members[:, None, None], rotations**2, 0.0)
    mean = jnp.sum(weights, axis=0) / jnp.sum(members)
    mean = jnp.where(sample.symmetry.axial, _ABOUT_X @ mean, mean)
    return mean @ logarithms
