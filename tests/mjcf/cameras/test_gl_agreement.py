"""In the tasks' scenes the ray camera sees what MuJoCo's GL renderer sees."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from manipose_mj.mjcf.cameras import gl
from tests.places import ROOT

# In a child process: GL is bound once per process and may crash.
COMPARE = """
import mujoco, numpy as np
from manipose_mj import suite
from manipose_mj.mjcf.cameras import gl
from manipose_mj.mjcf.cameras.ray_camera import RayCamera
from tests.places import ROOT
from tests.few_objects import load
gl.activate()
option = mujoco.MjvOption()
option.geomgroup[:] = [1, 1, 1, 0, 0, 0]
for task in (("single_object", "target_pose"), ("articulated", "store_chips_can_middle_drawer")):
    environment = load(*task, seed=3, obs_mode="state")
    environment.reset()
    model, data = environment.physics.model.ptr, environment.physics.data.ptr
    with mujoco.Renderer(model, 240, 320) as renderer:
        for camera in ("front", "left", "right", "overview", "panda/wrist"):
            renderer.update_scene(data, camera, option)
            renderer.enable_depth_rendering()
            depth = renderer.render().copy()
            renderer.enable_segmentation_rendering()
            ids, kind = np.moveaxis(renderer.render(), -1, 0)
            ids = np.where(kind == mujoco.mjtObj.mjOBJ_GEOM, ids, -1)
            renderer.disable_segmentation_rendering()
            image = RayCamera(240, 320).render(model, data, camera)
            # Away from the edges of either picture, and from their rims.
            away, inner = (np.ones(ids.shape, bool) for _ in range(2))
            for shift in np.ndindex(3, 3):
                here = np.roll(ids, np.subtract(shift, 1), (0, 1)) == ids
                rays = np.roll(image.geom_id, np.subtract(shift, 1), (0, 1)) == image.geom_id
                away &= here
                inner &= here & rays
            for rim in (away, inner):
                rim[[0, -1]] = rim[:, [0, -1]] = False
            same = (ids == image.geom_id)[away].mean()
            near = inner & (ids == image.geom_id) & (image.depth > 0) & (image.depth < 2.0)
            error = np.abs(depth - image.depth)[near]
            print(camera, same, np.quantile(error, 0.99), np.median(error), away.mean())
"""


@pytest.mark.full
def test_tasks_look_the_same_through_gl():
    works = [b for b in ("osmesa", "egl") if gl.probe(b).works]
    if not works:
        pytest.skip("; ".join(f"{s.backend}: {s.reason}" for s in gl.probe_all()))
    environment = {
        k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")
    }
    child = subprocess.run(
        [sys.executable, "-c", COMPARE],
        env={**environment, "MUJOCO_GL": works[0], "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert child.returncode == 0, child.stderr
    lines = [line.split() for line in child.stdout.splitlines()]
    assert len(lines) == 10
    for camera, same, error, middle, away in lines:
        assert float(same) > 0.99, (camera, same)
        assert float(error) < 1e-3, (camera, error)
        assert float(middle) < 2e-4, (camera, middle)
        assert float(away) > 0.5, (camera, away)
