"""CPPF's network and losses as published: You et al., "CPPF: Towards Robust Category-Level 9D Pose
Estimation in the Wild", CVPR 2022, with the sizes of the authors' public code.

What differs: points are a random sample of about as many as the published 5 mm grid leaves, there is no grid. The
published 200,000 pairs of a step are spread over the clouds of a batch, not taken from one. The optimizer is this
package's Adam at the published rate, with clipped gradients and a rate that falls in the end, which can only help.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.cppf.voting import (
    EXACT,
    CppfConfig,
    CppfOutputs,
    directed,
    towards,
    voted_estimate,
)
from manipose_mj.ppf_jax.points.clouds import CloudBatch, LabelledCloud
from manipose_mj.ppf_jax.points.symmetry import common_symmetry
from manipose_mj.ppf_jax.rigid.features import sampled
from manipose_mj.ppf_jax.rigid.model import Estimates
from manipose_mj.ppf_jax.rigid.network import Dense, standardised

KERNEL_WIDTHS = (32, 64, 32, 32)
RANK, POINT_WIDTH, GLOBAL_WIDTH = 32, 32, 8
PAIR_WIDTHS = (32, 32, 16)
_RELATION, _NEIGHBOUR = 6, 2  # invariants of a point, its neighbour and their mean; of two points
_WITHIN = 0.995  # of the points that can be of the object
# Where the published settings fold the angle to up although no symmetry asks for it: signs alone decide.
_FOLDED = ("bottle", "can", "mug")


def cppf_config(clouds: Sequence[LabelledCloud]) -> CppfConfig:
    """The settings that CPPF takes from the training set: ranges, sizes, symmetry.

    The published ranges are about half the diagonal of the largest object's box. Labels need not be in
    the middle, so here it is the distance of all but a few points, strays behind the object left out.
    """
    near = []
    for cloud in clouds:
        placed = transform(invert(cloud.pose), cloud.points)
        inside = np.all(np.abs(placed) <= cloud.extents, axis=1)
        near.append(np.linalg.norm(placed[inside], axis=1))
    farthest = float(np.quantile(np.concatenate(near), _WITHIN))
    mean = np.mean([np.log(cloud.extents) for cloud in clouds], axis=0)
    first, second, third = (round(float(v), 4) for v in mean)
    symmetry = common_symmetry(cloud.symmetry for cloud in clouds)
    if all(cloud.category in _FOLDED for cloud in clouds):
        symmetry = replace(symmetry, unsigned_x=True)
    return CppfConfig(
        reach=(round(farthest, 3), round(farthest, 3)),
        mean_log_extents=(first, second, third),
        symmetry=symmetry,
    )


class CppfModel(eqx.Module):
    """One rotation-invariant convolution with a global maximum, and a residual network on pairs."""

    kernel: tuple[Dense, ...]
    contract: Dense
    to_global: Dense
    residual: tuple[tuple[Dense, Dense, Dense | None], ...]
    final: Dense
    config: CppfConfig = eqx.field(static=True)
    at_once: ClassVar[int] = 8

    def __init__(self, config: CppfConfig, *, rng: np.random.Generator):
        self.config = config
        widths = (_RELATION, *KERNEL_WIDTHS, RANK)
        self.kernel = tuple(
            Dense(a, b, rng=rng) for a, b in zip(widths[:-1], widths[1:], strict=True)
        )
        self.contract = Dense(RANK * _NEIGHBOUR, POINT_WIDTH, rng=rng)
        self.to_global = Dense(POINT_WIDTH, GLOBAL_WIDTH, rng=rng)
        widths = (2 * (POINT_WIDTH + GLOBAL_WIDTH) + 4, *PAIR_WIDTHS)
        self.residual = tuple(
            (
                Dense(a, b, rng=rng),
                Dense(b, b, rng=rng, gain=0.5),
                None if a == b else Dense(a, b, rng=rng, gain=1.0),
            )
            for a, b in zip(widths[:-1], widths[1:], strict=True)
        )
        outputs = 2 * config.center_bins + 2 * config.angle_bins + 2 + 3
        self.final = Dense(PAIR_WIDTHS[-1], outputs, rng=rng, gain=0.1)

    def estimate(
        self,
        points: Float[Array, "n 3"],
        normals: Float[Array, "n 3"],
        mask: Bool[Array, "n"],
        *,
        key: PRNGKeyArray,
    ) -> Estimates:
        """The pose of the object that one cloud shows; arguments as of `estimate_cloud`."""
        sample_key, first_key, second_key, vote_key = jax.random.split(key, 4)
        count = min(self.config.points, len(points))
        points, normals, mask = sampled(points, normals, mask, count=count, key=sample_key)
        centre = _centre(points, mask)
        points = jnp.where(mask[:, None], points - centre, 0.0)
        normals = unoriented(normals)
        count = jnp.maximum(jnp.sum(mask), 1)
        first = jax.random.randint(first_key, (self.config.pairs,), 0, count)
        second = jax.random.randint(second_key, (self.config.pairs,), 0, count)
        out = self.pairs(points, normals, self.encode(points, normals, mask), first, second)
        found = voted_estimate(out, points, normals, mask, first, second, self.config, key=vote_key)
        poses = found.poses.at[:, :3, 3].add(centre)
        return Estimates(poses, found.extents, found.confidence, poses)

    def encode(
        self, points: Float[Array, "n 3"], normals: Float[Array, "n 3"], mask: Bool[Array, "n"]
    ) -> Float[Array, "n width"]:
        """Features of the points."""
        squares = jnp.sum(points**2, axis=-1)
        products = jnp.matmul(points, points.T, precision=EXACT)
        distances = squares[:, None] + squares[None] - 2 * products
        distances = jnp.where(mask[None], distances, jnp.inf)
        nearest, rows = jax.lax.top_k(-distances, min(self.config.neighbours, len(points)))
        # A cloud with fewer points: each is its own neighbour in place of padding.
        rows = jnp.where(jnp.isfinite(nearest), rows, jnp.arange(len(points))[:, None])
        near, near_normals = points[rows], normals[rows]
        mean = jnp.mean(near, axis=1, keepdims=True)
        sides = (mean - near, near - points[:, None], points[:, None] - mean)
        sides = jnp.broadcast_arrays(*sides)
        lengths = [jnp.sqrt(jnp.sum(side**2, axis=-1) + 1e-12) for side in sides]
        cosines = [
            jnp.sum(sides[i] * sides[j], axis=-1) / (lengths[i] * lengths[j] + 1e-7)
            for i, j in ((0, 1), (1, 2), (2, 0))
        ]
        hidden = jnp.stack([*lengths, *cosines], axis=-1)
        for layer in self.kernel[:-1]:
            hidden = jax.nn.relu(standardised(layer(hidden)))
        weights = self.kernel[-1](hidden)
        own = jnp.stack([lengths[1], jnp.sum(near_normals * normals[:, None], axis=-1)], axis=-1)
        contracted = jnp.einsum("nkr,nki->nri", weights, own).reshape(len(points), -1)
        features = standardised(self.contract(contracted))
        highest = jnp.max(jnp.where(mask[:, None], self.to_global(features), -jnp.inf), axis=0)
        return jnp.concatenate(
            [features, jnp.broadcast_to(highest, (len(points), GLOBAL_WIDTH))], axis=-1
        )

    def pairs(
        self,
        points: Float[Array, "n 3"],
        normals: Float[Array, "n 3"],
        known: Float[Array, "n width"],
        first: Int[Array, "p"],
        second: Int[Array, "p"],
    ) -> CppfOutputs:
        """The outputs for pairs of rows."""
        along, length = directed(points, first, second)
        invariants = [
            jnp.sum(normals[first] * along, axis=-1),
            jnp.sum(normals[second] * along, axis=-1),
            jnp.sum(normals[first] * normals[second], axis=-1),
            length,
        ]
        x = jnp.concatenate([known[first], known[second], jnp.stack(invariants, axis=-1)], axis=-1)
        for inner, outer, shortcut in self.residual:
            x = outer(jax.nn.relu(inner(x))) + (x if shortcut is None else shortcut(x))
        bins, angles = self.config.center_bins, self.config.angle_bins
        mu, nu, turned, signs, size = jnp.split(
            self.final(x), np.cumsum([bins, bins, 2 * angles, 2]), axis=-1
        )
        return CppfOutputs(mu, nu, turned.reshape(-1, 2, angles), signs, size)


@dataclass(frozen=True)
class CppfLoss:
    """CPPF's losses of one cloud. Attributes: pairs, of each cloud."""

    pairs: int = 4096

    def __call__(
        self, model: CppfModel, sample: CloudBatch, *, key: PRNGKeyArray
    ) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
        """The loss of one row of a batch, and its parts."""
        config = model.config
        first_key, second_key = jax.random.split(key)
        centre = _centre(sample.points, sample.mask)
        points = jnp.where(sample.mask[:, None], sample.points - centre, 0.0)
        normals = unoriented(sample.normals)
        count = jnp.sum(sample.mask)
        first = jax.random.randint(first_key, (self.pairs,), 0, count)
        second = jax.random.randint(second_key, (self.pairs,), 0, count)
        known = model.encode(points, normals, sample.mask)
        out = model.pairs(points, normals, known, first, second)

        along, _ = directed(points, first, second)
        offset = points[first] - (sample.pose[:3, 3] - centre)
        mu = jnp.sum(offset * along, axis=-1)
        nu = jnp.linalg.norm(offset - mu[:, None] * along + 1e-9, axis=-1)
        reach = config.reach
        parts = {
            "mu": _divergence(out.mu, mu + reach[0], 2 * reach[0]),
            "nu": _divergence(out.nu, nu, reach[1]),
        }
        facing = towards(normals[first], along)
        folded = (config.symmetry.unsigned_x, config.symmetry.unsigned_y)
        for i, (name, fold) in enumerate(zip("xy", folded, strict=True)):
            axis = sample.pose[:3, i]
            cosine = jnp.clip(jnp.matmul(along, axis, precision=EXACT), -0.999999, 0.999999)
            angle = jnp.arccos(jnp.abs(cosine) if fold else cosine)
            sign = optax.sigmoid_binary_cross_entropy(out.signs[:, i], facing @ axis > 0)
            loss = _divergence(out.angles[:, i], angle, jnp.pi) + jnp.mean(sign)
            parts[name] = loss if i == 0 else jnp.where(sample.symmetry.axial, 0.0, loss)
        mean = jnp.asarray(config.mean_log_extents)
        parts["extents"] = jnp.mean((out.log_extents - (jnp.log(sample.extents) - mean)) ** 2)
        return sum(parts.values(), start=jnp.zeros(())), parts


def unoriented(normals: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """Normals whose signs do not tell which side of a surface is seen.

    CPPF takes them as Open3D estimates them: which sign an eigenvector gets is decided by its largest
    component, positive for x and z and negative for y (measured on round neighbourhoods).
    """
    largest = jnp.argmax(jnp.abs(normals), axis=-1)
    sign = jnp.sign(jnp.take_along_axis(normals, largest[:, None], axis=-1))
    return normals * sign * jnp.array([1.0, -1.0, 1.0])[largest][:, None]


def _centre(points: Float[Array, "n 3"], mask: Bool[Array, "n"]) -> Float[Array, "3"]:
    """The mean point: keeps coordinates small."""
    return jnp.sum(jnp.where(mask[:, None], points, 0.0), axis=0) / jnp.maximum(jnp.sum(mask), 1)


def _divergence(
    logits: Float[Array, "p bins"], value: Float[Array, "p"], longest: float
) -> Float[Array, ""]:
    """Kullback-Leibler divergence from a value shared between the two bins next to it."""
    bins = logits.shape[-1]
    place = jnp.clip(value / longest, 0.0, 1.0) * (bins - 1)
    soft = jnp.maximum(0.0, 1 - jnp.abs(place[:, None] - jnp.arange(bins)))
    entropy = -jnp.sum(jax.scipy.special.xlogy(soft, soft), axis=-1)
    cross = -jnp.sum(soft * jax.nn.log_softmax(logits), axis=-1)
    return jnp.mean(cross - entropy)
