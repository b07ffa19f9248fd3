"""The estimator of handles and joints as one pytree, and what it does to one cloud."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from manipose_mj.poses import compose
from manipose_mj.ppf_jax.articulated.body_frame import (
    BODY_SYMMETRY,
    aligned,
    candidates,
    normal_starts,
)
from manipose_mj.ppf_jax.articulated.handle_fit import HandleFitConfig, Joint, fitted
from manipose_mj.ppf_jax.articulated.part_network import BodyCloud, PartNetwork, PartNetworkConfig
from manipose_mj.ppf_jax.articulated.part_voting import (
    EVIDENCE,
    Parts,
    PartVotingConfig,
    find_parts,
    frame_turn,
    unit,
)
from manipose_mj.ppf_jax.articulated.plane_edge_alignment import PlaneEdgeConfig, aligned_to_edges
from manipose_mj.ppf_jax.data.articulated.clouds import BATCH_POINTS
from manipose_mj.ppf_jax.data.articulated.region_of_interest import RegionOfInterest, region_rows
from manipose_mj.ppf_jax.points.rotations import from_vector
from manipose_mj.ppf_jax.rigid.features import Cloud, normalised, random_pairs, sampled
from manipose_mj.ppf_jax.rigid.network import NetworkConfig, PairVotes, VotingNetwork
from manipose_mj.ppf_jax.rigid.voting import VotingConfig, vote

_UPRIGHT = 5.0  # weight of the cosine between what a frame takes for up and what is roughly up
_LIKELY = 0.05  # of the surest part's score: the least with which a part gets a region of interest


@dataclass(frozen=True)
class ArticulatedConfig:
    """All that fixes the model's shape and how it is run.

    Attributes:
      body: Sizes of the network whose pairs vote for the frame of the body.
      body_voting: How these votes are counted.
      body_points: Points that it sees.
      body_pairs: Votes at inference.
      normal_starts: Frames along normals that are tried besides those that pairs vote for.
      apart: From which angle on two frames' axes are not the same [rad].
      edges: How a turn about the front is told by edges.
      network: Sizes of the part network.
      voting: How its votes are counted.
      points: Points that it sees.
      region: How points are chosen where handles seem to be.
      fit: How handles and doors are fitted to the whole cloud in the end.
    """

    body: NetworkConfig = field(default_factory=lambda: NetworkConfig(anchors=32))
    body_voting: VotingConfig = field(default_factory=VotingConfig)
    body_points: int = 512
    body_pairs: int = 4096
    normal_starts: int = 8
    apart: float = float(np.radians(6.0))
    edges: PlaneEdgeConfig = field(default_factory=PlaneEdgeConfig)
    network: PartNetworkConfig = field(default_factory=PartNetworkConfig)
    voting: PartVotingConfig = field(default_factory=PartVotingConfig)
    points: int = BATCH_POINTS
    region: RegionOfInterest = field(default_factory=RegionOfInterest)
    fit: HandleFitConfig = field(default_factory=HandleFitConfig)


class PartEstimates(eqx.Module):
    """Handles and joints in the camera frame; a row is a part, the surest first.

    Attributes:
      handle: `(k, 4, 4)`, `T_camera_handle`.
      hinge: `(k,)`, probability of turning; else the part slides.
      axis_origin: `(k, 3)` [m], on the joint's axis.
      axis: `(k, 3)`, unit; positive is opening.
      opening: `(k,)` [m or rad].
      evidence: `(k, EVIDENCE)`, as of `Parts`.
      confidence: `(k,)`, probability of the estimate being right in all.
      body: `(3, 3)`, columns are out of the front, up or down, and sideways.
    """

    handle: Float[Array, "k 4 4"]
    hinge: Float[Array, "k"]
    axis_origin: Float[Array, "k 3"]
    axis: Float[Array, "k 3"]
    opening: Float[Array, "k"]
    evidence: Float[Array, "k evidence"]
    confidence: Float[Array, "k"]
    body: Float[Array, "3 3"]


class ArticulatedModel(eqx.Module):
    """The network of the body's frame, that of the parts, and what makes evidence a confidence.

    Attributes:
      body: Its pairs vote for the frame of the body.
      parts: Its points vote for the parts.
      calibration: `(1 + EVIDENCE,)`, of a logistic regression; fitted when the rest is trained.
    """

    body: VotingNetwork
    parts: PartNetwork
    calibration: Float[Array, "weights"]
    config: ArticulatedConfig = eqx.field(static=True)

    def __init__(self, config: ArticulatedConfig, *, rng: np.random.Generator):
        self.body = VotingNetwork(config.body, rng=rng)
        self.parts = PartNetwork(config.network, rng=rng)
        self.calibration = jnp.zeros(1 + EVIDENCE).at[0].set(1.0)
        self.config = config

    def estimate(
        self,
        points: Float[Array, "n 3"],
        normals: Float[Array, "n 3"],
        mask: Bool[Array, "n"],
        up: Float[Array, "3"],
        *,
        key: PRNGKeyArray,
    ) -> PartEstimates:
        """`estimate_parts` with this model."""
        return estimate_parts(self, points, normals, mask, up, key=key)


def estimate_parts(
    model: ArticulatedModel,
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    up: Float[Array, "3"],
    *,
    key: PRNGKeyArray,
) -> PartEstimates:
    """Find likely frames of the body, vote in each for parts, vote again with more points around handles, and fit.

    A pure function of one cloud: `vmap` it.

    Args:
      model: The networks.
      points: [m], camera frame, the camera at the origin.
      normals: Unit, towards the camera.
      mask: True for points, false for padding.
      up: Roughly, camera frame: speaks for frames whose second axis is along it, either way, and decides
        between a handle's two directions.
      key: Draws the samples and the pairs.
    """
    config = model.config
    body_key, first_key, second_key = jax.random.split(key, 3)
    order = jax.random.uniform(first_key, mask.shape) + 2.0 * ~mask
    chosen = jax.lax.top_k(-order, min(config.edges.points, len(mask)))[1]
    several = points[chosen], normals[chosen], mask[chosen]
    chosen = chosen[: config.points]
    few = points[chosen], normals[chosen], mask[chosen]
    towards = -unit(jnp.sum(jnp.where(few[2][:, None], few[0], 0.0), axis=0))
    rotations = body_rotations(model, *few, key=body_key)
    rotations = jax.vmap(lambda axes: aligned_to_edges(axes, *several, config.edges))(rotations)
    frames = jax.vmap(lambda axes: candidates(axes, towards))(rotations).reshape(-1, 3, 3)
    rows = model.parts.neighbours(body_cloud(*few, frames[0])[0])
    logits = jax.lax.map(lambda frame: model.parts(body_cloud(*few, frame)[0], rows).frame, frames)
    logits += _UPRIGHT * jnp.log(jnp.abs(frames[:, :, 1] @ unit(up)) + 0.05)
    # A side looks much like a front until handles are seen in detail.
    likely, which = jax.lax.top_k(logits, config.region.frames)

    def in_detail(frame: Array) -> tuple[Array, PartEstimates]:
        return estimate_in_regions(
            model, points, normals, mask, few, rows, frame, up, key=second_key
        )

    again, found = jax.lax.map(in_detail, frames[which])
    best = jnp.argmax(likely + again)
    return _fitted(jax.tree.map(lambda leaf: leaf[best], found), points, mask, config.fit)


def estimate_in_regions(
    model: ArticulatedModel,
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    few: tuple[Float[Array, "m 3"], Float[Array, "m 3"], Bool[Array, "m"]],
    neighbours: tuple[Int[Array, "m k"], ...],
    rotation: Float[Array, "3 3"],
    up: Float[Array, "3"],
    *,
    key: PRNGKeyArray,
) -> tuple[Float[Array, ""], PartEstimates]:
    """The parts in one frame of the body, and how sure the second vote is that the frame is the body's (a logit).

    Args:
      model: The networks.
      points, normals, mask, up: As of `estimate_parts`.
      few: Points, normals and mask of the first vote.
      neighbours: Of these, for each layer of the network.
      rotation: The frame.
      key: Draws the points of the second vote.
    """
    config = model.config
    cloud, centre = body_cloud(*few, rotation)
    votes = model.parts(cloud, neighbours)
    parts = find_parts(cloud, votes, config.voting)
    chosen = region_rows(
        points,
        mask,
        parts.centre @ rotation.T + centre,
        parts.rotation[:, :, 1] @ rotation.T,
        parts.score > _LIKELY * jnp.max(parts.score),
        config.points,
        config.region,
        key=key,
    )
    rotation = rotation @ from_vector(frame_turn(cloud, votes, config.voting))
    cloud, centre = body_cloud(points[chosen], normals[chosen], mask[chosen], rotation)
    votes = model.parts(cloud)
    parts = find_parts(cloud, votes, config.voting)
    return votes.frame, _in_camera(parts, rotation, centre, up, model.calibration)


def _fitted(
    found: PartEstimates,
    points: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    config: HandleFitConfig,
) -> PartEstimates:
    joints = Joint(found.handle, found.hinge, found.axis_origin, found.axis)
    up = found.body[:, 1]
    joints = jax.vmap(lambda joint: fitted(points, mask, joint, up, config))(joints)
    return replace(found, handle=joints.handle, axis_origin=joints.origin, axis=joints.axis)


def body_rotations(
    model: ArticulatedModel,
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    *,
    key: PRNGKeyArray,
) -> Float[Array, "2 3 3"]:
    """What the body's axes may be in the camera frame: front, up or down and side in any order.

    Of frames that the pairs vote for and others along normals, the one that most of the planes agree with;
    and of those with other axes the best, for an open door may be larger than what is seen of the body.
    """
    config = model.config
    sample_key, pair_key = jax.random.split(key)
    cloud = normalised(*sampled(points, normals, mask, count=config.body_points, key=sample_key))
    votes = body_votes(model, cloud, config.body_pairs, key=pair_key)
    voted = vote(votes, BODY_SYMMETRY, config.body_voting).rotation
    starts = jnp.concatenate([voted, normal_starts(normals, mask, config.normal_starts)])
    rotations, score = jax.vmap(lambda start: aligned(start, points, normals, mask))(starts)
    # Where planes leave a turn open, votes decide: they come first.
    score = score * jnp.linspace(1.0, 0.97, len(score))
    first = rotations[jnp.argmax(score)]
    alike = jnp.abs(jnp.swapaxes(rotations, 1, 2) @ first)
    same = jnp.min(jnp.max(alike, axis=2), axis=1) > np.cos(config.apart)
    return jnp.stack([first, rotations[jnp.argmax(jnp.where(same, -1.0, score))]])


def body_votes(
    model: ArticulatedModel, cloud: Cloud, pairs: int, *, key: PRNGKeyArray
) -> PairVotes:
    """Votes of random pairs for the frame of the body."""
    known, context = model.body.encode(cloud)
    first, second = random_pairs(cloud, pairs, key=key)
    return model.body.pairs(cloud, known, context, first, second)


def body_cloud(
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    rotation: Float[Array, "3 3"],
) -> tuple[BodyCloud, Float[Array, "3"]]:
    """A cloud turned into the body's frame about its points' mean, and this mean (camera frame)."""
    rows = mask[:, None]
    centre = jnp.sum(jnp.where(rows, points, 0.0), axis=0) / jnp.maximum(jnp.sum(mask), 1)
    own = jnp.where(rows, (points - centre) @ rotation, 0.0)
    views = jnp.where(rows, -unit(points) @ rotation, 0.0)
    return BodyCloud(own, jnp.where(rows, normals @ rotation, 0.0), views, mask), centre


def _in_camera(
    parts: Parts,
    rotation: Float[Array, "3 3"],
    centre: Float[Array, "3"],
    up: Float[Array, "3"],
    calibration: Float[Array, "weights"],
) -> PartEstimates:
    # Half a turn of the body about its front would turn X round: `up` says which way it is.
    sign = jnp.where(rotation[:, 1] @ up < 0, -1.0, 1.0)
    handle = rotation @ parts.rotation * jnp.stack([sign, jnp.ones_like(sign), sign])
    return PartEstimates(
        handle=compose(handle, parts.centre @ rotation.T + centre),
        hinge=parts.hinge,
        axis_origin=parts.line @ rotation.T + centre,
        axis=parts.axis @ rotation.T,
        opening=parts.opening,
        evidence=parts.evidence,
        confidence=jax.nn.sigmoid(calibration[0] + parts.evidence @ calibration[1:]),
        body=rotation,
    )


@eqx.filter_jit
def estimate_furniture(
    model: ArticulatedModel,
    points: Float[Array, "b n 3"],
    normals: Float[Array, "b n 3"],
    mask: Bool[Array, "b n"],
    up: Float[Array, "b 3"],
    *,
    key: PRNGKeyArray,
) -> PartEstimates:
    """The estimates for every row of a batch, a few at a time to bound the memory."""
    keys = jax.random.split(key, len(points))
    rows = (jnp.asarray(points), jnp.asarray(normals), jnp.asarray(mask), jnp.asarray(up), keys)
    return jax.lax.map(lambda row: model.estimate(*row[:4], key=row[4]), rows, batch_size=8)
