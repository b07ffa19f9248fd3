"""The soak counts what is not finite without a flag, and says what changed."""

from __future__ import annotations

import importlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.batch.batched import make

STEADY = dict(rate=100.0, device=1e9, process=1e9, broken=0, physics=0, overflowed=0, episodes=5)


@pytest.fixture
def soak():
    return importlib.import_module("batch_soak")


def test_the_verdict_compares_the_second_minute_with_the_last(soak):
    def minute(**changed):
        return soak.Minute(**{**STEADY, **changed})

    compiling = minute(rate=10.0, device=0.0)
    assert soak.verdict([compiling, minute(), minute(rate=96.0)]) == []
    slow = minute(rate=90.0, process=1.2e9, overflowed=3)
    assert soak.verdict([compiling, minute(), slow]) == [
        "3 times a world overflowed", "slower by 10%", "memory of the process grew by 200 MB",
    ]  # fmt: skip
    assert soak.verdict([minute(broken=2)]) == [
        "2 values not finite without a flag", "1 rows are too few to compare",
    ]  # fmt: skip


def test_a_few_seconds_run_and_a_value_without_a_flag_is_counted(soak, capsys):
    worlds = make("articulated/open_middle_drawer", 2, reward_mode="dense", obs_mode="state")
    (row,) = soak.soak(worlds, seconds=1e-3, row=1e-3)
    assert row.rate > 0 and row.broken == row.physics == 0
    assert capsys.readouterr().out.startswith("| 1 | ")
    state = worlds.reset(jax.random.key(0))
    joints = "panda/joint_positions"
    hurt = state._replace(
        final_observation=state.final_observation | {joints: jnp.full((2, 7), jnp.nan)}
    )
    assert int(soak.broken_values(hurt)) == 2
    flagged = hurt._replace(terminated=jnp.array([True, False]))
    assert int(soak.broken_values(flagged)) == 1


def test_limits_are_counted_bit_by_bit_and_named(soak):
    worlds = make("articulated/open_middle_drawer", 2, reward_mode="dense", obs_mode="state")
    state = worlds.reset(jax.random.key(0))
    assert not soak.limits_met(state).any()
    met = soak.limits_met(state._replace(simulation={"overflow": jnp.array([1 | 1 << 9, 1 << 9])}))
    assert met[0] == 1 and met[9] == 2 and met.sum() == 3
    pytest.importorskip("mujoco_warp")
    assert soak.named_limits(np.array(met)) == "NEFC 1, ITERATIONS 2"
