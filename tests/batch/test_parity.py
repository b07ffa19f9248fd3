"""A world of the engine `c` is the CPU task's episode of the same seed."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np
import pytest

from manipose_mj import batch, suite
from manipose_mj.actions import CONTROL_MODES
from manipose_mj.batch.drawing import draw_pool
from tests.batch.batched import make, on_the_cpu, simulation_of, wandering
from tests.few_objects import config

TASKS = ["/".join(task) for task in suite.ALL_TASKS]
MODES_OF = "single_object/target_pose"
SEED = 5


def assert_observed_alike(state, world: int, observation) -> None:
    assert set(state.observation) == set(observation)
    for name, expected in observation.items():
        found = np.asarray(state.observation[name][world])
        assert found.shape == expected.shape, name
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5, err_msg=name)


@pytest.mark.sample(1)
@pytest.mark.parametrize("task", TASKS)
def test_a_world_is_the_episode_of_its_seed_bit_for_bit(task):
    steps = 8
    seeds = [SEED + 1, SEED] if task == TASKS[0] else [SEED]
    worlds = make(task, len(seeds), seed=SEED, reward_mode="dense")
    actions = wandering(steps, len(seeds))
    states = [worlds.at(seeds)]
    for action in actions:
        states.append(worlds.step(states[-1], action))
    states = jax.device_get(states)  # one by one their numbers would each be a program
    for world, seed in enumerate(seeds):
        environment = on_the_cpu(task, seed, reward_mode="dense")
        for state, action in zip(states[1:], actions, strict=True):
            step = environment.step(action[world])
            own = simulation_of(environment)
            found = np.asarray(state.simulation[world]).view(float)[: len(own)]
            np.testing.assert_array_equal(found, own)
            assert_observed_alike(state, world, step.observation)
            assert float(state.reward[world]) == pytest.approx(step.reward, abs=1e-5)
            assert bool(state.success[world]) is environment.task.success_now


@pytest.fixture(scope="module")
def drawn():
    """Two starts for every control mode, which changes nothing about them."""
    return draw_pool(config(MODES_OF, obs_mode="state"), [SEED, SEED + 1])


def test_starts_are_the_same_in_every_control_mode(drawn):
    other = draw_pool(config(MODES_OF, obs_mode="state", control_mode="pd_ee_pose"), drawn.seeds)
    assert other.digest == drawn.digest
    assert other.layout == replace(drawn.layout, control_mode="pd_ee_pose")


@pytest.mark.full
@pytest.mark.parametrize("mode", CONTROL_MODES)
def test_control_modes_are_those_of_the_task(mode, drawn):
    pool = replace(drawn, layout=replace(drawn.layout, control_mode=mode))
    worlds = batch.from_pool(pool, 2, "c")
    rng = np.random.default_rng(0)
    if mode in ("pd_joint_pos", "pd_joint_pos_vel"):
        actions = np.zeros((6, 2, len(worlds.lower)), np.float32)
        actions[..., :7] = wandering(6, 2)[..., :7]
        actions[..., -1] = 0.03
    else:
        low, high = worlds.lower, worlds.upper
        actions = rng.uniform(low, high, (6, 2, len(low))).astype(np.float32)
        if mode == "pd_ee_pose":
            actions[..., :6] = np.array([0.5, 0.1, 0.3, np.pi, 0.0, 0.4], np.float32)
    state = worlds.at([SEED, SEED + 1])
    environment = on_the_cpu(MODES_OF, SEED, control_mode=mode, obs_mode="state")
    for action in actions:
        state = worlds.step(state, action)
        step = environment.step(action[0])
    found = np.asarray(state.observation["panda/joint_positions"][0])
    moved = np.abs(found - np.asarray(worlds.at([SEED] * 2).measurement.joints[0])).max()
    assert moved > 1e-3
    expected = step.observation["panda/joint_positions"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4)


def test_randomised_worlds_are_randomised_as_the_task_with_its_latency():
    task = "articulated/open_middle_drawer"
    worlds = make(task, seed=1, randomisation="strong", obs_mode="state")
    assert len({start.latency for start in worlds.pool.starts}) == 2
    actions = wandering(4, 2)
    state = worlds.at([1, 2])
    for action in actions:
        state = worlds.step(state, action)
    for world, seed in enumerate((1, 2)):
        environment = on_the_cpu(task, seed, randomisation="strong", obs_mode="state")
        for action in actions:
            environment.step(action[world])
        positions = environment.physics.data.qpos
        found = np.asarray(state.simulation[world]).view(float)[1 : 1 + len(positions)]
        # What the robot is sent before the first target arrives is in single precision here.
        np.testing.assert_allclose(found, positions, rtol=0, atol=1e-6)
