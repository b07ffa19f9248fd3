"""Every task runs on the engine `warp` and begins as on the engine `c`; on Warp's CPU device where there is no GPU."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

from manipose_mj import batch, suite
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.making import WARP_ON_CPU
from manipose_mj.tasks.core.config import EnvConfig
from tests.few_objects import few

pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
pytestmark = pytest.mark.full  # each task compiles for some seconds, the first for minutes
TASKS = ["/".join(task) for task in suite.ALL_TASKS]
SEEDS, STEPS = (5, 6), 2


@pytest.fixture(autouse=True)
def on_any_device(monkeypatch):
    monkeypatch.setenv(WARP_ON_CPU, "1")


def stepped(pool, engine: batch.making.EngineName) -> batch.State:
    worlds = batch.from_pool(pool, len(SEEDS), engine)
    state = worlds.at(SEEDS)
    joints = np.concatenate([state.measurement.joints, np.full((len(SEEDS), 1), 0.04)], axis=1)
    for _ in range(STEPS):
        state = worlds.step(state, joints.astype(np.float32))
    worlds.close()
    return jax.tree.map(np.asarray, state)


def assert_as_on_the_cpu(task: str, **options: Any) -> None:
    options = {"obs_mode": "state+pose", "reward_mode": "dense", **options}
    pool = draw_pool(EnvConfig(task, objects=few(task), **options), SEEDS)
    expected, found = (stepped(pool, engine) for engine in ("c", "warp"))
    assert not found.terminated.any() and not found.overflowed.any()
    assert set(found.observation) == set(expected.observation)
    for name, values in expected.observation.items():
        # What lies under its own weight in mesh contacts moves a little; nothing is elsewhere.
        tolerance = 0.1 if "velocit" in name or "torque" in name else 5e-3
        np.testing.assert_allclose(
            found.observation[name], values, rtol=0, atol=tolerance, err_msg=name
        )
    np.testing.assert_allclose(found.reward, expected.reward, rtol=0, atol=1e-2)
    np.testing.assert_array_equal(found.success, expected.success)


@pytest.mark.parametrize("task", TASKS)
def test_every_task_runs(task):
    assert_as_on_the_cpu(task)


@pytest.mark.parametrize("task", ["articulated/open_middle_drawer", "single_object/target_pose"])
def test_randomised_worlds_run(task):
    assert_as_on_the_cpu(task, randomisation="strong")


def test_late_servo_targets_run():
    assert_as_on_the_cpu("single_object/position", latency=0.03)
