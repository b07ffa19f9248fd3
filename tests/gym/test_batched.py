"""Batched worlds behind Gymnasium's vector interface."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj import batch
from manipose_mj.errors import InputError
from manipose_mj.gym.batched import BatchedEnv
from tests.batch.batched import make, wandering


@pytest.fixture(scope="module")
def env():
    pool = make("articulated/open_middle_drawer", 2, seeds=(7, 8), obs_mode="state").pool
    short = replace(pool, layout=replace(pool.layout, horizon=3))
    made = BatchedEnv(batch.from_pool(short, 2, "c"))
    yield made
    made.close()


def test_steps_are_those_of_the_worlds_and_resets_follow_in_the_same_step(env):
    observation, _ = env.reset(seed=[7, 8])
    assert env.observation_space.contains({n: np.asarray(v) for n, v in observation.items()})
    state = env.worlds.at([7, 8])
    for count, action in enumerate(wandering(3, 2), start=1):
        assert env.single_action_space.shape == action[0].shape
        state = env.worlds.step(state, action)
        given = action if count == 1 else jnp.asarray(action)
        found, reward, terminated, truncated, infos = env.step(given)
        for name, values in state.observation.items():
            np.testing.assert_array_equal(found[name], values)
        np.testing.assert_array_equal(reward, state.reward)
        assert np.asarray(truncated).tolist() == [count == 3] * 2
        assert not np.any(terminated) and not np.any(infos["failure"])
    assert np.all(infos["_final_obs"])
    last = infos["final_obs"]["panda/joint_positions"]
    assert not np.array_equal(last, found["panda/joint_positions"])


def test_a_seed_chooses_the_starts(env):
    first = env.reset(seed=3)[0]["panda/joint_positions"]
    np.testing.assert_array_equal(env.reset(seed=3)[0]["panda/joint_positions"], first)


def test_what_cannot_be_is_refused_in_one_line(env):
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"shape \(3, 8\); expected \(2, 8\)"):
        env.step(np.zeros((3, 8), np.float32))
    with pytest.raises(InputError, match="no reset options"):
        env.reset(options={"object": "mug_000"})
    with pytest.raises(InputError, match="call reset first"):
        BatchedEnv(env.worlds).step(np.zeros((2, 8), np.float32))
