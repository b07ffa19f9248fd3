"""Every task under noise: the physics holds, and nothing is pushed through anything."""

from __future__ import annotations

import numpy as np
import pytest

from tests.tasks.episode_driver import reset, wander


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", range(3))
def test_random_actions_neither_break_the_physics_nor_push_objects_through(blind, seed):
    reset(blind, seed)
    rng, spec = np.random.default_rng(seed), blind.action_spec()
    for _ in range(300):
        step = blind.step(rng.uniform(spec.minimum, spec.maximum))
        assert not step.last()
        assert np.isfinite(blind.physics.data.qpos).all()
    assert blind.task.max_penetration < 0.005


@pytest.mark.parametrize("steps", [80, pytest.param(300, marks=pytest.mark.full)])
def test_slow_random_motions_touch_without_sinking_in(blind, steps):
    reset(blind, 1)
    for action in wander(blind, steps, 4):
        blind.step(action)
    assert blind.task.max_penetration < 0.005
