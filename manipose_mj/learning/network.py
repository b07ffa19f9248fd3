"""Actor and critic: two perceptrons that see normalised features."""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

_CLIPPED = 10.0  # normalised features beyond this tell no more


@dataclass(frozen=True)
class NetworkConfig:
    """Attributes: features, actions: how many; width, depth: of the hidden layers; spread: of actions at first."""

    features: int
    actions: int
    width: int = 128
    depth: int = 2
    spread: float = 0.6


class Normaliser(eqx.Module):
    """Mean and variance of all features seen so far."""

    mean: Float[Array, " n"]
    variance: Float[Array, " n"]
    count: Float[Array, ""]

    @classmethod
    def fresh(cls, features: int) -> Normaliser:
        """Of no features yet."""
        return cls(jnp.zeros(features), jnp.ones(features), jnp.asarray(1.0))

    def __call__(self, seen: Float[Array, "*b n"]) -> Float[Array, "*b n"]:
        """Features of mean 0 and variance 1, within limits."""
        scaled = (seen - self.mean) / jnp.sqrt(self.variance + 1e-4)
        return jnp.clip(scaled, -_CLIPPED, _CLIPPED)

    def updated(self, seen: Float[Array, "*b n"]) -> Normaliser:
        """With more features (Chan, Golub and LeVeque, "Updating formulae", 1979)."""
        flat = seen.reshape(-1, seen.shape[-1])
        count = jnp.asarray(len(flat), jnp.float32)
        mean, variance = flat.mean(axis=0), flat.var(axis=0)
        total = self.count + count
        away = mean - self.mean
        squares = self.variance * self.count + variance * count
        squares += away**2 * self.count * count / total
        return Normaliser(self.mean + away * count / total, squares / total, total)


class ActorCritic(eqx.Module):
    """A Gaussian policy and a value."""

    actor: eqx.nn.MLP
    critic: eqx.nn.MLP
    log_spread: Float[Array, " actions"]

    def __init__(self, config: NetworkConfig, *, key: PRNGKeyArray) -> None:
        """Random weights; actions are near zero at first."""
        ours, theirs = jax.random.split(key)
        shape = {"width_size": config.width, "depth": config.depth, "activation": jax.nn.elu}
        actor = eqx.nn.MLP(config.features, config.actions, **shape, key=ours)
        last = actor.layers[-1].weight
        self.actor = eqx.tree_at(lambda net: net.layers[-1].weight, actor, 0.01 * last)
        self.critic = eqx.nn.MLP(config.features, "scalar", **shape, key=theirs)
        self.log_spread = jnp.full(config.actions, jnp.log(config.spread))

    def mean(self, seen: Float[Array, "b n"]) -> Float[Array, "b actions"]:
        """Of the actions."""
        return jax.vmap(self.actor)(seen)

    def value(self, seen: Float[Array, "b n"]) -> Float[Array, " b"]:
        """Discounted reward to come."""
        return jax.vmap(self.critic)(seen)

    def log_probability(
        self, mean: Float[Array, "b actions"], action: Float[Array, "b actions"]
    ) -> Float[Array, " b"]:
        """Of actions, but for a constant."""
        scaled = (action - mean) * jnp.exp(-self.log_spread)
        return -jnp.sum(0.5 * scaled**2 + self.log_spread, axis=-1)
