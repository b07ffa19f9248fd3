"""An asset alone, under the physics options of the benchmark's scenes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from asset_pipeline.emit import SOLIMP, SOLREF, model_element
from asset_pipeline.geometry import Body

TIMESTEP = 0.002


@contextmanager
def scratch_model(body: Body) -> Iterator[Path]:
    """The MJCF that the asset folder will hold, but for its looks, as a file that goes away."""
    with tempfile.TemporaryDirectory(prefix="manipose-model-") as folder:
        root = model_element(body.name, (replace(body, visual=()),), Path(folder))
        path = Path(folder) / "model.xml"
        ElementTree.ElementTree(root).write(path, encoding="unicode")
        yield path


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
        ground.condim, ground.friction = 4, [0.8, 0.005, 0.0001]
        ground.solref = np.array(SOLREF.split(), float)
        ground.solimp[:3] = np.array(SOLIMP.split(), float)
    child = mujoco.MjSpec.from_file(str(model_path))
    spec.attach(child, frame=spec.worldbody.add_frame(), prefix="asset/")
    return spec.compile()


def set_physics(option: mujoco.MjOption, timestep: float) -> None:
    """The benchmark's integrator, friction cones and solver, with this step [s]."""
    option.timestep = timestep
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 10.0
    option.noslip_iterations = 10
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
