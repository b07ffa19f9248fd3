"""The learner on worlds that are a line of code: it must find what pays, and its advantages must be right."""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.learning.network import Normaliser
from manipose_mj.learning.ppo import Ppo, PpoConfig, _Step

HORIZON = 10


class Point(NamedTuple):
    """A point on a line that shall be at 1."""

    observation: dict
    final_observation: dict
    reward: jax.Array
    terminated: jax.Array
    done: jax.Array
    success: jax.Array
    success_once: jax.Array
    overflowed: jax.Array
    count: jax.Array


class Line:
    """Worlds with the interface that the learner uses."""

    count = 128
    pool = SimpleNamespace(layout=SimpleNamespace(horizon=HORIZON))

    def reset(self, key):
        place = jax.random.uniform(key, (self.count, 1), minval=-1.0)
        no, seen = jnp.zeros(self.count, bool), {"place": place}
        count = jnp.zeros(self.count, jnp.int32)
        return Point(seen, seen, jnp.zeros(self.count), no, no, no, no, no, count)

    def step(self, state, action, hold):
        assert hold == 2
        place = jnp.clip(state.observation["place"] + 0.5 * jnp.clip(action, -1, 1), -3, 3)
        away, count = jnp.abs(place[:, 0] - 1), state.count + 1
        done = count >= HORIZON
        again = jnp.where(done[:, None], 1 - 2 * jnp.sin(9 * place), place)
        good = away < 0.2
        return state._replace(
            observation={"place": again},
            final_observation={"place": place},
            reward=jnp.exp(-away),
            done=done,
            success=good,
            success_once=good,
            count=jnp.where(done, 0, count),
        )


def learner() -> Ppo:
    config = PpoConfig(hold=2, rate=1e-3)
    return Ppo(Line(), lambda seen: seen["place"], lambda seen, action: action, 1, config)  # pyright: ignore[reportArgumentType]


@pytest.mark.full
def test_it_learns_to_go_where_the_reward_is_and_repeats_itself():
    learning = learner()
    state = learning.begin(jax.random.key(0))
    assert len(np.unique(state.worlds.count)) > 5  # not all worlds end at once
    _, progress = learning.improve(state, 60)
    reward, share = np.asarray(progress.reward), progress.succeeded / progress.ended
    assert reward[-1] > reward[0] + 0.2
    assert share[-1] > 0.8 > 0.2 > share[0]
    assert np.isfinite(progress.change).all() and (np.asarray(progress.ended) > 0).all()
    _, again = learning.improve(learning.begin(jax.random.key(0)), 60)
    np.testing.assert_array_equal(again.reward, reward)


def test_advantages_are_sums_of_errors_until_an_episode_ends():
    rng, steps, worlds = np.random.default_rng(0), 6, 4
    learning = learner()
    reward, value, following = rng.normal(size=(3, steps, worlds))
    done, diverged = rng.random((2, steps, worlds)) < 0.3
    done |= diverged
    nothing = jnp.zeros((steps, worlds))
    step = _Step(
        nothing, nothing, nothing, nothing, jnp.asarray(value), jnp.asarray(reward), jnp.asarray(following),
        jnp.asarray(diverged), jnp.asarray(done), nothing, nothing, nothing,
    )  # fmt: skip
    found = learning._samples(step)
    gamma, trace = learning.config.discount, learning.config.trace
    for world in range(worlds):
        for start in range(steps):
            expected, weight = 0.0, 1.0
            for t in range(start, steps):
                later = 0.0 if diverged[t, world] else gamma * following[t, world]
                expected += weight * (reward[t, world] + later - value[t, world])
                weight *= gamma * trace
                if done[t, world]:
                    break
            np.testing.assert_allclose(
                found.advantage[start, world], expected, rtol=1e-4, atol=1e-5
            )
    np.testing.assert_allclose(found.target, found.advantage + value, rtol=1e-5)


def test_the_normaliser_knows_mean_and_variance_of_all_it_saw():
    rng = np.random.default_rng(1)
    parts = [rng.normal(3.0, 2.0, (40, 7, 2)), rng.normal(-1.0, 0.5, (25, 7, 2))]
    normaliser = Normaliser.fresh(2)
    for part in parts:
        normaliser = normaliser.updated(jnp.asarray(part))
    both = np.concatenate([part.reshape(-1, 2) for part in parts])
    np.testing.assert_allclose(normaliser.mean, both.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(normaliser.variance, both.var(axis=0), rtol=0.02)


def test_fewer_actions_than_minibatches_are_refused():
    few = Line()
    few.count = 1
    with pytest.raises(InputError, match="1 worlds are too few for 4 minibatches of 2 actions"):
        Ppo(few, lambda seen: seen["place"], lambda _, action: action, 1, PpoConfig(steps=2))
