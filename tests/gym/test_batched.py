"""Batched worlds behind Gymnasium's vector interface."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError

from manipose_mj import batch
from manipose_mj.errors import InputError
from manipose_mj.gym.batched import BatchedEnv
from tests.batch.batched import make, wandering

TASK = "articulated/open_middle_drawer"  # where arms begin alike, and handles are elsewhere


@pytest.fixture(scope="module")
def env():
    pool = make(TASK, 2, seeds=(7, 8), obs_mode="state+pose/handle").pool
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
    first = env.reset(seed=3)[0]["pose/handle"]
    np.testing.assert_array_equal(env.reset(seed=3)[0]["pose/handle"], first)
    others = [env.reset(seed=seed)[0]["pose/handle"] for seed in range(8)]
    assert not all(np.array_equal(other, first) for other in others)


@pytest.mark.parametrize("form", [tuple, np.array, jnp.array])
def test_seeds_of_the_worlds_come_in_any_sequence(env, form):
    wanted = env.reset(seed=[8, 7])[0]["pose/handle"]
    found = env.reset(seed=form([8, 7]))[0]["pose/handle"]
    np.testing.assert_array_equal(found, wanted)
    np.testing.assert_array_equal(env.reset(seed=[7, 8])[0]["pose/handle"], wanted[::-1])
    assert not np.array_equal(wanted[0], wanted[1])


def test_what_follows_seeds_of_the_worlds_follows_from_them_alone(env):
    found = []
    for before in (3, 4, 5):
        env.reset(seed=before)
        env.reset(seed=[7, 8])
        found.append([env.reset()[0]["pose/handle"] for _ in range(3)])
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_array_equal(found[2], found[0])


def test_no_seed_for_each_world_is_no_seed(env):
    env.reset(seed=3)
    wanted = env.reset()[0]["pose/handle"]
    env.reset(seed=3)
    found = env.reset(seed=[None, None])[0]["pose/handle"]
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("seed", [-1, 1.5, "a", 2**70, [7, None], [7.5, 8], True])
def test_what_is_no_seed_is_refused(env, seed):
    with pytest.raises(InputError, match="expected a whole number from 0"):
        env.reset(seed=seed)


class Tensor:
    """Speaks DLPack, as PyTorch's do."""

    def __init__(self, values):
        self._values = values

    def __dlpack__(self, **options):
        return self._values.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._values.__dlpack_device__()


def test_all_kinds_of_actions_share_one_compiled_step(env):
    own = BatchedEnv(batch.from_pool(env.worlds.pool, 2, "c"))
    own.reset(seed=0)
    action = wandering(1, 2)[0]
    for given in (
        jnp.asarray(action),
        action,
        Tensor(action),
        action.tolist(),
        action.astype(float),
    ):
        own.step(given)
    own.reset(seed=[7, 8])
    own.step(jnp.asarray(action))
    assert own.worlds._step_jit._cache_size() == 1
    own.close()
    for late in (own.reset, lambda: own.step(action)):
        with pytest.raises(ClosedEnvironmentError, match="closed"):
            late()


@pytest.mark.parametrize(
    "actions",
    ["left", None, [[0.0] * 8, [0.0] * 7], [["a"] * 8] * 2, [[1j] * 8] * 2, [[None] * 8] * 2],
)
def test_what_is_no_action_is_refused(env, actions):
    env.reset(seed=0)
    with pytest.raises(InputError, match="actions "):
        env.step(actions)


def test_what_cannot_be_is_refused_in_one_line(env):
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"shape \(3, 8\); expected \(2, 8\)"):
        env.step(np.zeros((3, 8), np.float32))
    with pytest.raises(InputError, match="no reset options"):
        env.reset(options={"object": "mug_000"})
    with pytest.raises(InputError, match="call reset first"):
        BatchedEnv(env.worlds).step(np.zeros((2, 8), np.float32))
