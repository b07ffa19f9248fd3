"""Contact sheets of the built-in catalogue: looks, label axes and collision geometry, side by side.

    MUJOCO_GL=osmesa python benchmarks/contact_sheet.py --out sheets [--categories mug cabinet] [--count 4]

One PNG for each category. A row is an instance: two views of how it looks, with the label's axes (X red,
Y green, Z blue), and its collision parts, each in a colour of its own. Cabinets are shown shut and with
everything open; the axes of their joints are cyan.
"""

from __future__ import annotations

import argparse
import colorsys
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float
from PIL import Image

from asset_pipeline import catalogue
from asset_pipeline.assets import Asset
from asset_pipeline.labelling.label import PoseLabel
from manipose_mj.poses import transform

SIZE = 360  # of a picture [pixels]
ELEVATION = -24.0  # of the camera [deg]
AXIS_GROUP, VISUAL_GROUP, COLLISION_GROUP = 1, 2, 3
AXIS_COLOURS = ((0.9, 0.1, 0.1, 1.0), (0.1, 0.75, 0.15, 1.0), (0.15, 0.25, 0.95, 1.0))
CYAN = (0.1, 0.85, 0.9, 1.0)


def main() -> None:
    """Draw the sheets."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("sheets"))
    parser.add_argument("--categories", nargs="+", default=list(catalogue.names()))
    parser.add_argument("--count", type=int, default=4, help="instances of each category")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for category in arguments.categories:
        rows = [row(catalogue.load(category, index)) for index in range(arguments.count)]
        path = arguments.out / f"catalogue_{category}.png"
        Image.fromarray(np.concatenate(rows, axis=0)).save(path)
        print(path)


def row(asset: Asset) -> np.ndarray:
    """The pictures of one asset, `(SIZE, n SIZE, 3)`."""
    if asset.parts:
        views = ((150.0, 0.0, VISUAL_GROUP), (215.0, 0.0, VISUAL_GROUP))
        views += ((155.0, 1.0, VISUAL_GROUP), (155.0, 1.0, COLLISION_GROUP))
    else:
        views = tuple((a, 0.0, VISUAL_GROUP) for a in (35.0, 100.0)) + (
            (35.0, 0.0, COLLISION_GROUP),
        )
    model = stage(asset)
    data = mujoco.MjData(model)
    pictures = []
    with mujoco.Renderer(model, SIZE, SIZE) as renderer:
        for azimuth, opening, group in views:
            pictures.append(picture(renderer, model, data, asset, azimuth, opening, group))
    return np.concatenate(pictures, axis=1)


def stage(asset: Asset) -> mujoco.MjModel:
    """The asset on a floor, with its axes as geoms and its collision parts in many colours."""
    spec = mujoco.MjSpec.from_file(str(asset.model_path))
    size = float(np.max(asset.label.extents))
    lowest = asset.label.origin[2] - asset.label.extents[0] / 2
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.35, 0.35, 0.35]
    spec.visual.headlight.specular = [0.05, 0.05, 0.05]
    spec.visual.quality.shadowsize = 4096
    spec.visual.map.znear = 0.01
    spec.visual.map.shadowclip = 2.0
    for direction, strength, shadow in (
        ((0.35, -0.5, -0.9), 0.45, True),
        ((0.3, 0.6, -0.5), 0.2, False),
    ):
        light = spec.worldbody.add_light(pos=[0, 0, 3 * size], dir=direction, castshadow=shadow)
        light.type, light.diffuse = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, [strength] * 3
    floor = spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[60 * size, 60 * size, 0.1]
    )
    floor.pos, floor.rgba, floor.group = [0, 0, lowest], [0.82, 0.83, 0.84, 1], 0
    floor.contype = floor.conaffinity = 0
    base = spec.worldbody.bodies[0]
    _add_axes(base, asset.label, 0.62 * asset.label.extents + 0.1 * size, 0.008 * size)
    for part in asset.parts:
        body = spec.body(part.name)
        if part.handle is not None:
            _add_axes(body, part.handle, np.full(3, 0.09), 0.003)
        reach = 0.14 * part.joint.axis
        _add_line(base, part.joint.origin - reach, part.joint.origin + reach, 0.004, CYAN)
    collision = [geom for geom in spec.geoms if geom.group == COLLISION_GROUP]
    for index, geom in enumerate(collision):
        geom.rgba = [*colorsys.hsv_to_rgb((0.381966 * index) % 1.0, 0.5, 0.9), 1.0]
    return spec.compile()


def picture(
    renderer: mujoco.Renderer,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    asset: Asset,
    azimuth: float,
    opening: float,
    group: int,
) -> np.ndarray:
    """One view; `opening` is the share of every joint's range."""
    mujoco.mj_resetData(model, data)
    for part in asset.parts:
        low, high = part.joint.range
        stagger = 1.0 if part.joint.kind == "hinge" else 1 - 0.25 * part.joint.origin[2] / 0.3
        data.joint(part.name).qpos = low + opening * stagger * (high - low)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat = asset.label.origin - [0.3 * opening * asset.label.extents[1], 0.0, 0.0]
    camera.distance = (1.55 + 0.45 * opening) * float(np.linalg.norm(asset.label.extents))
    # The free camera looks along its azimuth: half a turn from where it stands.
    camera.azimuth, camera.elevation = azimuth + 180.0, ELEVATION
    option = mujoco.MjvOption()
    option.geomgroup[:] = 0
    option.geomgroup[[0, group]] = 1
    option.geomgroup[AXIS_GROUP] = int(group == VISUAL_GROUP)
    renderer.update_scene(data, camera, option)
    return renderer.render().copy()


def _add_axes(
    body: mujoco.MjsBody, label: PoseLabel, lengths: Float[np.ndarray, "3"], radius: float
) -> None:
    ends = transform(label.pose, np.diag(lengths))
    for end, rgba in zip(ends, AXIS_COLOURS, strict=True):
        _add_line(body, label.origin, end, radius, rgba)


def _add_line(
    body: mujoco.MjsBody,
    start: Float[np.ndarray, "3"],
    end: Float[np.ndarray, "3"],
    radius: float,
    rgba: tuple[float, float, float, float],
) -> None:
    geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end])
    geom.size, geom.rgba, geom.group, geom.mass = [radius, 0, 0], rgba, AXIS_GROUP, 0.0
    geom.contype = geom.conaffinity = 0


if __name__ == "__main__":
    main()
