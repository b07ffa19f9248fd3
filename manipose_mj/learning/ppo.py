"""Proximal policy optimisation on batched worlds: rollout and update in one `scan`, nothing leaves the device.

Schulman et al., "Proximal policy optimization algorithms" (2017) and "High-dimensional continuous control using
generalized advantage estimation" (2016); the learning rate follows the change of the policy, as in Rudin et al.,
"Learning to walk in minutes" (2022).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from manipose_mj.batch.observations import Observation
from manipose_mj.batch.state import State
from manipose_mj.batch.worlds import Worlds
from manipose_mj.errors import InputError
from manipose_mj.learning.network import ActorCritic, NetworkConfig, Normaliser

Features = Callable[[Observation], Float[Array, "worlds n"]]
Command = Callable[[Observation, Float[Array, "worlds actions"]], Float[Array, "worlds m"]]
_RATES = (1e-5, 1e-3)  # between which the learning rate stays


@dataclass(frozen=True)
class PpoConfig:
    """Attributes:
    hold: Control steps for which an action is held.
    steps: Actions between updates.
    epochs, minibatches: In an update.
    discount, trace: Of rewards to come, and of the advantages' errors (gamma, lambda).
    clip: Of the ratio of probabilities.
    change: Of the policy in an update that the learning rate aims at (Kullback-Leibler divergence).
    rate: The learning rate to begin with.
    value_weight, entropy_weight: In the loss.
    longest: Of gradients.
    """

    hold: int = 10
    steps: int = 16
    epochs: int = 5
    minibatches: int = 4
    discount: float = 0.97
    trace: float = 0.95
    clip: float = 0.2
    change: float = 0.012
    rate: float = 3e-4
    value_weight: float = 1.0
    entropy_weight: float = 1e-3
    longest: float = 1.0

    def require_worlds(self, count: int) -> None:
        """Raises InputError where the actions of so many worlds in an update are fewer than its minibatches."""
        if count * self.steps < self.minibatches:
            raise InputError(
                f"{count} worlds are too few for {self.minibatches} minibatches of {self.steps} actions each"
            )


class Learner(NamedTuple):
    """All that a training goes on from.

    Attributes: network; normaliser; optimiser, its state; rate, the learning rate; worlds, their state; key.
    """

    network: ActorCritic
    normaliser: Normaliser
    optimiser: optax.OptState
    rate: Float[Array, ""]
    worlds: State
    key: PRNGKeyArray


class Progress(NamedTuple):
    """Of one update.

    Attributes: reward, mean of an action's; ended, episodes; succeeded, of them at their end; once, at any time;
    overflowed, whose physics does not count; diverged; change, of the policy; rate; spread, mean of actions'.
    """

    reward: Float[Array, "*u"]
    ended: Int[Array, "*u"]
    succeeded: Int[Array, "*u"]
    once: Int[Array, "*u"]
    overflowed: Int[Array, "*u"]
    diverged: Int[Array, "*u"]
    change: Float[Array, "*u"]
    rate: Float[Array, "*u"]
    spread: Float[Array, "*u"]


class _Step(NamedTuple):
    """What is kept of each action; the last six are about the step that followed."""

    seen: Float[Array, "*t worlds n"]
    action: Float[Array, "*t worlds actions"]
    mean: Float[Array, "*t worlds actions"]
    log_probability: Float[Array, "*t worlds"]
    value: Float[Array, "*t worlds"]
    reward: Float[Array, "*t worlds"]
    next_value: Float[Array, "*t worlds"]
    terminated: Bool[Array, "*t worlds"]
    done: Bool[Array, "*t worlds"]
    success: Bool[Array, "*t worlds"]
    once: Bool[Array, "*t worlds"]
    overflowed: Bool[Array, "*t worlds"]


class _Sample(NamedTuple):
    """What a loss is made of."""

    seen: Float[Array, "*b n"]
    action: Float[Array, "*b actions"]
    mean: Float[Array, "*b actions"]
    log_probability: Float[Array, "*b"]
    advantage: Float[Array, "*b"]
    target: Float[Array, "*b"]


class Ppo:
    """Learns a policy of batched worlds."""

    def __init__(
        self,
        worlds: Worlds,
        features: Features,
        command: Command,
        actions: int,
        config: PpoConfig | None = None,
    ) -> None:
        """Compiles nothing yet.

        Args:
          worlds: To learn in; they restart themselves.
          features: What the networks see of an observation.
          command: The worlds' action, of an observation and the policy's action.
          actions: Numbers in the latter.
          config: How to learn.

        Raises:
          InputError: The worlds' actions in an update are fewer than its minibatches.
        """
        self.config = config or PpoConfig()
        self.config.require_worlds(worlds.count)
        self._worlds, self._features, self._command = worlds, features, command
        self._actions = actions
        self._optimiser = optax.chain(
            optax.clip_by_global_norm(self.config.longest), optax.scale_by_adam(eps=1e-5)
        )
        self.improve = eqx.filter_jit(self._improve)

    def begin(self, key: PRNGKeyArray) -> Learner:
        """A learner that has learnt nothing; its worlds are at different times of their episodes."""
        first, reset, times, rest = jax.random.split(key, 4)
        state = self._worlds.reset(reset)
        horizon = self._worlds.pool.layout.horizon
        early = jax.random.randint(times, (self._worlds.count,), 0, horizon)
        seen = self._features(state.observation).shape[-1]
        network = ActorCritic(NetworkConfig(seen, self._actions), key=first)
        return Learner(
            network,
            Normaliser.fresh(seen),
            self._optimiser.init(eqx.filter(network, eqx.is_array)),
            jnp.asarray(self.config.rate),
            state._replace(count=early.astype(jnp.int32)),
            rest,
        )

    def _improve(self, learner: Learner, updates: int) -> tuple[Learner, Progress]:
        """Some updates, each after a rollout; jitted as `improve`."""
        arrays, fixed = eqx.partition(learner, eqx.is_array)

        def one(arrays: Learner, _: None) -> tuple[Learner, Progress]:
            after, progress = self._update(eqx.combine(arrays, fixed))
            return eqx.filter(after, eqx.is_array), progress

        arrays, progress = jax.lax.scan(one, arrays, length=updates)
        return eqx.combine(arrays, fixed), progress

    def _update(self, learner: Learner) -> tuple[Learner, Progress]:
        key, play, learn = jax.random.split(learner.key, 3)
        state, steps = self._played(learner, play)
        samples = self._samples(steps)
        flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), samples)
        network, optimiser, change = self._learnt(learner, flat, learn)
        rate = jnp.where(change > 2 * self.config.change, learner.rate / 1.5, learner.rate)
        rate = jnp.where(change < 0.5 * self.config.change, rate * 1.5, rate)
        after = Learner(
            network,
            learner.normaliser.updated(steps.seen),
            optimiser,
            jnp.clip(rate, *_RATES),
            state,
            key,
        )
        ended = steps.done
        return after, Progress(
            reward=steps.reward.mean(),
            ended=ended.sum(),
            succeeded=(ended & steps.success).sum(),
            once=(ended & steps.once).sum(),
            overflowed=(ended & steps.overflowed).sum(),
            diverged=steps.terminated.sum(),
            change=change,
            rate=after.rate,
            spread=jnp.exp(network.log_spread).mean(),
        )

    def _played(self, learner: Learner, key: PRNGKeyArray) -> tuple[State, _Step]:
        network, normaliser = learner.network, learner.normaliser

        def act(state: State, key: PRNGKeyArray) -> tuple[State, _Step]:
            seen = self._features(state.observation)
            normal = normaliser(seen)
            mean = network.mean(normal)
            noise = jax.random.normal(key, mean.shape)
            action = mean + jnp.exp(network.log_spread) * noise
            after = self._worlds.step(
                state, self._command(state.observation, action), self.config.hold
            )
            then = normaliser(self._features(after.final_observation))
            return after, _Step(
                seen,
                action,
                mean,
                network.log_probability(mean, action),
                network.value(normal),
                after.reward,
                network.value(then),
                after.terminated,
                after.done,
                after.success,
                after.success_once,
                after.overflowed,
            )

        keys = jax.random.split(key, self.config.steps)
        return jax.lax.scan(act, learner.worlds, keys)

    def _samples(self, steps: _Step) -> _Sample:
        """Advantages, and what the critic should have said."""
        config = self.config
        going_on = jnp.where(steps.terminated, 0.0, config.discount * steps.next_value)
        errors = steps.reward + going_on - steps.value

        def back(later: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
            error, done = now
            advantage = error + jnp.where(done, 0.0, config.discount * config.trace * later)
            return advantage, advantage

        _, advantages = jax.lax.scan(
            back, jnp.zeros_like(errors[0]), (errors, steps.done), reverse=True
        )
        return _Sample(
            steps.seen,
            steps.action,
            steps.mean,
            steps.log_probability,
            advantages,
            advantages + steps.value,
        )

    def _learnt(
        self, learner: Learner, samples: _Sample, key: PRNGKeyArray
    ) -> tuple[ActorCritic, optax.OptState, Float[Array, ""]]:
        """The network and the optimiser after all epochs, and by how much the policy changed."""
        config, count = self.config, len(samples.target)
        size = count // config.minibatches
        normal = samples._replace(seen=learner.normaliser(samples.seen))
        arrays, fixed = eqx.partition(learner.network, eqx.is_array)
        loss = partial(_loss, config=config)

        def minibatch(carry, chosen: Int[Array, " size"]):
            arrays, optimiser = carry
            network = eqx.combine(arrays, fixed)
            sample = jax.tree.map(lambda leaf: leaf[chosen], normal)
            (_, change), gradients = eqx.filter_value_and_grad(loss, has_aux=True)(network, sample)
            gradients = eqx.filter(gradients, eqx.is_array)
            steps, optimiser = self._optimiser.update(gradients, optimiser)
            moved = jax.tree.map(lambda a, s: a - learner.rate * s, arrays, steps)
            return (moved, optimiser), change

        def epoch(carry, key: PRNGKeyArray):
            order = jax.random.permutation(key, count)[: size * config.minibatches]
            return jax.lax.scan(minibatch, carry, order.reshape(config.minibatches, size))

        keys = jax.random.split(key, config.epochs)
        (arrays, optimiser), changes = jax.lax.scan(epoch, (arrays, learner.optimiser), keys)
        return eqx.combine(arrays, fixed), optimiser, changes[-1].mean()


def _loss(
    network: ActorCritic, sample: _Sample, config: PpoConfig
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """The loss of a minibatch, and by how much the policy changed (Schulman, "Approximating KL divergence", 2020)."""
    mean = network.mean(sample.seen)
    log_ratio = network.log_probability(mean, sample.action) - sample.log_probability
    ratio = jnp.exp(log_ratio)
    advantage = sample.advantage
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-6)
    clipped = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
    gain = jnp.minimum(ratio * advantage, clipped * advantage).mean()
    error = optax.huber_loss(network.value(sample.seen), sample.target).mean()
    entropy = network.log_spread.sum()
    loss = -gain + config.value_weight * error - config.entropy_weight * entropy
    return loss, (ratio - 1 - log_ratio).mean()
