"""The axis of a surface of revolution, from positions alone.

About the right axis all points lie on one profile, whichever side of the object they are on. The axis is moved
and turned until they do, by least squares: every point is held against the straight line through the points
that are near it in height and distance from the axis. Normals of noisy depth, which lean towards the camera, play no part.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from manipose_mj.ppf_jax.points.rotations import from_vector
from manipose_mj.ppf_jax.rigid.features import masked_median

_CAUCHY = 2.0  # residuals from which on points count less, in units of their spread
_TO_SPREAD = 1.48  # a normal distribution's standard deviation in units of its median deviation
_TINY = 1e-9
_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]], np.float32)  # turn, of rows


@dataclass(frozen=True)
class RevolutionConfig:
    """How an axis is refined.

    Attributes:
      points: Of a cloud, at most.
      steps: Of least squares.
      reach: Up to where points of the profile are held against each other, in the cloud's units.
      shift: By how much the axis may well be off beforehand, in the cloud's units.
      turn: The same of its direction [rad].
      noise: Of points that lie on a profile, at least [m].
    """

    points: int = 512
    steps: int = 2
    reach: float = 0.25
    shift: float = 0.1
    turn: float = 0.02
    noise: float = 0.0015


def refined_axis(
    points: Float[Array, "n 3"],
    views: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    rotation: Float[Array, "3 3"],
    origin: Float[Array, "3"],
    noise: Float[Array, ""],
    config: RevolutionConfig,
) -> tuple[Float[Array, "3 3"], Float[Array, "3"]]:
    """A frame whose X is the axis of revolution, and nearly was before; the origin moves across the axis.

    Args:
      points: Anywhere, in the cloud's units: about 1 across.
      views: Unit, from each point to the camera: tells an inner wall from the outer one.
      mask: True for points on the object, false for padding.
      rotation, origin: The frame as far as it is known.
      noise: `config.noise` in the cloud's units.
      config: How.
    """
    stiffness = jnp.array([config.shift, config.shift, config.turn, config.turn]) ** -2.0
    weights = _neighbours((points - origin) @ rotation, views @ rotation, mask, config.reach)

    def step(state: tuple[Array, Array, Array], _: None) -> tuple[tuple[Array, Array, Array], None]:
        turned, moved, gone = state
        off, slope = _held_against_profile((points - moved) @ turned, weights)
        spread = jnp.maximum(_TO_SPREAD * masked_median(jnp.abs(off), mask), noise)
        weight = mask / (1.0 + (off / (_CAUCHY * spread)) ** 2) / spread**2
        matrix = (slope * weight[:, None]).T @ slope + jnp.diag(stiffness)
        change = -jnp.linalg.solve(matrix, slope.T @ (weight * off) + stiffness * gone)
        across = jnp.concatenate([jnp.zeros(1), change[:2]])
        about = jnp.concatenate([jnp.zeros(1), change[2:]])
        return (turned @ from_vector(about), moved + turned @ across, gone + change), None

    start = rotation, origin, jnp.zeros(4)
    (turned, moved, _), _ = jax.lax.scan(step, start, None, length=config.steps)
    sound = jnp.all(jnp.isfinite(turned)) & jnp.all(jnp.isfinite(moved))
    return jnp.where(sound, turned, rotation), jnp.where(sound, moved, origin)


def _neighbours(
    own: Float[Array, "n 3"], views: Float[Array, "n 3"], mask: Bool[Array, "n"], reach: float
) -> Float[Array, "n n"]:
    """How much the points of the profile near each one count for the line through it.

    Args:
      own: Points in the frame.
      views: The same of directions to the camera.
      mask: Which are points.
      reach: Of neighbours in the profile.
    """
    profile, outwards = _profile(own)
    height, radius = profile.T
    squared = (height[:, None] - height) ** 2 + (radius[:, None] - radius) ** 2
    near = jnp.maximum(1.0 - squared / reach**2, 0.0) ** 2 * mask
    across = _line_normals(near, profile)[1]
    # Neighbours are seen from the same side of the line: a thin wall has two.
    seen_from = jnp.stack([views[:, 0], jnp.sum(views[:, 1:] * outwards, axis=1)])
    own_side = jnp.sign(jnp.sum(across * seen_from.T, axis=1, keepdims=True)) * across
    return jnp.where(own_side @ seen_from >= 0, near, 0.0)


def _profile(own: Float[Array, "n 3"]) -> tuple[Float[Array, "n 2"], Float[Array, "n 2"]]:
    """Height and distance from the axis of points in the frame; and the unit direction away from the axis."""
    radius = jnp.sqrt(jnp.sum(own[:, 1:] ** 2, axis=1) + _TINY)
    return jnp.stack([own[:, 0], radius], axis=1), own[:, 1:] / radius[:, None]


def _held_against_profile(
    own: Float[Array, "n 3"], weights: Float[Array, "n n"]
) -> tuple[Float[Array, "n"], Float[Array, "n 4"]]:
    """How far each point is off the profile's line near it, and how that changes with the frame.

    Args:
      own: Points in the frame.
      weights: Of each point's neighbours.

    Returns:
      Distances, and their derivatives by a move of the frame along Y and Z and a turn of it about Y and Z.
    """
    profile, outwards = _profile(own)
    height, y, z = own.T
    nothing = jnp.zeros_like(height)
    by_height = jnp.stack([nothing, nothing, -z, y], axis=1)
    by_radius = jnp.concatenate([-outwards, outwards * height[:, None] @ _QUARTER], axis=1)
    mean, across = _line_normals(weights, profile)
    heights, radii = jnp.split(
        _means(weights, jnp.concatenate([by_height, by_radius], axis=1)), 2, 1
    )
    slope = across[:, :1] * (by_height - heights) + across[:, 1:] * (by_radius - radii)
    return jnp.sum(across * (profile - mean), axis=1), slope


def _line_normals(
    weights: Float[Array, "n n"], profile: Float[Array, "n 2"]
) -> tuple[Float[Array, "n 2"], Float[Array, "n 2"]]:
    """The middle of each point's neighbours, and the unit normal of the line through them."""
    height, radius = profile.T
    squares = jnp.stack([height, radius, height**2, height * radius, radius**2], axis=1)
    h, r, hh, hr, rr = _means(weights, squares).T
    angle = 0.5 * jnp.arctan2(2 * (hr - h * r), (hh - h**2) - (rr - r**2)) + jnp.pi / 2
    return jnp.stack([h, r], axis=1), jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=1)


def _means(weights: Float[Array, "n n"], values: Float[Array, "n k"]) -> Float[Array, "n k"]:
    total = jnp.sum(weights, axis=1, keepdims=True)
    # Differences of squares: not in the fewer bits that matrices are multiplied with on some devices.
    return jnp.matmul(weights, values, precision="highest") / jnp.maximum(total, _TINY)
