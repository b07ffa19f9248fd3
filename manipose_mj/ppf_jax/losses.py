"""What training asks of one labelled cloud: honest votes, corrections that help, sound judgement."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from manipose_mj.poses import quaternion_to_rotation
from manipose_mj.ppf_jax.clouds import CloudBatch
from manipose_mj.ppf_jax.features import Cloud, normalised
from manipose_mj.ppf_jax.model import PoseModel, cast_votes, first_votes, refine
from manipose_mj.ppf_jax.network import PairVotes
from manipose_mj.ppf_jax.refinement import LEVELS, faced, free_space
from manipose_mj.ppf_jax.rotations import from_vector, to_vector
from manipose_mj.ppf_jax.symmetry import nearest_equivalent, vote_cosines
from manipose_mj.ppf_jax.voting import Hypotheses, agreement, vote

# A frame that is further off is beyond correction; only the judge learns from it [rad].
_CORRECTABLE = 1.0


@dataclass(frozen=True)
class LossConfig:
    """How many frames of each kind the refiner is shown of a cloud, and how far these are off.

    Attributes:
      pairs: Votes of a cloud.
      noised: The true frame, turned and shifted a little, evenly in the logarithm of how much.
      confused: Frames as they are mistaken: half turns, any turn about X, any turn at all.
      own: The voting network's hypotheses as they are, and as many that are refined already.
      turn: Least and most of a noised frame [rad].
      shift: Least and most, in the cloud's units.
    """

    pairs: int = 1000
    noised: int = 3
    confused: int = 2
    own: int = 2
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
    keys = jax.random.split(key, 6)
    cloud = normalised(sample.points, sample.normals, sample.mask)
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
    frames = _joined(
        _noised(jnp.concatenate([right, wrong]), origin, config, key=keys[3]),
        _own(model, cloud, votes, guessed, free, config, key=keys[4]),
    )
    frames = faced(frames, cloud, symmetry)
    few = first_votes(votes, model.config.voting.coarse_votes)
    agrees = agreement(few, frames, symmetry)
    reading = model.refiner.read(cloud, free, guessed, frames, agrees)

    nearest = jax.vmap(
        lambda estimate: nearest_equivalent(
            estimate, rotation, sample.turns, sample.turn_mask, sample.axial
        )
    )(frames.rotation)
    inverse = jnp.swapaxes(frames.rotation, 1, 2)
    turn = to_vector(inverse @ nearest)
    shift = jnp.einsum("hij,hj->hi", inverse, origin - frames.origin)
    angle, distance = (jnp.sqrt(jnp.sum(v**2, axis=-1) + 1e-10) for v in (turn, shift))
    near = angle < _CORRECTABLE
    # Errors count against what there was to correct, so that small ones are learnt too.
    off = jnp.sum(jnp.abs(reading.turn - turn), axis=-1) / (0.05 + angle)
    off += jnp.sum(jnp.abs(reading.shift - shift), axis=-1) / (0.05 + distance)
    off += jnp.sum(jnp.abs(reading.log_extents - log_extents), axis=-1)
    parts["refine"] = jnp.sum(jnp.where(near, off, 0.0)) / jnp.maximum(jnp.sum(near), 1)
    within = jnp.stack([(angle <= a) & (distance * cloud.scale <= d) for a, d in LEVELS], axis=-1)
    parts["judge"] = jnp.mean(optax.sigmoid_binary_cross_entropy(reading.logits, within))
    return sum(parts.values(), start=jnp.zeros(())), parts


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
    cosines = vote_cosines(votes.along, rotation, sample.turns, sample.turn_mask)
    truth = jnp.concatenate([mu[:, None], nu[:, None], cosines], axis=-1)
    losses = jnp.abs(votes.values - truth) * jnp.exp(-votes.log_scale) + votes.log_scale
    mean = jnp.mean(losses, axis=0)
    return {
        "mu": mean[0],
        "nu": mean[1],
        "x": mean[2],
        "y": jnp.where(sample.axial, 0.0, mean[3]),
    }


def _joined(*groups: Hypotheses) -> Hypotheses:
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *groups)


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
    model: PoseModel,
    cloud: Cloud,
    votes: PairVotes,
    log_extents: Float[Array, "3"],
    free: Float[Array, "m 3"],
    config: LossConfig,
    *,
    key: PRNGKeyArray,
) -> Hypotheses:
    """Some of the hypotheses that the votes give, before and after refinement."""
    symmetry = model.config.symmetry
    found = vote(votes, symmetry, model.config.voting)
    rows = jax.random.permutation(key, len(found.origin))[: config.own]
    found = faced(jax.tree.map(lambda leaf: leaf[rows], found), cloud, symmetry)
    few = first_votes(votes, model.config.voting.coarse_votes)
    fixed = jax.lax.stop_gradient(model)
    steps = model.config.refinement.steps - 1
    refined = refine(fixed, cloud, few, log_extents, free, found, steps)
    return jax.lax.stop_gradient(_joined(found, refined))
