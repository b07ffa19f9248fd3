"""An asset alone, under the physics options of the benchmark's scenes."""

from __future__ import annotations

from pathlib import Path

import mujoco

from manipose_mj.assets.physics import (
    SOLIMP,
    SOLREF,
    SUPPORT_CONDIM,
    SUPPORT_FRICTION,
    TIMESTEP,
    set_physics,
)


def rest_scene(model_path: Path, *, plane: bool = True) -> mujoco.MjModel:
    """The model alone; with a plane z = 0 that is as hard and as rough as the benchmark's table.

    Raises:
      ValueError: MuJoCo cannot compile it.
    """
    spec = mujoco.MjSpec()
    set_physics(spec.option, TIMESTEP)
    if plane:
        ground = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1])
        # MuJoCo averages the contact parameters of two geoms.
        ground.condim, ground.friction = SUPPORT_CONDIM, SUPPORT_FRICTION
        ground.solref = SOLREF
        ground.solimp[:3] = SOLIMP
    child = mujoco.MjSpec.from_file(str(model_path))
    spec.attach(child, frame=spec.worldbody.add_frame(), prefix="asset/")
    return spec.compile()
