"""From the votes of pairs to poses: coarse scores of candidates, then robust least squares.

No vote is scattered into a grid. A candidate is scored by how many votes it satisfies, each weighed by
the square of the certainty it claims; a vote that errs by more than it allows loses its say (Cauchy's
kernel). Polishing repeats weighted least squares, for `along . axis = cosine` and
`along . (origin - start) = mu` are linear: 3x3 solves. Several hypotheses come out of the peaks of the scores.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.network import PAIR_OUTPUTS, PairVotes

_RIDGE = 1e-4  # keeps a solve regular when all pairs lie in one plane


@dataclass(frozen=True)
class VotingConfig:
    """How votes are counted.

    Attributes:
      coarse_votes: Votes that score candidates; all polish.
      directions: Candidates for X on the sphere.
      turns: Candidates for Y about a given X.
      origin_steps: Candidates for the origin along each side of the cube around the cloud.
      origin_reach: Half that side, in units of the cloud's size.
      axes_kept: Peaks of X that become hypotheses.
      turns_kept: Peaks of Y for each of them.
      separation: Between peaks [rad].
      polishing: Rounds of least squares.
    """

    coarse_votes: int = 1000
    directions: int = 480
    turns: int = 64
    origin_steps: int = 8
    origin_reach: float = 2.4
    axes_kept: int = 4
    turns_kept: int = 2
    separation: float = np.radians(35.0)
    polishing: int = 5


class Hypotheses(eqx.Module):
    """Candidate poses in the frame and units of a normalised cloud.

    Attributes:
      rotation: `(h, 3, 3)`, columns are the label's axes.
      origin: `(h, 3)`.
    """

    rotation: Float[Array, "h 3 3"]
    origin: Float[Array, "h 3"]


class _Linear(NamedTuple):
    """Votes `direction . unknown = value`, how certain each is (1 / scale^2), and whether up to sign."""

    direction: Float[Array, "p 3"]
    value: Float[Array, "p"]
    certainty: Float[Array, "p"]
    unsigned: bool


def fibonacci_sphere(count: int) -> Float[np.ndarray, "count 3"]:
    """Unit directions spread evenly over the sphere."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


def vote(votes: PairVotes, symmetry: CommonSymmetry, config: VotingConfig) -> Hypotheses:
    """`axes_kept * turns_kept` poses, best first by no rule: a pose scorer ranks them.

    An axis of revolution has no Y to vote for: one turn is kept, the one that faces the camera.

    Args:
      votes: At least `coarse_votes` of them.
      symmetry: What all objects of the network's training share.
      config: How to count.
    """
    x_votes = _cosine_votes(votes, 2, symmetry.unsigned_x)
    y_votes = _cosine_votes(votes, 3, symmetry.unsigned_y)
    few_x, few_y = (_first(v, config.coarse_votes) for v in (x_votes, y_votes))
    sphere = jnp.asarray(fibonacci_sphere(config.directions), votes.values.dtype)
    scores = _direction_scores(few_x, sphere)
    peaks = _peaks(scores, sphere, config.axes_kept, config.separation, symmetry.unsigned_x)
    x_axes = jax.vmap(lambda start: _polished_direction(x_votes, start, config.polishing))(peaks)
    if symmetry.axial:
        y_axes = jax.vmap(any_perpendicular)(x_axes)[:, None]
    else:
        y_axes = jax.vmap(lambda x: _turns_about(x, few_y, y_votes, symmetry, config))(x_axes)
    x_axes = jnp.broadcast_to(x_axes[:, None], y_axes.shape).reshape(-1, 3)
    y_axes = y_axes.reshape(-1, 3)
    start = _coarse_origin(jax.tree.map(lambda leaf: leaf[: config.coarse_votes], votes), config)
    origin = _polished_origin(votes, start, config.polishing)
    rotation = jnp.stack([x_axes, y_axes, jnp.cross(x_axes, y_axes)], axis=-1)
    return Hypotheses(rotation, jnp.broadcast_to(origin, x_axes.shape))


def agreement(
    votes: PairVotes, hypothesis: Hypotheses, symmetry: CommonSymmetry
) -> Float[Array, "h 4"]:
    """The certainty-weighted share of votes for mu, nu, X and Y that each hypothesis satisfies."""
    along = votes.along.T[:, None]
    offset = hypothesis.origin.T[:, :, None] - votes.start.T[:, None]
    mu = _dots(offset, along)
    nu = jnp.sqrt(jnp.maximum(_dots(offset, offset) - mu**2, 1e-8))
    x, y = (_dots(hypothesis.rotation[:, :, i].T[:, :, None], along) for i in (0, 1))
    x = jnp.abs(x) if symmetry.unsigned_x else x
    y = jnp.abs(y) if symmetry.unsigned_y else y
    residual = jnp.stack([mu, nu, x, y], axis=1) - votes.values[:, :PAIR_OUTPUTS].T
    weight = jnp.exp(-2 * votes.log_scale[:, :PAIR_OUTPUTS].T)
    return jnp.sum(_cauchy(weight, residual), axis=-1) / jnp.sum(weight, axis=-1)


def _cosine_votes(votes: PairVotes, column: int, unsigned: bool) -> list[_Linear]:
    """The votes for an axis, and those for its line if there are any."""

    def of(column: int, unsigned: bool) -> _Linear:
        certainty = jnp.exp(-2 * votes.log_scale[:, column])
        return _Linear(votes.along, votes.values[:, column], certainty, unsigned)

    if votes.values.shape[1] == PAIR_OUTPUTS:
        return [of(column, unsigned)]
    return [of(column, unsigned), of(column + 2, True)]


def _first(votes: list[_Linear], count: int) -> list[_Linear]:
    return [
        _Linear(v.direction[:count], v.value[:count], v.certainty[:count], v.unsigned)
        for v in votes
    ]


def _direction_scores(votes: list[_Linear], candidates: Float[Array, "c 3"]) -> Float[Array, "c"]:
    """How well each candidate satisfies the votes, blurred to the candidates' spacing."""

    def of(votes: _Linear) -> Array:
        cosine = _dots(votes.direction.T[:, :, None], candidates.T[:, None])
        residual = (jnp.abs(cosine) if votes.unsigned else cosine) - votes.value[:, None]
        sharpness = 1 / (1 / votes.certainty + 4 * jnp.pi / len(candidates) / 4)
        kernel = 1 / (1 + residual**2 * sharpness[:, None])
        return votes.certainty @ kernel

    return sum((of(kind) for kind in votes[1:]), start=of(votes[0]))


def _peaks(
    scores: Float[Array, "c"],
    candidates: Float[Array, "c 3"],
    count: int,
    separation: float,
    unsigned: bool,
) -> Float[Array, "count 3"]:
    """The best candidates that are pairwise further apart than `separation`."""

    def take(scores: Array, _: None) -> tuple[Array, Array]:
        best = candidates[jnp.argmax(scores)]
        cosine = candidates @ best
        close = (jnp.abs(cosine) if unsigned else cosine) > np.cos(separation)
        return jnp.where(close, -jnp.inf, scores), best

    return jax.lax.scan(take, scores, None, length=count)[1]


def _polished_direction(
    votes: list[_Linear], start: Float[Array, "3"], rounds: int
) -> Float[Array, "3"]:
    """The direction near `start` that the votes around it agree on."""
    columns = jnp.concatenate([v.direction.T for v in votes], axis=1)
    value, certainty = (jnp.concatenate([v[i] for v in votes]) for i in (1, 2))
    unsigned = np.repeat([v.unsigned for v in votes], [len(v.value) for v in votes])

    def refine(_: int, axis: Array) -> Array:
        cosine = axis @ columns
        meant = jnp.where(unsigned & (cosine < 0), -value, value) if unsigned.any() else value
        weight = _cauchy(certainty, cosine - meant)
        return unit_or(_solve(columns, meant, weight, axis), axis)

    return jax.lax.fori_loop(0, rounds, refine, start)


def _turns_about(
    x: Float[Array, "3"],
    few: list[_Linear],
    votes: list[_Linear],
    symmetry: CommonSymmetry,
    config: VotingConfig,
) -> Float[Array, "turns 3"]:
    """The peaks of Y about a given X."""
    first = any_perpendicular(x)
    angles = jnp.arange(config.turns)[:, None] * (2 * np.pi / config.turns)
    circle = jnp.cos(angles) * first + jnp.sin(angles) * jnp.cross(x, first)
    scores = _direction_scores(few, circle)
    starts = _peaks(scores, circle, config.turns_kept, config.separation, symmetry.unsigned_y)

    def polished(start: Array) -> Array:
        y = _polished_direction(votes, start, config.polishing)
        return unit_or(y - (y @ x) * x, start)

    return jax.vmap(polished)(starts)


def _coarse_origin(votes: PairVotes, config: VotingConfig) -> Float[Array, "3"]:
    side = np.linspace(-config.origin_reach, config.origin_reach, config.origin_steps)
    grid = jnp.asarray(np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3))
    grid = grid.astype(votes.start.dtype)
    # For all votes and candidates; no product of matrices, which would be written out and read again.
    offset = grid.T[:, None] - votes.start.T[:, :, None]
    mu = _dots(offset, votes.along.T[:, :, None])
    nu = jnp.sqrt(jnp.maximum(_dots(offset, offset) - mu**2, 1e-8))
    spacing = (side[1] - side[0]) / 2
    sharpness = 1 / (jnp.exp(2 * votes.log_scale[:, :2]) + spacing**2)
    residual = (mu - votes.values[:, :1]) ** 2 * sharpness[:, :1]
    residual = residual + (nu - votes.values[:, 1:2]) ** 2 * sharpness[:, 1:]
    certainty = jnp.exp(-votes.log_scale[:, 0] - votes.log_scale[:, 1])
    return grid[jnp.argmax(certainty @ (1 / (1 + residual)))]


def _polished_origin(votes: PairVotes, start: Float[Array, "3"], rounds: int) -> Float[Array, "3"]:
    """The point nearest to the circles (mu, nu) of the votes around it."""
    start_columns, along = votes.start.T, votes.along.T
    requested = votes.values[:, :2].T.reshape(-1)
    certainty = jnp.exp(-2 * votes.log_scale[:, :2]).T.reshape(-1)

    def refine(_: int, origin: Array) -> Array:
        offset = origin[:, None] - start_columns
        mu = _dots(offset, along)
        across = offset - mu * along
        nu = jnp.sqrt(_dots(across, across) + 1e-8)
        columns = jnp.concatenate([along, across / nu], axis=1)
        residual = jnp.concatenate([mu, nu]) - requested
        # The change that takes the residuals away.
        return origin - _solve(columns, residual, _cauchy(certainty, residual), jnp.zeros(3))

    return jax.lax.fori_loop(0, rounds, refine, start)


def _cauchy(
    certainty: Float[Array, "*#b p"], residual: Float[Array, "*b p"]
) -> Float[Array, "*b p"]:
    return certainty / (1 + certainty * residual**2)


def _dots(a: Float[Array, "3 *#b"], b: Float[Array, "3 *#b"]) -> Float[Array, "*b"]:
    """Inner products of vectors whose coordinates come first: each is one run of memory."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _solve(
    columns: Float[Array, "3 p"],
    values: Float[Array, "p"],
    weight: Float[Array, "p"],
    prior: Float[Array, "3"],
) -> Float[Array, "3"]:
    """Weighted least squares of `unknown @ columns = values`, drawn a little towards `prior`."""
    weighted = columns * (weight / (jnp.sum(weight) + 1e-12))
    matrix = weighted @ columns.T + _RIDGE * jnp.eye(3)
    return _solve3(matrix, weighted @ values + _RIDGE * prior)


def _solve3(matrix: Float[Array, "3 3"], right: Float[Array, "3"]) -> Float[Array, "3"]:
    """The solution by Cramer's rule: batched LU of tiny matrices is slow everywhere."""
    a, b, c = matrix[0], matrix[1], matrix[2]
    bc, ca, ab = jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)
    return (right[0] * bc + right[1] * ca + right[2] * ab) / (a @ bc)


def unit_or(vector: Float[Array, "3"], otherwise: Float[Array, "3"]) -> Float[Array, "3"]:
    """The vector at length 1; `otherwise` where it has next to none."""
    length = jnp.sqrt(jnp.sum(vector**2))
    return jnp.where(length > 1e-6, vector / jnp.maximum(length, 1e-6), otherwise)


def any_perpendicular(axis: Float[Array, "3"]) -> Float[Array, "3"]:
    """A unit vector across a unit vector."""
    smallest = jax.nn.one_hot(jnp.argmin(jnp.abs(axis)), 3, dtype=axis.dtype)
    across = smallest - (smallest @ axis) * axis
    return across / jnp.sqrt(jnp.sum(across**2))
