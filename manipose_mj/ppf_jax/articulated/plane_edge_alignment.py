"""How a piece of furniture is turned about its front, by the edges of what is in the front's plane.

From straight before a shut cupboard one plane is all that shows, and nothing in it tells how the other two axes run
but its outlines: of the carcass, of doors, of the gaps between them. Counted along a direction that is across
many of these, points change in number abruptly.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from manipose_mj.ppf_jax.articulated.binned_counts import binned_counts


@dataclass(frozen=True)
class PlaneEdgeConfig:
    """How edges are looked for.

    Attributes:
      points: That are looked at.
      facing: Cosine between a point's normal and the plane's, at least.
      thick: How far from the plane points may be [m].
      bin: In which points are counted [m].
      step: Between the directions that are tried [rad]; they go on half a degree about the best.
      sure: How many times as abrupt as the median of all directions the best must be.
      alone: Share of the points that face along any axis which the plane's must be: where others show as
        well, they tell the turn.
    """

    points: int = 6144
    facing: float = 0.85
    thick: float = 0.02
    bin: float = 0.006
    step: float = float(np.radians(1.0))
    sure: float = 2.0
    alone: float = 0.9


_SPAN = (-2.0, 2.0)  # of what is looked at, from the points' mean [m]
_DEPTH_BIN = 0.01  # [m]
_FINE = np.radians(np.linspace(-0.75, 0.75, 7)).astype(np.float32)


def aligned_to_edges(
    rotation: Float[Array, "3 3"],
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    config: PlaneEdgeConfig,
) -> Float[Array, "3 3"]:
    """The rotation, turned about the axis of its largest plane until the plane's edges run along the others.

    By at most 45 deg; as it was where the edges do not tell, or other planes do.

    Args:
      rotation: Whose axes planes are across; only the turn about one may be wrong.
      points: [m].
      normals: Unit.
      mask: True for points, false for padding.
      config: How edges are looked for.
    """
    mean = jnp.sum(jnp.where(mask[:, None], points, 0.0), axis=0) / jnp.maximum(jnp.sum(mask), 1)
    own = (points - mean) @ rotation
    facing = (jnp.abs(normals @ rotation) > config.facing) & mask[:, None]
    count = jnp.sum(facing, axis=0)
    across = jnp.argmax(count)
    alone = count[across] > config.alone * jnp.sum(count)
    # The plane's normal first.
    order = (across + jnp.arange(3)) % 3
    own, facing = own[:, order], facing[:, across]
    depth = binned_counts(own[:, 0], facing, _SPAN, _DEPTH_BIN)
    middle = (
        _DEPTH_BIN * (jnp.argmax(jnp.convolve(depth, jnp.ones(3), mode="same")) + 0.5) + _SPAN[0]
    )
    within = facing & (jnp.abs(own[:, 0] - middle) < config.thick)

    def abruptness(angle: Array) -> Array:
        cos, sin = jnp.cos(angle), jnp.sin(angle)
        turned = cos * own[:, 1] + sin * own[:, 2], cos * own[:, 2] - sin * own[:, 1]
        return sum((_steps(each, within, config.bin) for each in turned), start=jnp.zeros(()))

    angles = jnp.arange(-np.pi / 4, np.pi / 4, config.step)
    found = jax.lax.map(abruptness, angles, batch_size=8)
    best = jnp.argmax(found)
    sure = alone & (found[best] > config.sure * jnp.median(found))
    fine = angles[best] + jnp.asarray(_FINE)
    angle = fine[jnp.argmax(jax.lax.map(abruptness, fine, batch_size=8))]
    cos, sin = jnp.cos(angle), jnp.sin(angle)
    second, third = rotation[:, order[1]], rotation[:, order[2]]
    turned = jnp.stack(
        [rotation[:, across], cos * second + sin * third, cos * third - sin * second], axis=1
    )
    # Columns back to where they were.
    return jnp.where(sure, turned[:, (jnp.arange(3) - across) % 3], rotation)


def _steps(along: Float[Array, "n"], there: Bool[Array, "n"], width: float) -> Float[Array, ""]:
    """How abruptly counts of points change."""
    counts = binned_counts(along, there, _SPAN, width)
    smooth = jnp.convolve(counts, jnp.array([0.25, 0.5, 0.25]), mode="same")
    return jnp.sum(jnp.diff(smooth) ** 2)
