"""An asset alone, under the physics options of the benchmark's scenes."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from asset_pipeline.emit import SOLIMP, SOLREF

TIMESTEP = 0.002


def rest_scene(model_path: Path, *, plane: bool = True) -> mujoco.MjModel:
    """The model alone; with a plane z = 0 that is as hard and as rough as the benchmark's table.

    Raises:
      ValueError: MuJoCo cannot compile it.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = TIMESTEP
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    spec.option.noslip_iterations = 10
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if plane:
        ground = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1])
        # MuJoCo averages the contact parameters of two geoms.
        ground.condim, ground.friction = 4, [0.8, 0.005, 0.0001]
        ground.solref = np.array(SOLREF.split(), float)
        ground.solimp[:3] = np.array(SOLIMP.split(), float)
    child = mujoco.MjSpec.from_file(str(model_path))
    spec.attach(child, frame=spec.worldbody.add_frame(), prefix="asset/")
    return spec.compile()
