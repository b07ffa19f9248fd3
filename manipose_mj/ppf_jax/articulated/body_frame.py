"""The frame of a piece of furniture: which way its front faces, and how it is turned about that.

X' points out of the front, Y' up or down, whichever: a chest of drawers looks much the
same upside down. Pairs vote for both; then the normals, nearly all of which are along an axis, refine the frame.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from manipose_mj.ppf_jax.points.rotations import from_vector
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry

# Columns: X', Y', Z' in the label frame of the whole, whose X is up and whose Y is out of the front.
BODY_IN_LABEL = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]], np.float32)
# The axes in turn: columns are front, up and side, had the front been the first, second or third.
_IN_TURN = np.stack([np.roll(np.eye(3), -k, axis=1) for k in range(3)]).astype(np.float32)
_ABOUT_UP = np.diag([-1.0, 1.0, -1.0]).astype(np.float32)
_QUARTER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], np.float32)
CANDIDATES = 6
BODY_SYMMETRY = CommonSymmetry(axial=False, unsigned_x=False, unsigned_y=True)
BODY_TURNS = np.stack([np.eye(3), np.diag([1.0, -1.0, -1.0])]).astype(np.float32)
# A pair of points of one plane is across the plane's normal: how nearly, at first and in the end [rad].
_WIDE, _SHARP = 0.05, 0.02
_ROUNDS, _PAIRS = 12, 8192
_SHORTEST = 0.08  # of pairs; normals of neighbours are too noisy to say much [m]
_NOISE = 0.003  # of points [m]
_FACING = (
    0.85  # cosine between a point's normal and the axis, from which on it may be of such a plane
)


def aligned(
    rotation: Float[Array, "3 3"],
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
) -> tuple[Float[Array, "3 3"], Float[Array, ""]]:
    """The rotation nearby whose axes most of the planes are across, and how many pairs say so.

    Normals from a noisy depth image lean towards the camera by degrees; points of one plane that are far
    apart know better. Pairs that are not of one plane are left out by Cauchy's weights.

    Args:
      rotation: To begin with, at most some 10 deg off.
      points: [m], in any order.
      normals: Unit; they only say which axis a point's plane may be across.
      mask: True for points, false for padding, which comes last.
    """
    count = jnp.maximum(jnp.sum(mask), 2)
    step = jnp.arange(_PAIRS)
    first = step % count
    # Another point, further on by an amount that changes from round to round.
    second = (first + 1 + (step * 7919 + (step // count) * 104729) % (count - 1)) % count
    offset = points[second] - points[first]
    length = jnp.sqrt(jnp.sum(offset**2, axis=-1) + 1e-12)
    along = offset / length[:, None]
    far = length > _SHORTEST

    def weights(current: Array, width: Array) -> tuple[Array, Array]:
        width = (width + _NOISE / length)[:, None]
        facing = jnp.minimum(jnp.abs(normals[first] @ current), jnp.abs(normals[second] @ current))
        across = along @ current
        weight = (far[:, None] & (facing > _FACING)) / (1 + (across / width) ** 2) ** 2
        return across, weight * (_SHARP / width) ** 2

    def refine(round_: Array, current: Array) -> Array:
        width = _WIDE * (_SHARP / _WIDE) ** (round_ / (_ROUNDS - 1))
        across, weight = weights(current, width)
        # along . (axis + turn x axis) = 0, for all three axes at once.
        rows = jnp.cross(current.T[None], along[:, None])
        matrix = jnp.einsum("pk,pki,pkj->ij", weight, rows, rows)
        ridge = 1e-4 * jnp.sum(weight) + 1e-9
        right = -jnp.einsum("pk,pki,pk->i", weight, rows, across)
        turn = _solved(matrix + ridge * jnp.eye(3), right)
        return from_vector(turn) @ current

    refined = jax.lax.fori_loop(0, _ROUNDS, refine, rotation)
    return refined, jnp.sum(weights(refined, jnp.asarray(_SHARP))[1])


def normal_starts(
    normals: Float[Array, "n 3"], mask: Bool[Array, "n"], count: int
) -> Float[Array, "count 3 3"]:
    """Frames along a random normal and another that is nearly across it.

    Args:
      normals: Unit, in random order, padding last.
      mask: True for points.
      count: How many.
    """
    present = jnp.maximum(jnp.sum(mask), 2)
    first = normals[(jnp.arange(count) * 3) % present]
    others = normals[(count * 3 + jnp.arange(32)) % present]
    second = others[jnp.argmin(jnp.abs(first @ others.T), axis=1)]
    second = second - jnp.sum(first * second, axis=-1, keepdims=True) * first
    length = jnp.linalg.norm(second, axis=-1, keepdims=True)
    # All of one normal: anything across it.
    spare = jnp.cross(first, jnp.eye(3)[jnp.argmin(jnp.abs(first), axis=1)])
    second = jnp.where(length > 0.1, second, spare)
    second = second / jnp.linalg.norm(second, axis=-1, keepdims=True)
    return jnp.stack([first, second, jnp.cross(first, second)], axis=-1)


def candidates(
    rotation: Float[Array, "3 3"], towards: Float[Array, "3"]
) -> Float[Array, "candidates 3 3"]:
    """The frames of the same axes whose front faces the camera, but for half turns about it.

    Args:
      rotation: One of these frames, or one that faces away.
      towards: From the furniture to the camera, in the frame that `rotation` maps into.
    """
    turned = rotation @ jnp.asarray(_IN_TURN)
    away = turned[:, :, 0] @ towards < 0
    turned = jnp.where(away[:, None, None], turned @ _ABOUT_UP, turned)
    return jnp.stack([turned, turned @ _QUARTER], axis=1).reshape(CANDIDATES, 3, 3)


def _solved(matrix: Float[Array, "3 3"], right: Float[Array, "3"]) -> Float[Array, "3"]:
    """The solution by Cramer's rule, of a symmetric matrix."""
    minors = jnp.cross(matrix[jnp.array([1, 2, 0])], matrix[jnp.array([2, 0, 1])])
    return right @ minors / (matrix[0] @ minors[0])
