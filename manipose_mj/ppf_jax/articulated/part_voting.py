"""From the votes of points to handles and joints: peaks of voted centres, then robust means around each."""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from manipose_mj.ppf_jax.articulated.part_network import (
    LENGTH,
    SLIDE_LENGTH,
    TURN,
    BodyCloud,
    PointVotes,
)
from manipose_mj.ppf_jax.rigid.voting import any_perpendicular, unit_or

EVIDENCE = 4
_NOWHERE = 1e3  # [m], where no point votes for
_PANEL = 0.05  # weight of points that are not on a handle where centres are looked for


@dataclass(frozen=True)
class PartVotingConfig:
    """How parts are told apart.

    Attributes:
      parts: Most that are found.
      candidates: Points whose voted centres are tried.
      width: Of the kernel that counts voted centres together [m].
      separation: Between voted centres that are taken for two handles, at least [m].
      along, across: Two parts whose handles are less apart than this, along the handle of the surer one and
        across it, are one [m]: votes for the middle of a bar that is seen in part spread along it.
      reach: How far from a part's centre a point may vote to take part in the part's estimate [m].
      snap: Directions that are this near to an axis of the body, or of the joint, are along it [rad].
      panel: Weight of votes for a handle's centre from points that are not on one.
      rounds: Of reweighting.
    """

    parts: int = 12
    candidates: int = 256
    width: float = 0.015
    separation: float = 0.04
    along: float = 0.10
    across: float = 0.02
    reach: float = 0.06
    snap: float = float(np.radians(20.0))
    panel: float = 0.01
    rounds: int = 6


class Parts(eqx.Module):
    """Handles and joints in the frame of the body; a row is a part, the surest first.

    Attributes:
      rotation: `(k, 3, 3)`, columns are the handle's axes.
      centre: `(k, 3)` [m], of the handle.
      hinge: `(k,)`, probability of turning.
      axis: `(k, 3)`, unit, of the joint.
      line: `(k, 3)` [m], a point on the joint's axis; the handle's centre where the part slides.
      opening: `(k,)` [m or rad].
      score: `(k,)`, how many sure votes there are for the part.
      evidence: `(k, EVIDENCE)`, what tells a sound estimate: logarithms of the score, of how far apart the
        votes for the centre lie, and of how many points seem to be on the handle; and how sure the
        joint's type is.
    """

    rotation: Float[Array, "k 3 3"]
    centre: Float[Array, "k 3"]
    hinge: Float[Array, "k"]
    axis: Float[Array, "k 3"]
    line: Float[Array, "k 3"]
    opening: Float[Array, "k"]
    score: Float[Array, "k"]
    evidence: Float[Array, "k evidence"]


def find_parts(cloud: BodyCloud, votes: PointVotes, config: PartVotingConfig) -> Parts:
    """Handles and joints that the points vote for.

    Args:
      cloud: In the frame of the body.
      votes: Of its points.
      config: How they are counted.
    """
    centres, weight = centre_votes(cloud, votes)
    peaks, scores = _peaks(centres, weight, config)
    seen = _around(cloud, votes, centres, peaks, config)
    again = _seen_before(seen[1], seen[0][:, :, 0], scores, config)
    # What was taken for two parts votes together.
    peaks, scores = jnp.where(again[:, None], _NOWHERE, peaks), jnp.where(again, 0.0, scores)
    found = _around(cloud, votes, centres, peaks, config)
    rotation, centre, hinge, axis, line, opening, spread, handle = found
    again = _seen_before(centre, rotation[:, :, 0], scores, config)
    scores, handle = (jnp.where(again, 0.0, value) for value in (scores, handle))
    evidence = jnp.stack(
        [
            jnp.log(scores + 1.0),
            jnp.log(spread + 1e-3),
            jnp.log(handle + 0.1),
            jnp.abs(2 * hinge - 1),
        ],
        axis=-1,
    )
    return Parts(rotation, centre, hinge, axis, line, opening, scores, evidence)


def _around(
    cloud: BodyCloud,
    votes: PointVotes,
    centres: Float[Array, "n 3"],
    peaks: Float[Array, "k 3"],
    config: PartVotingConfig,
) -> tuple[Array, ...]:
    """`_part` for each peak, by the points whose voted centres are nearer to it than to the others."""
    apart = jnp.linalg.norm(centres[:, None] - peaks, axis=-1)  # (n, k)
    nearest = jnp.argmin(apart, axis=1)
    member = (apart < config.reach) & (nearest[:, None] == jnp.arange(config.parts))
    own = jax.vmap(lambda rows, peak: _part(cloud, votes, centres, rows, peak, config))
    return own(member.T, peaks)


def _seen_before(
    centre: Float[Array, "k 3"],
    x: Float[Array, "k 3"],
    score: Float[Array, "k"],
    config: PartVotingConfig,
) -> Bool[Array, "k"]:
    """Which parts are a surer one once more."""
    offset = centre[:, None] - centre  # from the second to the first
    along = jnp.sum(offset * x, axis=-1)
    across = jnp.linalg.norm(offset - along[..., None] * x, axis=-1)
    same = (jnp.abs(along) < config.along) & (across < config.across)
    same = same | (jnp.linalg.norm(offset, axis=-1) < config.separation)
    return jnp.any(same & (score > score[:, None]), axis=1)


def centre_votes(
    cloud: BodyCloud, votes: PointVotes
) -> tuple[Float[Array, "n 3"], Float[Array, "n"]]:
    """Where each point takes its part's handle to be [m], and how much it counts."""
    classes = jax.nn.softmax(votes.logits)
    centres = cloud.points + LENGTH * votes.values["centre"]
    scale = jnp.exp(votes.log_scale["centre"])
    weight = (classes[:, 1] * _PANEL + classes[:, 2]) / (0.02 + scale)
    return centres, jnp.where(cloud.mask, weight, 0.0)


def _peaks(
    centres: Float[Array, "n 3"], weight: Float[Array, "n"], config: PartVotingConfig
) -> tuple[Float[Array, "k 3"], Float[Array, "k"]]:
    """Where the voted centres are densest, pairwise further apart than `separation`."""
    _, rows = jax.lax.top_k(weight, min(config.candidates, len(weight)))
    tried = centres[rows]
    squares = jnp.sum((tried[:, None] - centres) ** 2, axis=-1)
    density = jnp.exp(-squares / (2 * config.width**2)) @ weight

    def take(left: Array, _: None) -> tuple[Array, tuple[Array, Array]]:
        best = jnp.argmax(left)
        close = jnp.linalg.norm(tried - tried[best], axis=-1) < config.separation
        return jnp.where(close, -1.0, left), (tried[best], jnp.maximum(left[best], 0.0))

    return jax.lax.scan(take, density, None, length=config.parts)[1]


def _part(
    cloud: BodyCloud,
    votes: PointVotes,
    centres: Float[Array, "n 3"],
    member: Bool[Array, "n"],
    peak: Float[Array, "3"],
    config: PartVotingConfig,
) -> tuple[Array, ...]:
    moving = member * (1 - jax.nn.softmax(votes.logits)[:, 0])

    # Errors of neighbours' votes are alike, so that many vague ones of a panel must not outweigh the few
    # of the handle itself.
    held = moving * (config.panel + jax.nn.softmax(votes.logits)[:, 2])

    def voted(
        values: Array, scale: Array, start: Array | None = None, weight: Array = moving
    ) -> Array:
        return robust_mean(values, scale, weight, config.rounds, start)

    def scale_of(name: str) -> Array:
        return jnp.exp(votes.log_scale[name])

    centre = voted(centres, LENGTH * scale_of("centre"), peak, held)
    sure = moving / (scale_of("axis") + 0.05)
    hinge = jax.nn.sigmoid(sure @ votes.hinge / (jnp.sum(sure) + 1e-9))
    # Where nobody votes for a part, it is still a frame.
    front = jnp.array([1.0, 0.0, 0.0])
    axis = _snapped(unit_or(voted(votes.values["axis"], scale_of("axis")), front), config.snap)
    y = unit_or(voted(votes.values["y"], scale_of("y")), front)
    # A drawer's handle points the way it slides.
    y = jnp.where((hinge < 0.5) & (y @ axis > np.cos(config.snap)), axis, y)
    x = voted(votes.values["x"], scale_of("x"))
    x = unit_or(x - (x @ y) * y, any_perpendicular(y))
    rotation = jnp.stack([x, y, jnp.cross(x, y)], axis=-1)
    feet = cloud.points + LENGTH * votes.values["line"]
    feet = feet - (feet @ axis)[:, None] * axis
    line = voted(feet, LENGTH * scale_of("line"))
    # Abreast of the handle: any point of the line would do.
    line = line + (centre @ axis) * axis
    turns = hinge > 0.5
    line = jnp.where(turns, line, centre)
    opening = voted(votes.values["opening"], scale_of("opening"))[0]
    opening = jnp.maximum(jnp.where(turns, opening, SLIDE_LENGTH * opening), 0.0)
    off = jnp.linalg.norm(centres - centre, axis=-1)
    certainty = moving / (scale_of("centre") ** 2)
    spread = jnp.sqrt(certainty @ off**2 / (jnp.sum(certainty) + 1e-9) + 1e-12)
    handle = member @ jax.nn.softmax(votes.logits)[:, 2]
    return rotation, centre, hinge, axis, line, opening, spread, handle


def _snapped(axis: Float[Array, "3"], within: float) -> Float[Array, "3"]:
    """Along the body's nearest axis if that is as near as `within`: furniture's joints are."""
    nearest = jnp.argmax(jnp.abs(axis))
    along = jax.nn.one_hot(nearest, 3, dtype=axis.dtype) * jnp.sign(axis[nearest])
    return jnp.where(axis @ along > np.cos(within), along, axis)


def frame_turn(cloud: BodyCloud, votes: PointVotes, config: PartVotingConfig) -> Float[Array, "3"]:
    """By how much the frame that the cloud is in is off, as all points say: a rotation vector in it [rad]."""
    scale = jnp.exp(votes.log_scale["turn"])
    return TURN * robust_mean(
        votes.values["turn"], scale, cloud.mask.astype(scale.dtype), config.rounds
    )


def robust_mean(
    values: Float[Array, "n k"],
    scale: Float[Array, "n"],
    weight: Float[Array, "n"],
    rounds: int,
    start: Float[Array, "k"] | None = None,
) -> Float[Array, "k"]:
    """Mean of votes, each by its certainty, less of those that disagree (Cauchy's weights)."""
    variance = scale**2 + 1e-8
    certainty = weight / variance

    def mean(weight: Array) -> Array:
        return weight @ values / (jnp.sum(weight) + 1e-9)

    def refine(_: int, current: Array) -> Array:
        off = jnp.sum((values - current) ** 2, axis=-1)
        return mean(certainty / (1 + off / variance))

    return jax.lax.fori_loop(0, rounds, refine, mean(certainty) if start is None else start)


def unit(vector: Float[Array, "*b 3"]) -> Float[Array, "*b 3"]:
    """The vector at length 1; one of no length stays so."""
    return vector / jnp.sqrt(jnp.sum(vector**2, axis=-1, keepdims=True) + 1e-12)
