"""Batched worlds in the shape of Brax's and Playground's environments."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj import batch
from manipose_mj.errors import InputError
from manipose_mj.gym.brax import BraxWorlds
from tests.batch.batched import make


@pytest.fixture(scope="module")
def env():
    pool = make(
        "articulated/open_middle_drawer", 2, seeds=(7, 8), obs_mode="state+pose/handle"
    ).pool
    short = replace(pool, layout=replace(pool.layout, horizon=3))
    made = BraxWorlds(batch.from_pool(short, 2, "c"))
    yield made
    made.worlds.close()


@pytest.mark.full
def test_a_scan_sees_what_the_worlds_do_and_where_episodes_end(env):
    first = env.reset(jax.random.split(jax.random.key(0), 2))
    assert first.obs.shape == (2, env.observation_size) and env.action_size == 8
    actions = jax.random.uniform(jax.random.key(1), (4, 2, 8), minval=-0.1, maxval=0.1)

    def one(state, action):
        after = env.step(state, action)
        return after, after

    _, steps = jax.lax.scan(one, first, actions)
    np.testing.assert_array_equal(steps.done, [[0, 0], [0, 0], [1, 1], [0, 0]])
    np.testing.assert_array_equal(steps.info["truncation"], steps.done)
    np.testing.assert_array_equal(np.asarray(steps.info["steps"])[:, 0], [1, 2, 3, 1])
    assert not np.array_equal(steps.obs[2], steps.info["final_obs"][2])
    np.testing.assert_array_equal(steps.obs[1], steps.info["final_obs"][1])
    low, high = env.worlds.lower, env.worlds.upper
    own = env.worlds.step(first.data, low + (actions[0] + 1) / 2 * (high - low))
    np.testing.assert_allclose(steps.reward[0], own.reward, atol=1e-6)
    joints = np.asarray(own.observation["panda/joint_positions"])[0]
    apart = np.abs(joints[:, None] - np.asarray(steps.obs[0, 0])).min(axis=1)
    assert (apart < 1e-5).all()


def test_keys_are_one_or_one_a_world(env):
    for number in range(6):
        raw = jnp.array([[0, number], [0, 9]], jnp.uint32)
        np.testing.assert_array_equal(env.reset(raw).obs, env.reset(raw[0]).obs)
    begun = [np.asarray(env.reset(jax.random.key(number)).obs) for number in range(6)]
    assert not all(np.array_equal(each, begun[0]) for each in begun)
    with pytest.raises(InputError, match=r"keys of shape \(3,\) for 2 worlds"):
        env.reset(jax.random.split(jax.random.key(0), 3))
    for number in (0, np.int32(0)):
        with pytest.raises(InputError, match=r"key is .*; expected a key such as jax.random.key"):
            env.reset(number)
    with pytest.raises(InputError, match=r"have shape \(2, 3\); expected \(2, "):
        env.step(env.reset(raw), jnp.zeros((2, 3)))
    assert env.unwrapped is env
    begun = env.reset(raw)
    assert begun.replace(reward=begun.done + 2).reward.tolist() == [2, 2]
