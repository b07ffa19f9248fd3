"""What batched worlds say to keys, actions and states that are none, or of other worlds; also inside `jax.jit`."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any, cast

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from manipose_mj import batch
from manipose_mj.batch.perception.cameras import Cameras
from manipose_mj.batch.simulator import Simulator
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig
from tests.batch.batched import make, wandering
from tests.few_objects import few

TASK = "articulated/open_middle_drawer"
pytestmark = pytest.mark.usefixtures("wrong_arrays")


@pytest.fixture(scope="module")
def worlds():
    """Three worlds with two starts."""
    return make(TASK, 3, seeds=(7, 8), obs_mode="state")


@pytest.fixture(scope="module")
def state(worlds):
    """The first of them."""
    return worlds.at([7, 8, 7])


def refused(call, message: str) -> None:
    """Of one line."""
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        (0, "key is 0; expected a key"),
        (None, "key is None; expected a key"),
        (np.zeros((4, 3), np.uint32), r"key is array\(.*; expected a key"),
        (np.array([0, 1]), r"key is array\(\[0, 1\]\); expected a key"),
        (jax.random.split(jax.random.key(0), 2), r"key is an array of \(2,\) keys; expected one"),
        (np.zeros((2, 2), np.uint32), r"key is an array of \(2,\) keys; expected one"),
    ],
)
def test_what_is_no_key_is_refused(worlds, state, key, message):
    refused(lambda: worlds.reset(key), message)
    if key is not None:
        refused(lambda: worlds.rollout(lambda seen, own: None, state, 1, key=key), message)


def test_a_configuration_has_all_options(worlds):
    config = EnvConfig(TASK, obs_mode="state", objects=few(TASK))
    made = batch.make(config, worlds=1, seeds=(7,), engine="c")
    assert made.pool.layout == worlds.pool.layout
    refused(
        lambda: batch.make(config, worlds=1, engine="c", objects=["cabinet_000"]),
        "objects beside an EnvConfig; expected all options in it",
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"thread": 2}, "unknown option 'thread'; did you mean threads?"),
        ({"capacty": None}, "unknown option 'capacty'; did you mean capacity?"),
        ({"seeds": [1], "seed": 3}, "seed is 3 beside seeds; give seed or seeds"),
        ({"obs_mod": "state"}, "unknown option 'obs_mod'; did you mean obs_mode?"),
        (
            {"qqqq": 1},
            "unknown option 'qqqq'; known: capacity, control_mode, engine, .*, seed, seeds, ",
        ),
    ],
)
def test_misspelt_or_contrary_options_are_refused(options, message):
    refused(lambda: batch.make(TASK, worlds=1, engine="c", **options), message)


def test_both_kinds_of_keys_begin_alike(worlds):
    for seed in range(4):
        typed, raw = jax.random.key(seed), np.array([0, seed], np.uint32)
        np.testing.assert_array_equal(worlds.reset(typed).row, worlds.reset(cast(Any, raw)).row)
        np.testing.assert_array_equal(jax.jit(worlds.reset)(typed).row, worlds.reset(typed).row)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.full((3, 8), "far"), "actions of a step are of type <U3; expected real numbers"),
        ([["a", "b"]], r"actions of a step are \[\['a', 'b'\]\]; expected real numbers"),
        (None, "actions of a step are None; expected real numbers"),
        ([[0.0], [0.0, 1.0]], "expected numbers in equal rows"),
        (jnp.zeros((3, 8), complex), "actions of a step are of type complex64"),
        (0.0, r"have shape \(\); expected \(3, 8\)"),
    ],
)
def test_what_are_no_actions_is_refused(worlds, state, action, message):
    refused(lambda: worlds.step(state, action), message)
    refused(lambda: worlds.rollout(lambda seen, own: action, state, 1), message)
    refused(lambda: jax.jit(lambda state: worlds.step(state, action))(state), message)


@pytest.mark.parametrize("policy", ["abc", None])
def test_what_is_no_policy_is_refused(worlds, state, policy):
    said = f"actions of a step are {policy!r}; expected real numbers"
    refused(lambda: worlds.rollout(policy, state, 5), said)


def test_actions_may_be_lists_of_traced_numbers(worlds, state):
    action = wandering(1, 3)[0]
    expected = worlds.step(state, action)
    found = jax.jit(lambda rows: worlds.step(state, list(rows)))(action)
    np.testing.assert_array_equal(found.simulation, expected.simulation)


@pytest.mark.parametrize("what", [None, {}, (1, 2)])
def test_what_is_no_state_is_refused(worlds, what, tmp_path):
    action, said = wandering(1, 3)[0], f"state is a {type(what).__name__}; expected a State"
    refused(lambda: worlds.step(what, action), said)
    refused(lambda: worlds.rollout(action[None], what), said)
    refused(lambda: worlds.rollout(lambda seen, key: action, what, 1), said)
    refused(lambda: worlds.save(what, tmp_path / "state"), said)
    refused(lambda: Cameras(worlds, ("front",), height=8, width=8).look(what), said)


def test_a_state_of_more_or_fewer_worlds_is_refused(worlds):
    two = batch.from_pool(worlds.pool, 2, "c").at([7, 8])
    action, said = wandering(1, 3)[0], "the state is of 2 worlds; expected one of 3"
    refused(lambda: worlds.step(two, action), said)
    refused(lambda: worlds.rollout(action[None], two), said)
    refused(lambda: jax.jit(worlds.step)(two, action), said)


def test_a_state_of_other_worlds_of_the_same_sizes_is_refused(worlds, state, tmp_path):
    moved = [replace(each, simulation=each.simulation + 0.01) for each in worlds.pool.starts]
    others = batch.from_pool(replace(worlds.pool, starts=tuple(moved)), 3, "c")
    action, said = wandering(1, 3)[0], "the state is of other worlds: .* with other starts"
    refused(lambda: others.step(state, action), said)
    refused(lambda: others.rollout(action[None], state), said)
    refused(lambda: jax.jit(others.step)(state, action), said)
    refused(lambda: others.save(state, tmp_path / "state"), said)
    other = state._replace(identity=replace(state.identity, engine="warp"))
    refused(lambda: worlds.step(other, action), "on engine 'warp'; expected .* on engine 'c'")


def test_states_of_equal_worlds_share_what_is_compiled(worlds, state):
    again = batch.from_pool(pickle.loads(pickle.dumps(worlds.pool)), 3, "c", threads=2)
    traced = []

    @jax.jit
    def opening(state: batch.State) -> jax.Array:
        traced.append(state)
        return worlds.step(state, wandering(1, 3)[0]).measurement.openings

    np.testing.assert_array_equal(opening(state), opening(again.at([7, 8, 7])))
    assert len(traced) == 1
    again.close()


def test_too_many_worlds_for_the_memory_are_refused_before_they_are_made(worlds, monkeypatch):
    pages = {"SC_PHYS_PAGES": 1000, "SC_PAGE_SIZE": 4096}
    with monkeypatch.context() as patch:
        patch.setattr("os.sysconf", pages.get)
        with pytest.raises(InputError, match=r"^9000 worlds of this task take about \d+ GB of mem"):
            batch.from_pool(worlds.pool, 9000, "c")

    def refuse(model: Any) -> Any:
        raise mujoco.FatalError("Could not allocate memory")

    simulator = Simulator(worlds.pool, 3)
    with monkeypatch.context() as patch:
        patch.setattr(mujoco, "MjData", refuse)
        with pytest.raises(
            InputError, match="^world 1 of 3: no memory for 67 MB more of addresses"
        ):
            simulator._begin(1, 0)
    simulator.close()
