"""The network that tells each pair of points where the label's origin and axes are, and how surely."""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from manipose_mj.ppf_jax.rigid.features import (
    PAIR_FEATURES,
    Cloud,
    edge_features,
    neighbours,
    pair_features,
)

PAIR_OUTPUTS = 4  # mu, nu, cosine to X, cosine to Y
LINE_OUTPUTS = 2  # cosine to the line of X, to the line of Y


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes of the voting network.

    Attributes:
      neighbours: Points whose surface is a point's local context.
      anchors: Points of the cloud that every point exchanges features with.
      local_width: Features of the local context.
      width: Features of a point.
      pair_width: Features of a pair.
      pair_layers: Residual layers on these.
      lines: Whether pairs vote for the lines of X and Y as well, for objects whose ends are alike.
    """

    neighbours: int = 12
    anchors: int = 24
    local_width: int = 32
    width: int = 64
    pair_width: int = 64
    pair_layers: int = 2
    lines: bool = False

    @property
    def outputs(self) -> int:
        """Values that a pair votes for."""
        return PAIR_OUTPUTS + LINE_OUTPUTS * self.lines


class Dense(eqx.Module):
    """An affine map of the last axis; NumPy draws the weights, the same for every device."""

    weight: Float[Array, "inputs outputs"]
    bias: Float[Array, "outputs"]

    def __init__(self, inputs: int, outputs: int, *, rng: np.random.Generator, gain: float = 2.0):
        scale = (gain / inputs) ** 0.5
        self.weight = jnp.asarray(scale * rng.normal(size=(inputs, outputs)), jnp.float32)
        self.bias = jnp.zeros(outputs)

    def __call__(self, x: Float[Array, "*b inputs"]) -> Float[Array, "*b outputs"]:
        return x @ self.weight + self.bias


def standardised(x: Float[Array, "*b f"]) -> Float[Array, "*b f"]:
    """Layer normalisation; the affine map that follows makes gains and offsets idle.

    Features after a rectifier and a maximum are large and positive: without this, a few steps of Adam
    push all units of the next layer below zero for good.
    """
    x = x - jnp.mean(x, axis=-1, keepdims=True)
    return x / jnp.sqrt(jnp.mean(x**2, axis=-1, keepdims=True) + 1e-5)


class PairVotes(eqx.Module):
    """What each pair says, in the units of the cloud it was drawn from.

    Attributes:
      start: `(p, 3)`, the first point.
      along: `(p, 3)`, unit, from the first to the second point.
      values: `(p, 4)` or `(p, 6)`: signed distance of the origin along `along` from `start` (mu), its
        distance from the line (nu), the cosines of `along` to the label's X and Y, and to their lines.
      log_scale: As many, the logarithm of the Laplace scale of each.
    """

    start: Float[Array, "p 3"]
    along: Float[Array, "p 3"]
    values: Float[Array, "p outputs"]
    log_scale: Float[Array, "p outputs"]


class EdgeMaps(eqx.Module):
    """The affine maps of a layer in which points learn from others, by features of both and of the edge."""

    of_point: Dense
    of_other: Dense
    of_edge: Dense
    merge: Dense

    def __init__(self, inputs: int, edges: int, width: int, *, rng: np.random.Generator):
        self.of_point = Dense(inputs, width, rng=rng, gain=0.7)
        self.of_other = Dense(inputs, width, rng=rng, gain=0.7)
        self.of_edge = Dense(edges, width, rng=rng, gain=0.7)
        self.merge = Dense(inputs + 2 * width, width, rng=rng)


class AnchorLayer(eqx.Module):
    """Tells every point where it stands against a few points of the cloud, and what these know."""

    maps: EdgeMaps

    def __call__(
        self,
        known: Float[Array, "n inputs"],
        edges: Float[Array, "n anchors features"],
        cloud: Cloud,
    ) -> Float[Array, "n width"]:
        anchors = edges.shape[1]
        hidden = jax.nn.relu(
            self.maps.of_point(known)[:, None]
            + self.maps.of_other(known[:anchors])[None]
            + self.maps.of_edge(edges)
        )
        present = cloud.mask[None, :anchors, None]
        highest = jnp.max(jnp.where(present, hidden, 0.0), axis=1)
        mean = jnp.sum(jnp.where(present, hidden, 0.0), axis=1) / jnp.maximum(jnp.sum(present), 1)
        return jax.nn.relu(self.maps.merge(jnp.concatenate([known, highest, mean], axis=-1)))


class VotingNetwork(eqx.Module):
    """Point encoder with local and global context, a head for pairs and one for the extents."""

    edge: Dense
    local: Dense
    anchor_layers: tuple[AnchorLayer, ...]
    to_global: Dense
    of_first: Dense
    of_second: Dense
    of_pair: Dense
    of_global: Dense
    pair_layers: tuple[Dense, ...]
    votes: Dense
    size_hidden: Dense
    size: Dense
    config: NetworkConfig = eqx.field(static=True)

    def __init__(self, config: NetworkConfig, *, rng: np.random.Generator):
        width, pair = config.width, config.pair_width
        self.config = config
        self.edge = Dense(PAIR_FEATURES, config.local_width, rng=rng)
        self.local = Dense(config.local_width, config.local_width, rng=rng)
        self.anchor_layers = (
            AnchorLayer(EdgeMaps(config.local_width, PAIR_FEATURES, width, rng=rng)),
            AnchorLayer(EdgeMaps(width, PAIR_FEATURES, width, rng=rng)),
        )
        self.to_global = Dense(width, 2 * width, rng=rng)
        self.of_first = Dense(width, pair, rng=rng, gain=0.5)
        self.of_second = Dense(width, pair, rng=rng, gain=0.5)
        self.of_pair = Dense(PAIR_FEATURES, pair, rng=rng, gain=0.5)
        self.of_global = Dense(2 * width + 1, pair, rng=rng, gain=0.5)
        self.pair_layers = tuple(
            Dense(pair, pair, rng=rng, gain=0.5) for _ in range(config.pair_layers)
        )
        self.votes = Dense(pair, 2 * config.outputs, rng=rng, gain=0.1)
        self.size_hidden = Dense(2 * width + 1, width, rng=rng)
        self.size = Dense(width, 3, rng=rng, gain=0.1)

    def encode(self, cloud: Cloud) -> tuple[Float[Array, "n width"], Float[Array, "context"]]:
        """Features of every point and of the whole cloud, its metric size included."""
        rows, near = neighbours(cloud, self.config.neighbours)
        hidden = self.local(jax.nn.relu(self.edge(edge_features(cloud, rows))))
        known = jax.nn.relu(jnp.max(jnp.where(near[..., None], hidden, -1e9), axis=1))
        anchors = jnp.broadcast_to(
            jnp.arange(self.config.anchors), (len(known), self.config.anchors)
        )
        edges = edge_features(cloud, anchors)
        for layer in self.anchor_layers:
            known = layer(known, edges, cloud)
        seen = jnp.where(cloud.mask[:, None], self.to_global(known), -1e9)
        size = jnp.log(cloud.scale / 0.05)[None]
        return known, jnp.concatenate([jax.nn.relu(jnp.max(seen, axis=0)), size])

    def pairs(
        self,
        cloud: Cloud,
        known: Float[Array, "n width"],
        context: Float[Array, "context"],
        first: Int[Array, "p"],
        second: Int[Array, "p"],
    ) -> PairVotes:
        """The votes of pairs of rows."""
        invariants = pair_features(
            cloud.points[first],
            cloud.normals[first],
            cloud.views[first],
            cloud.points[second],
            cloud.normals[second],
        )
        # The first layer is linear in the points' features: once a point, not once a pair.
        hidden = (
            self.of_first(known)[first]
            + self.of_second(known)[second]
            + self.of_pair(invariants)
            + self.of_global(context)
        )
        for layer in self.pair_layers:
            hidden = hidden + layer(jax.nn.relu(hidden))
        raw, count = self.votes(jax.nn.relu(hidden)), self.config.outputs
        offset = cloud.points[second] - cloud.points[first]
        length = jnp.sqrt(jnp.sum(offset**2, axis=-1, keepdims=True) + 1e-8)
        return PairVotes(
            start=cloud.points[first],
            along=offset / length,
            values=raw[:, :count],
            # Between 1 % and a few times the cloud's size: no vote is ever certain or without end.
            log_scale=3 * jnp.tanh(raw[:, count:] / 3) - 1.5,
        )

    def extents(self, context: Float[Array, "context"]) -> Float[Array, "3"]:
        """Logarithm of the lengths of the label's bounding box, in units of the cloud's size."""
        return self.size(jax.nn.relu(self.size_hidden(context))) + 0.7
