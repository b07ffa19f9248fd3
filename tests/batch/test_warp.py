"""The engine `warp` against the engine `c`; on Warp's CPU device where there is no GPU, if the libraries are there."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from manipose_mj import batch
from manipose_mj.batch import Capacity
from manipose_mj.batch.capacity import near_pairs, touching_pairs
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.making import WARP_ON_CPU
from manipose_mj.batch.starts import RowModels, awake
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation
from tests.batch.batched import wandering

pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
pytestmark = pytest.mark.full  # it compiles for a minute
STEPS = 8


@pytest.fixture(scope="module", autouse=True)
def on_any_device():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(WARP_ON_CPU, "1")
        yield


@pytest.fixture(scope="module")
def pool():
    """Mugs, boxes and a can, with the no-slip solver off."""
    objects = ("mug_000", "box_000", "chips_can_000")
    drawn = draw_pool(
        EnvConfig("single_object/target_pose", objects=objects, reward_mode="dense"), range(6)
    )
    for scene in drawn.scenes:
        scene.opt.noslip_iterations, scene.opt.impratio = 0, 100.0
    return drawn


@pytest.fixture(scope="module")
def both(pool):
    return [batch.from_pool(pool, 6, engine) for engine in ("c", "warp")]


def test_worlds_with_different_objects_move_as_on_the_cpu(both, pool):
    states = [worlds.at(pool.seeds) for worlds in both]
    for action in wandering(STEPS, 6):
        states = [worlds.step(state, action) for worlds, state in zip(both, states, strict=True)]
    expected, found = states
    for name, tolerance in (
        ("panda/joint_positions", 1e-5),
        ("panda/joint_velocities", 1e-3),
        ("panda/tcp_pose", 1e-5),
        ("pose/object", 1e-3),
        ("pose/goal", 1e-6),
        ("pose/cameras/object", 1e-3),
    ):
        np.testing.assert_allclose(
            found.observation[name], expected.observation[name], rtol=0, atol=tolerance
        )
    np.testing.assert_allclose(found.reward, expected.reward, atol=1e-3)
    assert not np.any(found.terminated) and not np.any(found.simulation["overflow"])


def test_a_new_start_brings_its_object_into_the_world(both, pool):
    _, warp = both
    seeds = pool.seeds
    first = warp.step(warp.at(seeds), wandering(1, 6)[0])
    turned = warp.step(warp.at(seeds[::-1]), wandering(1, 6)[0][::-1].copy())
    name = "pose/object"
    np.testing.assert_allclose(
        turned.observation[name][::-1], first.observation[name], rtol=0, atol=1e-5
    )


def test_a_diverged_world_ends_and_spares_the_others(both, pool):
    _, warp = both
    state, action = warp.at(pool.seeds), wandering(1, 6)[0]
    expected = warp.step(state, action)
    broken = dict(state.simulation)
    broken["qvel"] = broken["qvel"].at[2].set(jnp.nan)
    after = warp.step(state._replace(simulation=broken), action)
    assert np.asarray(after.terminated).tolist() == [False, False, True, False, False, False]
    joints = "panda/joint_positions"
    spared = np.array([0, 1, 3, 4, 5])
    np.testing.assert_allclose(
        after.observation[joints][spared], expected.observation[joints][spared], atol=1e-5
    )
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(after.observation))


def at_start(pool, row: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = awake(RowModels(pool).at(row))
    data = mujoco.MjData(model)
    write_simulation(model, data, unflatten(model, data, pool.starts[row].simulation))
    return model, data


@pytest.fixture(scope="module")
def mugs():
    """A mug of 32 convex parts; with one of the seeds it lies on many of them."""
    drawn = draw_pool(EnvConfig("single_object/target_pose", objects=("mug_000",)), range(6))
    for scene in drawn.scenes:
        scene.opt.noslip_iterations, scene.opt.impratio = 0, 100.0
    return drawn


def test_a_probe_finds_the_room_that_the_starts_average_does_not(mugs):
    found = [at_start(mugs, row)[1].ncon for row in range(len(mugs.starts))]
    seed = mugs.seeds[int(np.argmax(found))]
    average = Capacity(2 * float(np.mean(found)) + 24, 1200)
    overflowed = []
    for capacity in (average, None):
        world = batch.from_pool(mugs, 1, "warp", capacity=capacity)
        state = world.step(world.at([seed]), wandering(1, 1)[0])
        overflowed.append(bool(state.overflowed[0]))
        world.close()
    assert overflowed == [True, False]


def test_pairs_near_each_other_are_counted_as_they_are_on_the_device(mugs):
    expected = 0
    for row in range(len(mugs.starts)):
        model, data = at_start(mugs, row)
        expected += near_pairs(model, data, touching_pairs(model))
    world = batch.from_pool(mugs, len(mugs.starts), "warp")
    joints = np.stack([start.measurement.joints for start in mugs.starts])
    still = np.concatenate([joints, np.full((len(joints), 1), 0.08)], axis=1).astype(np.float32)
    jax.block_until_ready(world.step(world.at(mugs.seeds), still))
    found = int(world.engine._data.ncollision.numpy()[0])
    # It lies a little deeper or higher after a step in single precision.
    assert abs(found - expected) <= 0.15 * expected
