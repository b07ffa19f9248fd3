"""The whole estimator as one pytree, and what it does to one cloud."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from manipose_mj.poses import compose
from manipose_mj.ppf_jax.points.clouds import SAMPLE_POINTS
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.ambiguous_rotations import ambiguous_rotations
from manipose_mj.ppf_jax.rigid.evidence import Evidence
from manipose_mj.ppf_jax.rigid.features import (
    STRAY,
    Cloud,
    normalised,
    random_pairs,
    sampled_rows,
)
from manipose_mj.ppf_jax.rigid.network import NetworkConfig, PairVotes, VotingNetwork
from manipose_mj.ppf_jax.rigid.refinement import (
    CONFIDENT_LEVEL,
    Reading,
    RefinementConfig,
    Refiner,
    canonicalised,
    corrected,
    expected_rotation_error,
    free_space,
)
from manipose_mj.ppf_jax.rigid.revolution import RevolutionConfig, refined_axis
from manipose_mj.ppf_jax.rigid.voting import Hypotheses, VotingConfig, agreement, vote

_BAD_LOGIT = -10.0  # of the pose scorer, for what is no pose


@dataclass(frozen=True)
class ModelConfig:
    """All that fixes a model's shape and how it is run.

    Attributes:
      symmetry: What all objects of its training share.
      network: The voting network's sizes.
      voting: How votes are counted.
      refinement: The refiner's sizes and steps.
      revolution: How an axis of revolution is refined in the end.
      pairs: Votes at inference.
      points: Points of the sample that the networks use.
    """

    symmetry: CommonSymmetry = CommonSymmetry()
    network: NetworkConfig = field(default_factory=NetworkConfig)
    voting: VotingConfig = field(default_factory=VotingConfig)
    refinement: RefinementConfig = field(default_factory=RefinementConfig)
    revolution: RevolutionConfig = field(default_factory=RevolutionConfig)
    pairs: int = 4096
    points: int = SAMPLE_POINTS

    @property
    def sample(self) -> int:
        """Points of a cloud that are of any use; those that the networks use come first."""
        return max(self.points, self.revolution.points) if self.symmetry.axial else self.points


class EstimatingModel(Protocol):
    """What turns clouds into poses: `PoseModel`, or a baseline. An `eqx.Module`."""

    config: Any  # a frozen dataclass
    at_once: ClassVar[int]  # clouds whose votes are in memory together

    def estimate(
        self,
        points: Float[Array, "n 3"],
        normals: Float[Array, "n 3"],
        mask: Bool[Array, "n"],
        *,
        key: PRNGKeyArray,
        eyes: Float[Array, "n 3"] | None = None,
    ) -> Estimates:
        """The pose of the object that one cloud shows; arguments as of `estimate_cloud`."""
        ...


class PoseModel(eqx.Module):
    """The voting network and the refiner."""

    network: VotingNetwork
    refiner: Refiner
    config: ModelConfig = eqx.field(static=True)
    at_once: ClassVar[int] = 128

    def __init__(self, config: ModelConfig, *, rng: np.random.Generator):
        self.network = VotingNetwork(config.network, rng=rng)
        self.refiner = Refiner(config.refinement, rng=rng)
        self.config = config

    def estimate(
        self,
        points: Float[Array, "n 3"],
        normals: Float[Array, "n 3"],
        mask: Bool[Array, "n"],
        *,
        key: PRNGKeyArray,
        eyes: Float[Array, "n 3"] | None = None,
    ) -> Estimates:
        """`estimate_cloud` with this model."""
        return estimate_cloud(self, points, normals, mask, key=key, eyes=eyes)

    def sample_rows(self, mask: Bool[Array, "n"], *, key: PRNGKeyArray) -> Int[Array, "sample"]:
        """The rows of a cloud that `estimate` uses; only the first `config.points` need normals."""
        sample_key = jax.random.split(key, 3)[0]
        return sampled_rows(mask, count=self.config.sample, key=sample_key)


class Estimates(eqx.Module):
    """Ranked estimates for one cloud.

    Attributes:
      poses: `(h, 4, 4)`, `T_camera_label`, the likeliest first; if X is an axis of revolution, that one
        is refined by positions alone (`revolution.py`).
      extents: `(h, 3)` [m].
      confidence: `(h,)`, probability of being within 15 deg and 2 cm.
      voted: `(h, 4, 4)`, the poses before refinement, in the same order.
      expected_error: `(h,)`, expected rotation error of each [rad]; None where nothing scores poses.
      ambiguous: `(h,)`, whether it was not voted for, but may be what the best of those is mistaken for.
    """

    poses: Float[Array, "h 4 4"]
    extents: Float[Array, "h 3"]
    confidence: Float[Array, "h"]
    voted: Float[Array, "h 4 4"]
    expected_error: Float[Array, "h"] | None = None
    ambiguous: Bool[Array, "h"] | None = None


def estimate_cloud(
    model: PoseModel,
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    *,
    key: PRNGKeyArray,
    eyes: Float[Array, "n 3"] | None = None,
) -> Estimates:
    """Vote, refine, add what the best may be mistaken for, refine that, score all, rank.

    A pure function of one cloud: `vmap` it.

    Args:
      model: The networks.
      points: [m], camera frame.
      normals: Unit, towards the camera.
      mask: True for points, false for padding.
      key: Draws the sample, the pairs and the free space.
      eyes: Where the camera that saw each point is [m]; None: at the origin.
    """
    rows = model.sample_rows(mask, key=key)
    seen_from = None if eyes is None else eyes[rows]
    first = rows[: model.config.points]
    return estimate_sample(model, points[rows], normals[first], mask[rows], key=key, eyes=seen_from)


def estimate_sample(
    model: PoseModel,
    points: Float[Array, "sample 3"],
    normals: Float[Array, "seen 3"],
    mask: Bool[Array, "sample"],
    *,
    key: PRNGKeyArray,
    eyes: Float[Array, "sample 3"] | None = None,
) -> Estimates:
    """`estimate_cloud` of the rows that `PoseModel.sample_rows` names, with normals of the first of them."""
    return estimate_with_evidence(model, points, normals, mask, key=key, eyes=eyes)[0]


def estimate_with_evidence(
    model: PoseModel,
    points: Float[Array, "sample 3"],
    normals: Float[Array, "seen 3"],
    mask: Bool[Array, "sample"],
    *,
    key: PRNGKeyArray,
    eyes: Float[Array, "sample 3"] | None = None,
) -> tuple[Estimates, Evidence]:
    """`estimate_sample`, and what hypotheses of other views can be held against (`score_poses`)."""
    config = model.config
    _, pair_key, free_key = jax.random.split(key, 3)
    seen_from = None if eyes is None else eyes[: len(normals)]
    cloud = normalised(points[: len(normals)], normals, mask[: len(normals)], seen_from)
    votes, log_extents = cast_votes(model, cloud, config.pairs, key=pair_key)
    first = canonicalised(vote(votes, config.symmetry, config.voting), cloud, config.symmetry)
    free = free_space(cloud, config.refinement, key=free_key)
    few = first_votes(votes, config.voting.coarse_votes)
    seen = Evidence(cloud, few, log_extents, free)
    refined = refine_voted(model, seen, first)
    reading = read(model, seen, refined)
    likeliest = jnp.argmin(expected_rotation_error(reading.logits))
    ambiguous = ambiguous_frames(
        refined.rotation[likeliest], refined.origin[likeliest], seen, config.symmetry
    )
    ambiguous, others = refine_likeliest(model, seen, ambiguous)
    count = len(refined.origin)
    reading = joined(reading, read(model, seen, others))
    # Of equal scores, a frame that the votes led to is the better bet.
    is_ambiguous = jnp.arange(len(reading.turn)) >= count
    expected_error = expected_rotation_error(reading.logits)
    off = expected_error + config.refinement.ambiguity_penalty * is_ambiguous
    refined, first = joined(refined, others), joined(first, ambiguous)
    likely = jax.nn.sigmoid(reading.logits)
    poses = metric_poses(refined, cloud)
    extents = jnp.exp(jnp.clip(reading.log_extents, -6.0, 6.0)) * cloud.scale
    # Whatever the networks make of an unusual cloud, the estimate is a pose: without confidence.
    sound = jnp.all(jnp.isfinite(poses), axis=(1, 2)) & jnp.all(jnp.isfinite(likely), axis=1)
    poses = jnp.where(sound[:, None, None], poses, compose(jnp.eye(3), cloud.centre))
    extents = jnp.where(jnp.isfinite(extents), extents, cloud.scale)
    likely = jnp.where(sound[:, None], likely, 0.0)
    order = jnp.argsort(jnp.where(sound, off, jnp.inf))
    poses = poses[order]
    if config.symmetry.axial:
        poses = poses.at[0].set(
            _with_refined_axis(poses[0], points, eyes, mask, cloud, config.revolution)
        )
    found = Estimates(
        poses=poses,
        extents=extents[order],
        confidence=likely[order, CONFIDENT_LEVEL],
        voted=metric_poses(first, cloud)[order],
        expected_error=expected_error[order],
        ambiguous=is_ambiguous[order],
    )
    return found, seen


def score_poses(
    model: PoseModel, seen: Evidence, poses: Float[Array, "h 4 4"]
) -> Float[Array, "h levels"]:
    """The pose scorer's logits of poses, `T_camera_label` [m], that any view led to.

    Where the networks make nothing of a pose, it gets the logits of a bad one.
    """
    cloud = seen.cloud
    origins = (poses[:, :3, 3] - cloud.centre) / cloud.scale
    frames = canonicalised(Hypotheses(poses[:, :3, :3], origins), cloud, model.config.symmetry)
    return jnp.nan_to_num(read(model, seen, frames).logits, nan=_BAD_LOGIT)


@eqx.filter_jit
def estimate_batch(
    model: EstimatingModel,
    points: Float[Array, "b n 3"],
    normals: Float[Array, "b n 3"],
    mask: Bool[Array, "b n"],
    *,
    key: PRNGKeyArray,
    eyes: Float[Array, "b n 3"] | None = None,
) -> Estimates:
    """The estimates for every row of a batch, `at_once` at a time to bound the memory."""
    keys = jax.random.split(key, len(points))
    rows = (*map(jnp.asarray, (points, normals, mask)), keys)
    if eyes is not None:
        rows = (*rows, jnp.asarray(eyes))

    def one(row: tuple[Array, ...]) -> Estimates:
        points, normals, mask, own_key, *seen_from = row
        several = {"eyes": seen_from[0]} if seen_from else {}
        return model.estimate(points, normals, mask, key=own_key, **several)

    if len(points) <= model.at_once:
        return jax.vmap(one)(rows)
    return jax.lax.map(one, rows, batch_size=model.at_once)


def refine(model: PoseModel, seen: Evidence, hypotheses: Hypotheses, steps: int) -> Hypotheses:
    """Hypotheses after `steps` corrections by what the refiner reads in each."""

    def step(current: Hypotheses, _: None) -> tuple[Hypotheses, None]:
        after = corrected(current, read(model, seen, current))
        return canonicalised(after, seen.cloud, model.config.symmetry), None

    return jax.lax.scan(step, hypotheses, None, length=steps)[0]


def ambiguous_frames(
    rotation: Float[Array, "3 3"],
    origin: Float[Array, "3"],
    seen: Evidence,
    symmetry: CommonSymmetry,
) -> Hypotheses:
    """The frames that a frame may be mistaken for, about the same origin."""
    turned = rotation @ jnp.asarray(ambiguous_rotations(symmetry))
    origins = jnp.broadcast_to(origin, (len(turned), 3))
    return canonicalised(Hypotheses(turned, origins), seen.cloud, symmetry)


def refine_voted(model: PoseModel, seen: Evidence, hypotheses: Hypotheses) -> Hypotheses:
    """`refine` for what the votes give: on fewer points before the last correction."""
    config = model.config.refinement
    nearly = refine(model, seen.fewer(config.coarse_points), hypotheses, config.steps - 1)
    return refine(model, seen, nearly, 1)


def refine_ambiguous(model: PoseModel, seen: Evidence, hypotheses: Hypotheses) -> Hypotheses:
    """`refine` for the many that are wrong but for one: on fewer points."""
    config = model.config.refinement
    return refine(model, seen.fewer(config.ambiguous_points), hypotheses, config.ambiguous_steps)


def refine_likeliest(
    model: PoseModel, seen: Evidence, hypotheses: Hypotheses
) -> tuple[Hypotheses, Hypotheses]:
    """`refine_ambiguous` for the likeliest at first sight; these as they were, and refined."""
    config = model.config.refinement
    fewer = seen.fewer(config.ambiguous_points)
    reading = read(model, fewer, hypotheses)
    kept = min(config.ambiguous_kept, len(hypotheses.origin))
    chosen = jax.lax.top_k(-expected_rotation_error(reading.logits), kept)[1]
    after = canonicalised(corrected(hypotheses, reading), seen.cloud, model.config.symmetry)
    hypotheses, after = (jax.tree.map(lambda leaf: leaf[chosen], h) for h in (hypotheses, after))
    return hypotheses, refine(model, fewer, after, config.ambiguous_steps - 1)


def read(model: PoseModel, seen: Evidence, hypotheses: Hypotheses) -> Reading:
    """What the refiner reads in each hypothesis."""
    agrees = agreement(seen.votes, hypotheses, model.config.symmetry)
    return model.refiner.read(seen.cloud, seen.free, seen.log_extents, hypotheses, agrees)


def cast_votes(
    model: PoseModel, cloud: Cloud, pairs: int, *, key: PRNGKeyArray
) -> tuple[PairVotes, Float[Array, "3"]]:
    """The votes of random pairs, and the logarithm of the extents in the cloud's units."""
    known, context = model.network.encode(cloud)
    first, second = random_pairs(cloud, pairs, key=key)
    votes = model.network.pairs(cloud, known, context, first, second)
    return votes, model.network.extents(context)


def _with_refined_axis(
    pose: Float[Array, "4 4"],
    points: Float[Array, "sample 3"],
    eyes: Float[Array, "sample 3"] | None,
    mask: Bool[Array, "sample"],
    cloud: Cloud,
    config: RevolutionConfig,
) -> Float[Array, "4 4"]:
    """The pose after `refined_axis`, in metres and the camera's frame."""
    within = (points - cloud.centre) / cloud.scale
    views = -points if eyes is None else eyes - points
    views = views / jnp.maximum(jnp.linalg.norm(views, axis=1, keepdims=True), 1e-6)
    origin = (pose[:3, 3] - cloud.centre) / cloud.scale
    known = mask & (jnp.linalg.norm(within, axis=1) < STRAY)
    rotation, origin = refined_axis(
        jnp.where(known[:, None], within, 0.0),
        views,
        known,
        pose[:3, :3],
        origin,
        config.noise / cloud.scale,
        config,
    )
    return compose(rotation, origin * cloud.scale + cloud.centre)


def first_votes(votes: PairVotes, count: int) -> PairVotes:
    """As many of the votes, which are in random order."""
    return jax.tree.map(lambda leaf: leaf[:count], votes)


def metric_poses(hypotheses: Hypotheses, cloud: Cloud) -> Float[Array, "h 4 4"]:
    """`T_camera_label` [m] of hypotheses in a cloud's units."""
    return compose(hypotheses.rotation, hypotheses.origin * cloud.scale + cloud.centre)


def joined(*groups: Any) -> Any:
    """Pytrees of one structure, one after the other along their first axes."""
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *groups)
