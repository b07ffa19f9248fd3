"""Stable-Baselines3's checker and Shimmy's wrapper, where the extra `conformance` is installed."""

from __future__ import annotations

import warnings

import gymnasium
import numpy as np
import pytest

import manipose_mj
from manipose_mj import suite
from manipose_mj.gym import env_id
from tests.few_objects import few, load


@pytest.mark.parametrize("task", suite.ALL_TASKS, ids="/".join)
def test_stable_baselines3_is_content(task):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gymnasium.make(
        env_id(task[1]), control_mode="pd_ee_delta_pose", objects=few("/".join(task))
    ).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # its taste in spaces
        checker.check_env(env, warn=True, skip_render_check=True)
    env.close()


def test_stable_baselines3_learns_a_step():
    ppo = pytest.importorskip("stable_baselines3").PPO
    env = gymnasium.make("manipose_mj/TargetPose-v0", control_mode="pd_ee_delta_pose")
    model = ppo("MultiInputPolicy", env, n_steps=16, batch_size=16, n_epochs=1, seed=0)
    model.learn(16)
    env.close()


@pytest.mark.parametrize("task", suite.ALL_TASKS, ids="/".join)
def test_shimmy_wraps_our_environments(task):
    wrapper = pytest.importorskip("shimmy").DmControlCompatibilityV0
    env = wrapper(load(*task, seed=0, environment_kwargs={"time_limit": 0.1}))
    observation, _ = env.reset(seed=0)
    assert observation.keys() == env.observation_space.keys()
    env.action_space.seed(0)
    for _ in range(10):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        assert all(np.isfinite(value).all() for value in observation.values())
        if terminated or truncated:
            break
    assert truncated and not terminated
    env.close()


def test_shimmy_makes_what_dm_control_makes():
    pytest.importorskip("shimmy")
    manipose_mj.register_suite()
    from dm_control import suite as dm_suite
    from shimmy import DmControlCompatibilityV0

    env = DmControlCompatibilityV0(dm_suite.load("single_object", "target_pose"))
    env.reset(seed=1)
    env.step(env.action_space.sample())
    env.close()
