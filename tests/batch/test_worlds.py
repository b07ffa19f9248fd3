"""What batched worlds do besides physics: episodes that end, rollouts, saved states, clear refusals."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from manipose_mj import batch
from manipose_mj.batch.kernels.cpu_loops import put_back
from manipose_mj.batch.simulator import Simulator
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.simulation_state import (
    ASLEEP,
    AWAKE_COUNTS,
    LEFT_BEHIND,
    read_simulation,
    unflatten,
    write_simulation,
)
from tests.batch.batched import make, wandering

TASK = "articulated/open_middle_drawer"


@pytest.fixture(scope="module")
def worlds():
    """Three worlds, with two starts, whose episodes last four steps."""
    made = make(TASK, 3, seeds=(7, 8), reward_mode="dense", obs_mode="state")
    short = replace(made.pool, layout=replace(made.pool.layout, horizon=4))
    return batch.from_pool(short, 3, "c")


def equal(one, other) -> None:
    jax.tree.map(np.testing.assert_array_equal, one, other)


def test_at_the_horizon_the_next_start_follows_and_the_last_observation_is_kept(worlds):
    state = worlds.at([7, 8, 7])
    fresh = worlds.at([8, 7, 8])
    for count, action in enumerate(wandering(4, 3), start=1):
        before, state = state, worlds.step(state, action)
        assert np.all(np.asarray(state.truncated) == (count == 4))
        assert not np.any(state.terminated)
    assert worlds.seeds(state).tolist() == [8, 7, 8]
    equal(state.observation, fresh.observation)
    equal(state.simulation, fresh.simulation)
    assert np.all(np.asarray(state.count) == 0)
    last, joints = state.final_observation, "panda/joint_positions"
    assert not np.array_equal(last[joints], state.observation[joints])
    assert not np.array_equal(last[joints], before.observation[joints])
    action = wandering(1, 3)[0]
    equal(worlds.step(state, action).simulation, worlds.step(fresh, action).simulation)


def test_an_action_is_held_no_longer_than_to_the_horizon(worlds):
    actions = wandering(3, 3)
    at_end = worlds.step(worlds.at([7, 8, 7]), actions[0], 4)
    beyond = worlds.step(worlds.at([7, 8, 7]), actions[0], 6)
    assert np.all(np.asarray(beyond.truncated))
    equal(beyond, at_end)


def test_a_diverged_world_fails_alone_and_begins_anew(worlds):
    state = worlds.at([7, 7, 8])
    action = wandering(1, 3)[0]
    expected = worlds.step(state, action)
    model = worlds.pool.scenes[0]
    speeds = slice(1 + model.nq, 1 + model.nq + model.nv)  # after the time and qpos
    broken = np.array(state.simulation)
    broken[1].view(float)[speeds] = 1e12
    action[2, 3] = np.nan
    after = worlds.step(state._replace(simulation=jnp.asarray(broken)), action)
    assert np.asarray(after.terminated).tolist() == [False, True, True]
    assert not np.any(after.truncated)
    assert np.asarray(after.reward)[1:].tolist() == [0.0, 0.0]
    assert worlds.seeds(after).tolist() == [7, 8, 7]
    equal(after.simulation[0], expected.simulation[0])
    joints = "panda/joint_positions"
    equal(after.final_observation[joints][1], state.observation[joints][1])
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(after.observation))


def test_what_mujoco_left_out_is_flagged_until_the_episode_ends(worlds):
    actions, begun = wandering(4, 3), worlds.at([7, 8, 7])
    state = jax.block_until_ready(worlds.step(begun, actions[0]))
    assert not np.any(state.overflowed)
    full = int(mujoco.mjtWarning.mjWARN_CNSTRFULL)
    worlds.engine._simulator.held(1)[1].warning[full].number = 1
    state = worlds.step(state, actions[1])
    assert np.asarray(state.overflowed).tolist() == [False, True, False]
    assert not np.any(state.terminated)
    # Also of a world that was put back to this state.
    jax.block_until_ready(worlds.step(begun, actions[0]))
    later = worlds.step(state, actions[2])
    assert np.asarray(later.overflowed).tolist() == [False, True, False]
    again = worlds.step(worlds.step(begun, actions[0]), actions[1])
    assert not np.any(again.overflowed)
    unflagged = state.simulation.at[:, -2:].set(0)
    np.testing.assert_array_equal(unflagged, again.simulation)
    ended = worlds.step(later._replace(count=jnp.array([3, 3, 3])), actions[3])
    assert np.asarray(ended.overflowed).tolist() == [False, True, False]
    assert not np.any(worlds.step(ended, actions[0]).overflowed)


def test_success_once_is_of_the_episode_that_ended(worlds):
    state = worlds.at([7, 8, 7])
    opened = state.measurement.openings.at[0].set(0.0)
    state = state._replace(
        measurement=state.measurement._replace(openings=opened),
        succeeded=jnp.array([True, False, False]),
        count=jnp.array([1, 1, 3]),
    )
    after = worlds.step(state, wandering(1, 3)[0])
    assert np.asarray(after.success_once).tolist() == [True, False, False]
    assert np.asarray(after.succeeded).tolist() == [True, False, False]
    after = worlds.step(after._replace(count=jnp.array([3, 1, 1])), wandering(1, 3)[0])
    assert np.asarray(after.success_once).tolist() == [True, False, False]
    assert not np.any(after.succeeded)


def test_rollouts_are_steps_also_from_states_in_between(worlds):
    actions = wandering(6, 3)
    state = worlds.at([7, 8, 8])
    states, rewards = [state], []
    for action in actions:
        states.append(worlds.step(states[-1], action))
        rewards.append(states[-1].reward)
    last, seen = worlds.rollout(actions, state)
    equal(last.simulation, states[-1].simulation)
    equal(seen.reward, np.stack(rewards))
    assert np.asarray(seen.truncated).sum() == 3
    worlds.rollout(actions[::-1], state)
    assert worlds._replay_jit._cache_size() == 1  # the recording is none of the program
    again = worlds.step(worlds.step(states[4], actions[4]), actions[5])
    equal(again.simulation, states[-1].simulation)

    def hold(observation, key):
        home = observation["panda/joint_positions"]
        return jnp.concatenate([home, observation["panda/gripper_opening"]], axis=-1)

    last, seen = jax.jit(lambda state: worlds.rollout(hold, state, 2))(state)
    assert seen.action.shape == (2, 3, 8) and np.asarray(last.count).tolist() == [2, 2, 2]


def test_a_saved_state_goes_on_alike_in_other_worlds(worlds, tmp_path):
    actions, file = wandering(3, 3), tmp_path / "state.npz"
    state = worlds.step(worlds.at([7, 8, 7]), actions[0])
    worlds.save(state, file)
    expected = worlds.step(worlds.step(state, actions[1]), actions[2])
    other = batch.from_pool(worlds.pool, 3, "c")
    found = other.step(other.step(other.restore(file), actions[1]), actions[2])
    equal(found, expected)
    with pytest.raises(InputError, match="its worlds differ"):
        batch.from_pool(worlds.pool, 2, "c").restore(file)
    moved = [replace(each, simulation=each.simulation + 0.01) for each in worlds.pool.starts]
    others = batch.from_pool(replace(worlds.pool, starts=tuple(moved)), 3, "c")
    with pytest.raises(InputError, match="its starts differ"):
        others.restore(file)
    later = replace(worlds.pool, layout=replace(worlds.pool.layout, horizon=3))
    with pytest.raises(InputError, match="its options differ"):
        batch.from_pool(later, 3, "c").restore(file)
    other_goals = [replace(each, goals=each.goals * 2) for each in worlds.pool.starts]
    assert replace(worlds.pool, starts=tuple(other_goals)).digest != worlds.pool.digest
    file.write_bytes(b"nothing")
    with pytest.raises(InputError, match="no state of worlds"):
        other.restore(file)
    worlds.save(state, file)
    with np.load(file) as saved:
        kept = {name: saved[name] for name in saved.files}
    for leaf in ({}, {"leaf_2": kept["leaf_2"][:, :1]}, {"leaf_2": kept["leaf_2"].astype(int)}):
        np.savez(file, **{name: kept[name] for name in kept if name != "leaf_2"}, **leaf)
        with pytest.raises(InputError, match="missing or have other shapes"):
            other.restore(file)


@pytest.mark.sample(1)
@pytest.mark.parametrize("threads", [1, 2])
def test_closed_worlds_say_so(worlds, threads):
    closed = batch.from_pool(worlds.pool, 3, "c", threads=threads)
    state, action = closed.at(np.array([7, 8, 7])), wandering(1, 3)[0]
    closed.close()
    late = (
        lambda: closed.step(state, action),
        lambda: closed.rollout(action[None], state),
        lambda: closed.at([7, 8, 7]),
        lambda: closed.reset(jax.random.key(0)),
    )
    for call in late:
        with pytest.raises(InputError, match="these worlds were closed"):
            call()


@pytest.mark.usefixtures("wrong_arrays")
def test_what_can_be_no_step_is_refused(worlds):
    state, action = worlds.at(jnp.array([7, 8, 7])), wandering(1, 3)[0]
    with pytest.raises(InputError, match="actions of a step are of type complex"):
        worlds.step(state, action + 0j)
    with pytest.raises(InputError, match=r"steps is 2.5; expected a whole number"):
        worlds.rollout(lambda observation, key: action, state, cast(Any, 2.5))
    with pytest.raises(InputError, match="key is 3; expected a key"):
        worlds.rollout(lambda observation, key: action, state, 1, key=cast(Any, 3))


def test_reset_takes_every_start_equally_often(worlds):
    many = batch.from_pool(worlds.pool, 5, "c")
    seeds = many.seeds(many.reset(jax.random.key(0))).tolist()
    assert sorted((seeds.count(7), seeds.count(8))) == [2, 3]


def test_pools_are_read_back_as_they_were_written(worlds, tmp_path):
    worlds.pool.save(tmp_path / "pool")
    again = batch.from_pool(tmp_path / "pool", 3, "c")
    action = wandering(1, 3)[0]
    state = worlds.at([7, 8, 7])
    equal(again.step(again.at([7, 8, 7]), action), worlds.step(state, action))
    (tmp_path / "pool").write_bytes(b"nothing")
    with pytest.raises(InputError, match="no pool of starts"):
        batch.from_pool(tmp_path / "pool", 3)


def diverging(worlds: batch.Worlds) -> batch.State:
    """Three worlds, of which the second is about to diverge."""
    state = worlds.at([7, 8, 7])
    model = worlds.pool.scenes[worlds.pool.starts[1].scene]
    broken = np.array(state.simulation)
    broken[1].view(float)[1 + model.nq : 1 + model.nq + model.nv] = 1e12  # after the time and qpos
    return state._replace(simulation=jnp.asarray(broken))


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_change_nothing(worlds, threads):
    split = batch.from_pool(worlds.pool, 3, "c", threads=threads)
    actions = wandering(6, 3)
    last, seen = split.rollout(actions, diverging(split))
    expected, wanted = worlds.rollout(actions, diverging(worlds))
    equal(last, expected)
    equal(seen, wanted)
    assert np.asarray(seen.terminated).sum() == 1
    split.close()


@pytest.mark.parametrize("threads", [1, 2])
def test_callers_in_several_threads_wait_for_one_another(worlds, threads):
    made = batch.from_pool(worlds.pool, 3, "c", threads=threads)
    state, actions = worlds.at([7, 8, 7]), wandering(8, 3)
    expected = [worlds.step(state, action).simulation for action in actions]
    with ThreadPoolExecutor(4) as callers:
        found = list(callers.map(lambda action: made.step(state, action).simulation, actions))
    equal(found, expected)
    made.close()


def test_states_are_put_back_as_the_tasks_put_them_back(worlds):
    """Also what no later step shows: who is asleep, and what the last step left behind."""
    simulator, rows = Simulator(worlds.pool, 3), np.array([0, 1, 0])
    before = np.asarray(worlds.at([7, 8, 7]).simulation).view(float)
    targets = wandering(4, 3)[:, :, None].astype(float)
    for target in targets[:3]:
        seen = simulator.room()
        simulator.advance(before, rows, target, seen)
        for world in range(3):
            put_back(simulator._constants, simulator._tables, world, before)
            model, data = simulator.held(world)
            expected = mujoco.MjData(model)
            saved = unflatten(model, expected, before[world])
            write_simulation(model, expected, saved)
            for name in (*LEFT_BEHIND, *ASLEEP, *AWAKE_COUNTS, "qpos", "qvel", "xpos", "ncon"):
                np.testing.assert_array_equal(getattr(data, name), getattr(expected, name))
            np.testing.assert_array_equal(read_simulation(model, data).flat(), saved.flat())
        before = seen.states
    simulator.close()


@pytest.mark.parametrize("threads", [1, 2])
def test_after_an_interruption_states_are_still_what_they_were(worlds, threads, monkeypatch):
    simulator = Simulator(worlds.pool, 3, threads=threads)
    states = np.asarray(worlds.at([7, 8, 7]).simulation).view(float)
    rows, (targets, others) = np.array([0, 1, 0]), wandering(2, 3)[:, :, None].astype(float)

    def after(states: np.ndarray, targets: np.ndarray) -> np.ndarray:
        seen = simulator.room()
        simulator.advance(states, rows, targets, seen)
        return seen.states

    first = after(states, targets)
    second = after(first, targets)
    after(states, targets)
    step = simulator._step

    def interrupt(*given: Any) -> None:
        step(*given)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(simulator, "_step", interrupt)
        with pytest.raises(KeyboardInterrupt):
            after(states, others)
    np.testing.assert_array_equal(after(first, targets), second)
    simulator.close()
    with pytest.raises(InputError, match="these worlds were closed"):
        after(states, targets)


@pytest.mark.full
def test_single_keys_are_observed(worlds):
    some = make(TASK, worlds=1, seeds=(7,), obs_mode="panda/joint_positions+pose/handle")
    seen = some.at([7]).observation
    assert seen.keys() == {"panda/joint_positions", "pose/handle"}
    joints = worlds.at([7, 8, 7]).observation["panda/joint_positions"]
    np.testing.assert_array_equal(seen["panda/joint_positions"], joints[:1])
    some.close()


def test_what_cannot_be_is_refused_in_one_line(worlds):
    for arguments, message in (
        ({"worlds": 0}, "worlds is 0"),
        ({"worlds": 2.5}, "worlds is 2.5; expected a whole number"),
        ({"seed": None}, "seed is None; expected a whole number"),
        ({"seeds": 5}, "seeds is 5; expected whole numbers"),
        ({"seeds": (7, 7)}, "seed 7 is given twice"),
        ({"engine": "wrap"}, "unknown engine 'wrap'"),
        ({"obs_mode": "state+rgb"}, "observation mode of batched worlds"),
        ({"control_mode": "primitive"}, "unknown control mode"),
        ({"seeds": ()}, "no seeds"),
        ({"threads": 0}, "threads is 0"),
    ):
        with pytest.raises(InputError, match=message):
            make(TASK, **arguments)
    with pytest.raises(InputError, match=r"task is \('articulated', 'open'\); expected"):
        batch.make(cast(Any, ("articulated", "open")), worlds=1, engine="c")
    with pytest.raises(InputError, match="2 seeds for 3 worlds"):
        worlds.at([7, 8])
    with pytest.raises(InputError, match="seeds is 7; expected a sequence"):
        worlds.at(7)
    with pytest.raises(InputError, match="seed is 7.5; expected a whole number"):
        worlds.at([7.5, 8, 7])
    with pytest.raises(InputError, match="seed 9 is not in the pool of 2 starts"):
        worlds.at([7, 8, 9])
    with pytest.raises(InputError, match="needs the number of steps"):
        worlds.rollout(lambda observation, key: None, worlds.at([7, 8, 7]))
    state = worlds.at([7, 8, 7])
    for action in (np.zeros((3, 7)), np.zeros((3, 9)), np.zeros((1, 8))):
        with pytest.raises(InputError, match=r"have shape .* expected \(3, 8\)"):
            worlds.step(state, action)
        with pytest.raises(InputError, match=r"have shape .* expected \(3, 8\)"):
            worlds.rollout(lambda observation, key, action=action: action, state, 2)
    for steps, message in ((3, "the recording has 2 actions"), (-1, "steps is -1")):
        with pytest.raises(InputError, match=message):
            worlds.rollout(wandering(2, 3), state, steps)
    for hold in (0, -3):
        with pytest.raises(InputError, match="hold is .*; expected a whole number, at least 1"):
            worlds.step(state, np.zeros((3, 8)), hold)


def test_without_a_gpu_one_line_says_what_is_missing():
    if jax.default_backend() == "gpu":
        pytest.skip("there is one")
    with pytest.raises(
        InputError, match=r"engine 'warp' cannot run here: .*pip install -e \"\.\[gpu\]\""
    ) as caught:
        batch.from_pool(Path("nowhere"), 3, "warp")
    assert "\n" not in str(caught.value)


def test_steps_that_were_asked_for_before_worlds_are_closed_are_made():
    some = make(TASK, 2, seeds=(7,))
    actions = wandering(3, 2)
    expected = some.at([7, 7])
    for action in actions:
        expected = jax.block_until_ready(some.step(expected, action))
    again = make(TASK, 2, seeds=(7,))
    state = again.at([7, 7])
    for action in actions:
        state = again.step(state, action)
    again.close()
    equal(state.simulation, expected.simulation)
    some.close()


def test_a_state_of_other_worlds_is_refused(worlds):
    state, action = worlds.at([7, 8, 7]), wandering(1, 3)[0]
    wider = jnp.pad(state.simulation, ((0, 0), (0, 2)))
    with pytest.raises(InputError, match=r"the state is of other worlds: .* expected \(3, \d+\)"):
        worlds.step(state._replace(simulation=wider), action)
    simulator, states = Simulator(worlds.pool, 3), np.asarray(wider).view(float)
    with pytest.raises(
        InputError, match=r"states of shape \(3, \d+\) .* these worlds have \(3, \d+\)"
    ):
        simulator.advance(states, np.array([0, 1, 0]), np.zeros((3, 1, 8)), simulator.room())
    simulator.close()
