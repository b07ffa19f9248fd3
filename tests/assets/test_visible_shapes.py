"""What is seen of an asset, and what touches, is what MuJoCo makes of its `model.xml`, however that is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from asset_pipeline.build.emit import write_obj
from manipose_mj.assets.asset import MODEL_FILE
from manipose_mj.assets.visible_shapes import collision_shapes, surface, visible_shapes
from manipose_mj.errors import InputError

CLASSES = """<mujoco><default>
  <default class="col"><geom group="3"/></default>
  <default class="vis"><geom group="2" contype="0" conaffinity="0" rgba="1 0 0 1"/></default>
</default></mujoco>"""
BOX = np.array([0.1, 0.2, 0.3])


def _written(folder: Path, bodies: str, *, compiler: str = "", assets: str = "") -> Path:
    (folder / "classes.xml").write_text(CLASSES)
    (folder / MODEL_FILE).write_text(
        f'<mujoco><compiler {compiler}/><include file="classes.xml"/>'
        f"<asset>{assets}</asset><worldbody>{bodies}</worldbody></mujoco>"
    )
    return folder


def _bounds(folder: Path) -> np.ndarray:
    return np.asarray(surface(visible_shapes(folder)).bounds)


def test_groups_come_from_classes_of_included_files(tmp_path):
    folder = _written(
        tmp_path,
        """<body name="block" childclass="vis"><freejoint/>
        <geom class="col" type="box" size=".1 .2 .3"/><geom type="sphere" size=".1"/>
        <geom type="box" size="1 1 1" rgba="0 0 0 0"/></body>""",
    )
    (seen,), (solid,) = visible_shapes(folder)["block"], collision_shapes(folder)["block"]
    assert (seen.kind, seen.size, seen.rgba) == ("sphere", (0.1,), (1, 0, 0, 1))
    assert (solid.kind, solid.size) == ("box", (0.1, 0.2, 0.3))


@pytest.mark.parametrize("scale", ["1 1 1", "2 1 1"])
def test_meshes_and_textures_lie_where_the_compiler_says(tmp_path, scale):
    (tmp_path / "own").mkdir()
    box = trimesh.creation.box(BOX)
    box.visual = trimesh.visual.TextureVisuals(uv=np.asarray(box.vertices)[:, :2] + 0.5)
    write_obj(box, tmp_path / "own" / "x.obj", digits=6)
    Image.new("RGB", (2, 2)).save(tmp_path / "own" / "x.png")
    folder = _written(
        tmp_path,
        '<body name="b"><geom class="vis" type="mesh" mesh="x" material="m"/></body>',
        compiler='meshdir="own" texturedir="own"',
        assets=f'<mesh file="x.obj" scale="{scale}"/><texture type="2d" name="t" file="x.png"/>'
        '<material name="m" texture="t"/>',
    )
    (shape,) = visible_shapes(folder)["b"]
    mesh, stretch = shape.surface(), np.array(scale.split(), float)
    assert shape.texture == tmp_path / "own" / "x.png"
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), BOX * stretch, atol=1e-6)
    expected = np.asarray(mesh.vertices)[:, :2] / stretch[:2] + 0.5
    np.testing.assert_allclose(mesh.visual.uv, expected, atol=1e-5)


def test_angles_frames_and_nested_bodies_place_shapes(tmp_path):
    write_obj(trimesh.creation.box(BOX), tmp_path / "x.obj", digits=6)
    bodies = """<body name="base" pos="0 0 5"><frame pos="1 0 0" euler="0 0 90">{}</frame>
      <body name="part" pos="0 2 0"><joint name="part" type="slide"/>{}</body></body>"""
    primitive, mesh = ('type="box" size=".05 .1 .15"', 'type="mesh" mesh="x"')
    for own in (primitive, mesh):
        geom = f'<geom class="vis" {own}/>'
        folder = _written(
            tmp_path, bodies.format(geom, geom), assets='<mesh file="x.obj" name="x"/>'
        )
        expected = [[-0.05, -0.05, -0.15], [1.1, 2.1, 0.15]]
        np.testing.assert_allclose(_bounds(folder), expected, atol=1e-6)
        (turned,), (part,) = visible_shapes(folder).values()
        centre = np.asarray(turned.surface().bounds).mean(axis=0)
        np.testing.assert_allclose(centre, [1, 0, 0], atol=1e-6)
        np.testing.assert_allclose(np.ptp(turned.surface().bounds, axis=0), BOX[[1, 0, 2]])
        np.testing.assert_allclose(np.ptp(part.surface().bounds, axis=0), BOX, atol=1e-6)


def test_a_mesh_without_a_file_is_seen(tmp_path):
    folder = _written(
        tmp_path,
        '<body name="b"><geom class="vis" type="mesh" mesh="x"/></body>',
        assets='<mesh name="x" vertex="0 0 0 .1 0 0 0 .2 0 0 0 .3"/>',
    )
    np.testing.assert_allclose(_bounds(folder), [np.zeros(3), BOX], atol=1e-6)


@pytest.mark.parametrize(
    ("geom", "said"),
    [
        ('class="col" type="sphere" size=".1"', "has nothing to be seen: no geom is of a group"),
        ('class="vis" type="plane" size="1 1 1" name="floor"', "geom 'floor' is a plane; expected"),
        ('class="vis" type="mesh" mesh="none"', "does not compile: .*none"),
    ],
)
def test_what_cannot_be_shown_is_one_line_with_its_file(tmp_path, geom, said):
    folder = _written(tmp_path, f'<body name="b"><geom {geom}/></body>')
    with pytest.raises(InputError, match=f"{MODEL_FILE}: {said}") as refusal:
        visible_shapes(folder)
    assert "\n" not in str(refusal.value)
