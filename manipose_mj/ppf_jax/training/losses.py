"""What training asks of one labelled cloud: honest votes, corrections that help, sound scores."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from manipose_mj.poses import quaternion_to_rotation
from manipose_mj.ppf_jax.data.augmentation.outliers import outlier_augmented
from manipose_mj.ppf_jax.data.augmentation.stretching import stretched
from manipose_mj.ppf_jax.points.clouds import CloudBatch
from manipose_mj.ppf_jax.points.rotations import from_vector, to_vector
from manipose_mj.ppf_jax.points.symmetry import line_cosines, nearest_equivalent, vote_cosines
from manipose_mj.ppf_jax.rigid.ambiguous_rotations import ambiguous_rotations
from manipose_mj.ppf_jax.rigid.evidence import Evidence
from manipose_mj.ppf_jax.rigid.features import Cloud, normalised
from manipose_mj.ppf_jax.rigid.model import (
    PoseModel,
    cast_votes,
    first_votes,
    joined,
    read,
    refine_ambiguous,
    refine_voted,
)
from manipose_mj.ppf_jax.rigid.network import PAIR_OUTPUTS, PairVotes
from manipose_mj.ppf_jax.rigid.refinement import LEVELS, Reading, canonicalised, free_space
from manipose_mj.ppf_jax.rigid.voting import Hypotheses, vote

# A frame that is further off is beyond correction; only the pose scorer learns from it [rad].
_CORRECTABLE = 1.0


@dataclass(frozen=True)
class LossConfig:
    """How many frames of each kind the refiner is shown of a cloud, and how far these are off.

    Attributes:
      stretch: Logarithm of the largest factor by which an object is stretched along an axis (`stretched`).
      outliers: The largest share of an augmented cloud's points that are anywhere around the object.
      pairs: Votes of a cloud.
      noised: The true frame, turned and shifted a little, evenly in the logarithm of how much.
      confused: Frames as they are mistaken: half turns, any turn about X, any turn at all.
      own: The voting network's hypotheses as they are, and as many that are refined already.
      ambiguous: Noised frames and what they may be mistaken for, refined as in an estimate. A third of
        them are the former, so that the pose scorer cannot tell by how they came about.
      turn: Least and most of a noised frame [rad].
      shift: Least and most, in the cloud's units.
    """

    stretch: float = 0.35
    outliers: float = 0.25
    pairs: int = 1000
    noised: int = 3
    confused: int = 1
    own: int = 2
    ambiguous: int = 6
    turn: tuple[float, float] = (float(np.radians(0.3)), float(np.radians(40.0)))
    shift: tuple[float, float] = (0.005, 0.5)

    def __call__(
        self, model: PoseModel, sample: CloudBatch, *, key: PRNGKeyArray
    ) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
        """`cloud_loss` with this configuration."""
        return cloud_loss(model, sample, self, key=key)


def cloud_loss(
    model: PoseModel, sample: CloudBatch, config: LossConfig, *, key: PRNGKeyArray
) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
    """The loss of one row of a batch, and its parts.

    Args:
      model: The networks.
      sample: One cloud: a `CloudBatch` without its first axis.
      config: What is asked.
      key: Draws pairs, frames and free space.
    """
    keys = jax.random.split(key, 8)
    sample = stretched(sample, config.stretch, key=keys[6])
    sample = outlier_augmented(sample, config.outliers, key=keys[7])
    cloud = normalised(sample.points, sample.normals, sample.mask, sample.eyes)
    rotation = sample.pose[:3, :3]
    origin = (sample.pose[:3, 3] - cloud.centre) / cloud.scale
    log_extents = jnp.log(sample.extents / cloud.scale)
    votes, guessed = cast_votes(model, cloud, config.pairs, key=keys[0])
    parts = vote_losses(votes, rotation, origin, sample)
    parts["extents"] = jnp.mean(jnp.abs(guessed - log_extents))

    # The refiner learns from the votes as they are; it does not change them.
    votes, guessed = jax.lax.stop_gradient((votes, guessed))
    symmetry = model.config.symmetry
    free = free_space(cloud, model.config.refinement, key=keys[1])
    right = jnp.broadcast_to(rotation, (config.noised, 3, 3))
    wrong = _mistaken(rotation, config.confused, key=keys[2])
    few = first_votes(votes, model.config.voting.coarse_votes)
    seen = Evidence(cloud, few, guessed, free)
    frames = joined(
        _noised(jnp.concatenate([right, wrong]), origin, config, key=keys[3]),
        _own(model, seen, votes, config, key=keys[4]),
        _ambiguous_frames(model, seen, rotation, origin, config, key=keys[5]),
    )
    frames = canonicalised(frames, cloud, symmetry)
    reading = read(model, seen, frames)
    parts |= refinement_losses(reading, frames, cloud, sample)
    return sum(parts.values(), start=jnp.zeros(())), parts


def refinement_losses(
    reading: Reading, frames: Hypotheses, cloud: Cloud, sample: CloudBatch
) -> dict[str, Float[Array, ""]]:
    """How far corrections of frames miss the nearest equivalent label, and how wrongly they are scored.

    Args:
      reading: What the refiner reads in each frame.
      frames: As they were given to it.
      cloud: That they are supposed of.
      sample: Where its label is.
    """
    rotation = sample.pose[:3, :3]
    origin = (sample.pose[:3, 3] - cloud.centre) / cloud.scale
    log_extents = jnp.log(sample.extents / cloud.scale)
    nearest = jax.vmap(lambda estimate: nearest_equivalent(estimate, rotation, sample.symmetry))(
        frames.rotation
    )
    inverse = jnp.swapaxes(frames.rotation, 1, 2)
    turn = to_vector(inverse @ nearest)
    shift = jnp.einsum("hij,hj->hi", inverse, origin - frames.origin)
    angle, distance = _length(turn), _length(shift)
    near = angle < _CORRECTABLE
    # Not divided by what there is to correct: small errors would then outweigh the large ones, and a
    # training starts from features that tell only of these.
    off = _length(reading.turn - turn) + _length(reading.shift - shift)
    off += jnp.mean(jnp.abs(reading.log_extents - log_extents), axis=-1)
    within = jnp.stack([(angle <= a) & (distance * cloud.scale <= d) for a, d in LEVELS], axis=-1)
    return {
        "refine": jnp.sum(jnp.where(near, off, 0.0)) / jnp.maximum(jnp.sum(near), 1),
        "score": jnp.mean(optax.sigmoid_binary_cross_entropy(reading.logits, within)),
    }


def vote_losses(
    votes: PairVotes,
    rotation: Float[Array, "3 3"],
    origin: Float[Array, "3"],
    sample: CloudBatch,
) -> dict[str, Float[Array, ""]]:
    """Laplace's negative log likelihood of each kind of vote.

    Args:
      votes: Of one cloud, in its units.
      rotation: Of the label in the camera frame.
      origin: Of the label, in the cloud's frame and units.
      sample: The cloud's symmetry.
    """
    offset = origin - votes.start
    mu = jnp.sum(offset * votes.along, axis=-1)
    nu = jnp.sqrt(jnp.maximum(jnp.sum(offset**2, axis=-1) - mu**2, 1e-10))
    label = (votes.along, rotation, sample.symmetry)
    lines = votes.values.shape[1] > PAIR_OUTPUTS
    cosines = [vote_cosines(*label), line_cosines(*label)] if lines else [vote_cosines(*label)]
    truth = jnp.concatenate([mu[:, None], nu[:, None], *cosines], axis=-1)
    losses = jnp.abs(votes.values - truth) * jnp.exp(-votes.log_scale) + votes.log_scale
    mean = jnp.mean(losses, axis=0)
    parts = {
        "mu": mean[0],
        "nu": mean[1],
        "x": mean[2],
        "y": jnp.where(sample.symmetry.axial, 0.0, mean[3]),
    }
    if lines:
        parts |= {"x_line": mean[4], "y_line": jnp.where(sample.symmetry.axial, 0.0, mean[5])}
    return parts


def _length(vectors: Float[Array, "n 3"]) -> Float[Array, "n"]:
    return jnp.sqrt(jnp.sum(vectors**2, axis=-1) + 1e-10)


def _noised(
    rotation: Float[Array, "n 3 3"],
    origin: Float[Array, "3"],
    config: LossConfig,
    *,
    key: PRNGKeyArray,
) -> Hypotheses:
    """One frame near each of the given ones."""
    direction_key, size_key = jax.random.split(key)
    count = len(rotation)
    direction = jax.random.normal(direction_key, (2, count, 3))
    direction = direction / jnp.linalg.norm(direction, axis=-1, keepdims=True)
    low, high = np.log(np.array([config.turn, config.shift], np.float32)).T[..., None, None]
    size = jnp.exp(low + (high - low) * jax.random.uniform(size_key, (2, count, 1)))
    turn, shift = direction * size
    return Hypotheses(rotation @ from_vector(turn), origin + shift)


def _mistaken(
    rotation: Float[Array, "3 3"], count: int, *, key: PRNGKeyArray
) -> Float[Array, "n 3 3"]:
    """Half turns about X, Y or Z, any turn about X, and any turn at all, as chance has it."""
    kind_key, turn_key = jax.random.split(key)
    quaternion = jax.random.normal(turn_key, (count, 1, 4))
    # By kind, the parts of a quaternion (w, x, y, z) that are kept; one part alone is a half turn.
    parts = np.array(
        [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 1, 0, 0], [1, 1, 0, 0], [1, 1, 1, 1]],
        np.float32,
    )
    kind = jax.random.randint(kind_key, (count,), 0, len(parts))
    return rotation @ quaternion_to_rotation(quaternion[:, 0] * jnp.asarray(parts)[kind])


def _own(
    model: PoseModel, seen: Evidence, votes: PairVotes, config: LossConfig, *, key: PRNGKeyArray
) -> Hypotheses:
    """Some of the hypotheses that the votes give, before and after refinement."""
    symmetry = model.config.symmetry
    found = vote(votes, symmetry, model.config.voting)
    rows = jax.random.permutation(key, len(found.origin))[: config.own]
    found = canonicalised(jax.tree.map(lambda leaf: leaf[rows], found), seen.cloud, symmetry)
    refined = refine_voted(jax.lax.stop_gradient(model), seen, found)
    return jax.lax.stop_gradient(joined(found, refined))


def _ambiguous_frames(
    model: PoseModel,
    seen: Evidence,
    rotation: Float[Array, "3 3"],
    origin: Float[Array, "3"],
    config: LossConfig,
    *,
    key: PRNGKeyArray,
) -> Hypotheses:
    """What is easily mistaken for the true frame, as well as can be: the pose scorer's hard cases."""
    right_key, kind_key, noise_key = jax.random.split(key, 3)
    turns = jnp.concatenate(
        [jnp.eye(3)[None], jnp.asarray(ambiguous_rotations(model.config.symmetry))]
    )
    kind = jax.random.randint(kind_key, (config.ambiguous,), 0, len(turns))
    right = jax.random.bernoulli(right_key, 1 / 3, (config.ambiguous,))
    frames = rotation @ turns[jnp.where(right, 0, kind)]
    frames = canonicalised(
        _noised(frames, origin, config, key=noise_key), seen.cloud, model.config.symmetry
    )
    refined = refine_ambiguous(jax.lax.stop_gradient(model), seen, frames)
    return jax.lax.stop_gradient(refined)
