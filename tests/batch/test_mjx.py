"""MJX, MuJoCo in JAX, makes the same control step as the engines: a third opinion, which is no engine itself."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from manipose_mj import batch
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.making import WARP_ON_CPU
from manipose_mj.mjcf.panda.servos import Servos
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation

mjx = pytest.importorskip("mujoco.mjx", reason='needs pip install -e ".[gpu]"')
pytestmark = pytest.mark.full  # XLA compiles the step


@pytest.fixture(scope="module")
def pool():
    """The arm and a box in the air that touch nothing, which MJX compiles in half a minute."""
    drawn = draw_pool(EnvConfig("single_object/target_pose", objects=("box_000",)), [3])
    (scene,) = drawn.scenes
    scene.opt.noslip_iterations = 0
    scene.opt.cone = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)  # MJX's other one asks for contacts
    scene.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    scene.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return drawn


@pytest.fixture(scope="module")
def target(pool):
    """So near that no servo is at its largest torque: there MJX integrates otherwise than MuJoCo."""
    near = np.array([0.02, -0.02, 0.015, 0.015, -0.004, 0.004, 0.004])
    joints = pool.starts[0].measurement.joints + near
    return np.append(joints, 0.06).astype(np.float32)


@pytest.fixture(scope="module")
def expected(pool, target) -> mujoco.MjData:
    """After a control step of MJX, its set-points limited as the servos limit them."""
    (scene,), (start,) = pool.scenes, pool.starts
    host = mujoco.MjData(scene)
    write_simulation(scene, host, unflatten(scene, host, start.simulation))
    model, data = mjx.put_model(scene), mjx.put_data(scene, host)
    step, servos = jax.jit(mjx.step), Servos.of(scene, host, start.addresses.servos)
    for _ in range(pool.layout.substeps):
        servos.follow(target)
        data = step(model, data.replace(ctrl=jnp.asarray(host.ctrl)))
        host.qpos[:], host.qvel[:] = data.qpos, data.qvel
        mujoco.mj_fwdPosition(scene, host)
    return host


@pytest.mark.parametrize("engine", ["c", "warp"])
def test_free_motion_is_that_of_mjx(pool, target, expected, engine, monkeypatch):
    if engine == "warp":
        pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
        monkeypatch.setenv(WARP_ON_CPU, "1")
    worlds = batch.from_pool(pool, 1, engine)
    before = worlds.at(pool.seeds)
    after = worlds.step(before, target[None])
    found, at = after.measurement, pool.starts[0].addresses
    fallen = np.asarray(before.measurement.positions - found.positions)[0, 0, 2]
    assert fallen == pytest.approx(0.5 * 9.81 * 0.02**2, rel=0.2)
    assert np.abs(np.asarray(found.joints - before.measurement.joints)).max() > 1e-3
    for name, values in (
        ("joints", expected.qpos[at.servos.angles]),
        ("fingers", expected.qpos[at.servos.fingers]),
        ("tcp_position", expected.site_xpos[at.servos.tcp]),
        ("positions", expected.xpos[at.bodies]),
    ):
        np.testing.assert_allclose(getattr(found, name)[0], values, rtol=0, atol=1e-4, err_msg=name)
    np.testing.assert_allclose(found.velocities[0], expected.qvel[at.servos.dofs], atol=1e-3)
    worlds.close()
