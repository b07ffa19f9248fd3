"""A small network that reads a cloud in a supposed label frame, corrects the frame and scores it.

In the frame of a good hypothesis all instances of a category look alike, which they do not in the
camera's. The network sees the points, their normals and view directions, and points of the space that
the camera saw to be empty: a hypothesis that puts a handle there is wrong. It says by how much to turn
and shift the frame, how long the bounding box is, and how likely the frame is within each of `LEVELS`.
"""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from manipose_mj.ppf_jax.points.rotations import from_vector
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.features import Cloud
from manipose_mj.ppf_jax.rigid.network import PAIR_OUTPUTS, Dense, standardised
from manipose_mj.ppf_jax.rigid.voting import Hypotheses

# What the pose scorer tells apart: turned by at most this [rad] and the origin off by at most that [m].
LEVELS: tuple[tuple[float, float], ...] = (
    (float(np.radians(5.0)), 0.01),
    (float(np.radians(15.0)), 0.02),
    (float(np.radians(45.0)), 0.05),
)
# How far a frame is off, about, within each level but not the one before, and beyond them all [rad].
_TYPICAL_TURNS = np.radians([2.5, 10.0, 30.0, 110.0])
CONFIDENT_LEVEL = 1  # the level whose probability is reported as confidence
_FARTHEST_TURN = 1.0  # of one correction [rad]
_INPUTS = 10  # a point, its normal, its view; 1 for empty space, whose points have no more


@dataclass(frozen=True)
class RefinementConfig:
    """Sizes of the refiner.

    Attributes:
      widths: Of the layers on points.
      hidden: Of the layer on the pooled features.
      steps: Corrections of each hypothesis that the votes give, at least 1.
      coarse_points: Points of the cloud that these corrections use, but for the last, which uses all.
      ambiguous_steps: Corrections of what the best of these may be mistaken for, at least 1.
      ambiguous_points: Points of the cloud that these corrections use.
      ambiguous_kept: How many of these, the likeliest at first sight, are corrected and scored to the end.
      ambiguity_penalty: Added to the expected rotation error of each of these [rad].
      free_points: Points of empty space.
      free_reach: How far from the surface these are at most, in units of the cloud's size.
    """

    widths: tuple[int, int] = (64, 128)
    hidden: int = 128
    steps: int = 2
    coarse_points: int = 128
    ambiguous_steps: int = 3
    ambiguous_points: int = 128
    ambiguous_kept: int = 4
    ambiguity_penalty: float = float(np.radians(10.0))
    free_points: int = 64
    free_reach: float = 2.0


class Reading(eqx.Module):
    """What the network reads off a cloud in a frame.

    Attributes:
      turn: `(3,)`, rotation vector of the correction in the frame [rad].
      shift: `(3,)`, of the origin, in the frame and the cloud's units.
      log_extents: `(3,)`, in the cloud's units.
      logits: `(levels,)`, for the frame as it was given being within each of `LEVELS`.
    """

    turn: Float[Array, "3"]
    shift: Float[Array, "3"]
    log_extents: Float[Array, "3"]
    logits: Float[Array, "levels"]


class Refiner(eqx.Module):
    """Pooled point features in a frame, and two heads."""

    first: Dense
    second: Dense
    of_cloud: Dense
    correct_hidden: Dense
    correct: Dense
    scorer_hidden: Dense
    scorer: Dense
    config: RefinementConfig = eqx.field(static=True)

    def __init__(self, config: RefinementConfig, *, rng: np.random.Generator):
        low, high = config.widths
        pooled, known = 3 * high + config.hidden, 4 + PAIR_OUTPUTS
        self.config = config
        self.first = Dense(_INPUTS, low, rng=rng)
        self.second = Dense(low, high, rng=rng)
        self.of_cloud = Dense(known, config.hidden, rng=rng)
        self.correct_hidden = Dense(pooled, config.hidden, rng=rng)
        self.correct = Dense(config.hidden, 9, rng=rng, gain=0.01)
        self.scorer_hidden = Dense(pooled, config.hidden, rng=rng)
        self.scorer = Dense(config.hidden, len(LEVELS), rng=rng, gain=0.01)

    def __call__(
        self,
        cloud: Cloud,
        free: Float[Array, "m 3"],
        log_extents: Float[Array, "3"],
        rotation: Float[Array, "3 3"],
        origin: Float[Array, "3"],
        agreement: Float[Array, "4"],
    ) -> Reading:
        """Read one hypothesis.

        Args:
          cloud: The cloud.
          free: Points that the camera looked through, in the cloud's units.
          log_extents: What the voting network takes the lengths for, in the cloud's units.
          rotation: Of the hypothesis.
          origin: Of the hypothesis, in the cloud's units.
          agreement: Share of votes that the hypothesis satisfies, of each kind.
        """
        # The first layer is linear: its weights are turned and its bias moved, not every point.
        *of_surface, of_empty = jnp.split(self.first.weight, (3, 6, 9))
        turned = jnp.concatenate([rotation @ weight for weight in of_surface])
        bias = self.first.bias - origin @ turned[:3]
        surface = jnp.concatenate([cloud.points, cloud.normals, cloud.views], axis=-1)
        seen = jax.nn.relu(self.second(jax.nn.relu(surface @ turned + bias)))
        seen = jnp.where(cloud.mask[:, None], seen, 0.0)
        empty = free @ turned[:3] + (bias + of_empty[0])
        through = jax.nn.relu(self.second(jax.nn.relu(empty)))
        size = jnp.log(cloud.scale / 0.05)[None]
        about = self.of_cloud(jnp.concatenate([size, log_extents, agreement]))
        pooled = jnp.concatenate(
            [
                jnp.max(seen, axis=0),
                jnp.max(through, axis=0),
                jnp.sum(seen, axis=0) / jnp.maximum(cloud.count, 1),
                jax.nn.relu(about),
            ]
        )
        pooled = standardised(pooled)
        correction = self.correct(jax.nn.relu(standardised(self.correct_hidden(pooled))))
        turn = correction[:3]
        length = jnp.sqrt(jnp.sum(turn**2) + 1e-12)
        return Reading(
            turn=turn * jnp.minimum(1.0, _FARTHEST_TURN / length),
            shift=correction[3:6],
            log_extents=log_extents + correction[6:],
            logits=self.scorer(jax.nn.relu(standardised(self.scorer_hidden(pooled)))),
        )

    def read(
        self,
        cloud: Cloud,
        free: Float[Array, "m 3"],
        log_extents: Float[Array, "3"],
        hypotheses: Hypotheses,
        agreement: Float[Array, "h 4"],
    ) -> Reading:
        """Read many hypotheses at once; every leaf has their axis first."""
        return jax.vmap(
            lambda rotation, origin, agrees: self(
                cloud, free, log_extents, rotation, origin, agrees
            )
        )(hypotheses.rotation, hypotheses.origin, agreement)


def expected_rotation_error(logits: Float[Array, "*b levels"]) -> Float[Array, "*b"]:
    """How far off a frame is on average, if it is within each of `LEVELS` as likely as scored [rad].

    The least of these is the best estimate where nothing tells equivalent turns apart, as those of a mug
    whose handle is hidden; the likeliest to be right may be at the end of what is possible.
    """
    return _TYPICAL_TURNS[-1] - jax.nn.sigmoid(logits) @ jnp.asarray(np.diff(_TYPICAL_TURNS))


def corrected(hypotheses: Hypotheses, reading: Reading) -> Hypotheses:
    """The hypotheses turned and shifted as the reading says."""
    shift = jnp.einsum("hij,hj->hi", hypotheses.rotation, reading.shift)
    return Hypotheses(
        rotation=hypotheses.rotation @ from_vector(reading.turn),
        origin=hypotheses.origin + shift,
    )


def canonicalised(hypotheses: Hypotheses, cloud: Cloud, symmetry: CommonSymmetry) -> Hypotheses:
    """The same hypotheses; those of an axis of revolution with Y on the camera's side.

    One frame then stands for all that are equivalent, and the network need not learn that they are.
    """
    if not symmetry.axial:
        return hypotheses
    x = hypotheses.rotation[..., 0]
    y = -cloud.centre - jnp.sum(-cloud.centre * x, axis=-1, keepdims=True) * x
    length = jnp.linalg.norm(y, axis=-1, keepdims=True)
    safe = length > 1e-3 * jnp.linalg.norm(cloud.centre)
    y = jnp.where(safe, y / jnp.maximum(length, 1e-9), hypotheses.rotation[..., 1])
    return Hypotheses(jnp.stack([x, y, jnp.cross(x, y)], axis=-1), hypotheses.origin)


def free_space(cloud: Cloud, config: RefinementConfig, *, key: PRNGKeyArray) -> Float[Array, "m 3"]:
    """Random points between the surface and the camera."""
    rows_key, reach_key = jax.random.split(key)
    count = config.free_points
    rows = jax.random.randint(rows_key, (count,), 0, jnp.maximum(cloud.count, 1))
    reach = jax.random.uniform(reach_key, (count, 1), minval=0.05, maxval=config.free_reach)
    return cloud.points[rows] + reach * cloud.views[rows]
