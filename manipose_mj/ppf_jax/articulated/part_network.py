"""What each point of furniture, seen in the frame of its body, says of the part it belongs to.

Every point tells whether it is on a handle, on a part that moves, or on the rest, and votes for its part's
handle, joint and opening, each with its uncertainty. Lengths stay metric: handles have the size of hands.
"""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from manipose_mj.ppf_jax.rigid.network import Dense, EdgeMaps, standardised

CLASSES = 3  # the rest, a moving part, a handle
LENGTH = 0.1  # unit of votes for places [m]
TURN = 0.1  # unit of votes for the frame's error [rad]
SLIDE_LENGTH = 0.3  # opening of a drawer that is voted for as 1 [m]
# Votes of a point and how many numbers each has; each has one scale.
VOTES = {"centre": 3, "x": 3, "y": 3, "axis": 3, "line": 3, "opening": 1, "turn": 3}
_NEAREST_LOG_SCALE, _FARTHEST_LOG_SCALE = -4.5, 2.0
_EDGE_FEATURES = 8


@dataclass(frozen=True)
class PartNetworkConfig:
    """Sizes of the part network.

    Attributes:
      width: Features of a point.
      hidden: Of the head.
      neighbours: Points that a layer relates to each.
      among: Of how many of the cloud's points, which are in random order, each layer's are the nearest;
        so the reach grows.
      reach: About how far these are [m].
      anchors: Points that all others exchange features with in the end.
    """

    width: int = 64
    hidden: int = 128
    neighbours: int = 16
    among: tuple[int, ...] = (2048, 512, 128)
    reach: tuple[float, ...] = (0.03, 0.06, 0.15)
    anchors: int = 32


class BodyCloud(eqx.Module):
    """A cloud in the frame of the body.

    Attributes:
      points: `(n, 3)` [m], about the points' mean; 0 in padding, which comes last.
      normals: `(n, 3)`, unit; 0 in padding.
      views: `(n, 3)`, unit, to the camera; 0 in padding.
      mask: `(n,)`.
    """

    points: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]
    views: Float[Array, "n 3"]
    mask: Bool[Array, "n"]


class PointVotes(eqx.Module):
    """What each point says, in the frame of the body.

    Attributes:
      logits: `(n, 3)`, of the rest, a moving part, a handle.
      hinge: `(n,)`, logit of its part turning.
      values: By the names of `VOTES`: offset to the handle's centre and to the nearest point of the
        joint's line, in units of `LENGTH`; the handle's X and Y and the joint's direction; the opening
        [rad, or units of `SLIDE_LENGTH`]; the rotation vector by which the frame is off, in units of
        `TURN`.
      log_scale: By the same names `(n,)`, logarithm of the Laplace scale of each vote.
      frame: Logit of the frame's being the body's, and not one whose front is another side.
    """

    logits: Float[Array, "n 3"]
    hinge: Float[Array, "n"]
    values: dict[str, Float[Array, "n k"]]
    log_scale: dict[str, Float[Array, "n"]]
    frame: Float[Array, ""]


class ContextLayer(eqx.Module):
    """Tells every point what some others around it are like."""

    maps: EdgeMaps

    def __call__(
        self,
        known: Float[Array, "n inputs"],
        cloud: BodyCloud,
        others: Int[Array, "n k"] | None,
        reach: float,
        *,
        anchors: int = 0,
    ) -> Float[Array, "n width"]:
        """What each point knows of `others`, or of the first `anchors` points, about `reach` [m] away."""
        told, points, normals, there = (
            self.maps.of_other(known),
            cloud.points,
            cloud.normals,
            cloud.mask,
        )
        if others is None:
            told, points, normals, there = (
                rows[None, :anchors] for rows in (told, points, normals, there)
            )
        else:
            told = taken(told, others)
            points, normals, there = points[others], normals[others], there[others]
        offset = (points - cloud.points[:, None]) / reach
        distance = jnp.sqrt(jnp.sum(offset**2, axis=-1, keepdims=True) + 1e-6)
        normals = jnp.broadcast_to(normals, offset.shape)
        across = jnp.sum(normals * offset, axis=-1, keepdims=True)
        edges = jnp.concatenate([offset, distance, normals, across], axis=-1)
        # The first layer is linear in the points' features: once a point, not once an edge.
        hidden = jax.nn.relu(self.maps.of_point(known)[:, None] + told + self.maps.of_edge(edges))
        present = there[..., None]
        highest = jnp.max(jnp.where(present, hidden, 0.0), axis=1)
        mean = jnp.sum(jnp.where(present, hidden, 0.0), axis=1)
        mean = mean / jnp.maximum(jnp.sum(present, axis=1), 1)
        merged = self.maps.merge(jnp.concatenate([known, highest, mean], axis=-1))
        return jax.nn.relu(standardised(merged))


class PartNetwork(eqx.Module):
    """Layers of growing reach, the whole cloud, and a head."""

    first: Dense
    layers: tuple[ContextLayer, ...]
    to_global: Dense
    head: tuple[Dense, ...]
    votes: Dense
    scorer_hidden: Dense
    scorer: Dense
    config: PartNetworkConfig = eqx.field(static=True)

    def __init__(self, config: PartNetworkConfig, *, rng: np.random.Generator):
        width = config.width
        self.config = config
        self.first = Dense(9, width, rng=rng)
        count = len(config.among) + 1
        maps = (EdgeMaps(width, _EDGE_FEATURES, width, rng=rng) for _ in range(count))
        self.layers = tuple(ContextLayer(each) for each in maps)
        self.to_global = Dense(width, width, rng=rng)
        self.head = (
            Dense((count + 1) * width, config.hidden, rng=rng),
            Dense(config.hidden, config.hidden, rng=rng),
        )
        outputs = CLASSES + 1 + sum(VOTES.values()) + len(VOTES)
        self.votes = Dense(config.hidden, outputs, rng=rng, gain=0.1)
        self.scorer_hidden = Dense(2 * width, config.hidden, rng=rng)
        self.scorer = Dense(config.hidden, 1, rng=rng, gain=0.1)

    def neighbours(self, cloud: BodyCloud) -> tuple[Int[Array, "n k"], ...]:
        """The points that each layer relates to each, whatever the frame of the cloud."""
        config, count = self.config, len(cloud.mask)
        return tuple(
            nearest_rows(cloud, min(among, count), config.neighbours) for among in config.among
        )

    def __call__(
        self, cloud: BodyCloud, neighbours: tuple[Int[Array, "n k"], ...] | None = None
    ) -> PointVotes:
        """The votes of every point; `neighbours` saves looking for them again in another frame."""
        config = self.config
        neighbours = self.neighbours(cloud) if neighbours is None else neighbours
        known = jnp.concatenate([cloud.points / 0.3, cloud.normals, cloud.views], axis=-1)
        known = jax.nn.relu(self.first(known))
        seen = []
        for layer, others, reach in zip(self.layers, neighbours, config.reach, strict=False):
            known = layer(known, cloud, others, reach)
            seen.append(known)
        known = self.layers[-1](known, cloud, None, 0.4, anchors=config.anchors)
        seen.append(known)
        whole = jnp.where(cloud.mask[:, None], self.to_global(known), -1e9)
        whole = jax.nn.relu(standardised(jnp.max(whole, axis=0)))
        mean = jnp.sum(jnp.where(cloud.mask[:, None], known, 0.0), axis=0)
        mean = mean / jnp.maximum(jnp.sum(cloud.mask), 1)
        scored = self.scorer_hidden(jnp.concatenate([whole, standardised(mean)]))
        frame = self.scorer(jax.nn.relu(scored))[0]
        hidden = jnp.concatenate([*seen, jnp.broadcast_to(whole, known.shape)], axis=-1)
        for layer in self.head:
            hidden = jax.nn.relu(standardised(layer(hidden)))
        return _split(self.votes(hidden), frame)


@jax.custom_vjp
def taken(rows: Float[Array, "n width"], index: Int[Array, "m k"]) -> Float[Array, "m k width"]:
    """`rows[index]`, whose gradient is summed in whole numbers.

    Adding floats from many threads to one place is compiled to loops that wait for each other on GPUs;
    whole numbers are added by the hardware. Their unit is a 2^-30 of what the fullest row may reach.
    """
    return rows[index]


def _taken_forward(rows: Array, index: Array) -> tuple[Array, tuple[Array, Array]]:
    return rows[index], (index, rows)


def _taken_backward(kept: tuple[Array, Array], gradient: Array) -> tuple[Array, None]:
    index, rows = kept
    most = jnp.max(jnp.zeros(len(rows), jnp.int32).at[index].add(1))
    unit = jnp.maximum(jnp.max(jnp.abs(gradient)) * most, 1e-30) / 2.0**30
    whole = (
        jnp.zeros(rows.shape, jnp.int32).at[index].add(jnp.rint(gradient / unit).astype(jnp.int32))
    )
    return whole * unit, None


taken.defvjp(_taken_forward, _taken_backward)


def nearest_rows(cloud: BodyCloud, among: int, count: int) -> Int[Array, "n count"]:
    """The nearest of the first `among` points to every point, itself included."""
    few, there = cloud.points[:among], cloud.mask[:among]
    squares = jnp.sum(few**2, axis=-1)
    distances = squares[None] - 2 * cloud.points @ few.T
    return jax.lax.top_k(-jnp.where(there, distances, jnp.inf), count)[1]


def _split(raw: Float[Array, "n outputs"], frame: Float[Array, ""]) -> PointVotes:
    values, log_scale, at = {}, {}, CLASSES + 1
    for name, size in VOTES.items():
        values[name] = raw[:, at : at + size]
        scale = raw[:, at + size]
        # Soft limits: no vote is ever certain or without end.
        middle = (_NEAREST_LOG_SCALE + _FARTHEST_LOG_SCALE) / 2
        half = (_FARTHEST_LOG_SCALE - _NEAREST_LOG_SCALE) / 2
        log_scale[name] = middle + half * jnp.tanh((scale - middle) / half)
        at += size + 1
    return PointVotes(raw[:, :CLASSES], raw[:, CLASSES], values, log_scale, frame)
