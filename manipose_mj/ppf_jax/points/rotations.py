"""Rotation vectors in JAX."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from manipose_mj.poses import quaternion_to_rotation, rotation_to_quaternion


def from_vector(vector: Float[Array, "*b 3"]) -> Float[Array, "*b 3 3"]:
    """The rotation about `vector` by its length [rad]."""
    squared = jnp.sum(vector**2, axis=-1, keepdims=True)
    half = jnp.sqrt(squared + 1e-12) / 2
    imaginary = vector * (jnp.sin(half) / (2 * half))
    return quaternion_to_rotation(jnp.concatenate([jnp.cos(half), imaginary], axis=-1))


def to_vector(rotation: Float[Array, "*b 3 3"]) -> Float[Array, "*b 3"]:
    """The inverse of `from_vector`, of length at most pi [rad]."""
    quaternion = rotation_to_quaternion(rotation)
    imaginary = quaternion[..., 1:]
    sine = jnp.sqrt(jnp.sum(imaginary**2, axis=-1, keepdims=True) + 1e-12)
    return imaginary * (2 * jnp.arctan2(sine, quaternion[..., :1]) / sine)
