"""An object written by hand is in a scene what it is alone, whatever its compiler's settings."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from dm_control import mjcf

from asset_pipeline.build.emit import write_asset, write_obj
from asset_pipeline.checks.asset_check import check_asset
from manipose_mj.assets.asset import MODEL_FILE, Asset, Provenance, StablePose
from manipose_mj.assets.geometry import Body, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.physics import SCENE_CONTACT_TIME
from manipose_mj.errors import InputError
from manipose_mj.mjcf.arena import TableArena
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import SymmetryGroup

CLASSES = """<mujoco><default>
  <default class="col"><geom group="3" solref="0.01 1"/></default>
  <default class="vis"><geom group="2" contype="0" conaffinity="0"/></default>
</default></mujoco>"""
GEOMS = """<inertial pos="0 0 0.01" mass="0.5" diaginertia="0.001 0.001 0.001"/>
<geom name="box" class="col" type="box" size=".01 .02 .03" euler="0 0 {turn}"/>"""


@pytest.fixture
def asset(tmp_path) -> Asset:
    """A box."""
    mass = MassProperties(0.5, np.array([0, 0, 0.01]), 1e-3 * np.eye(3))
    label = PoseLabel(np.zeros(3), np.eye(3), "mirror", np.full(3, 0.1), SymmetryGroup.identity())
    box = (Shape("box", (0.01, 0.02, 0.03)),)
    made = Asset(
        tmp_path / "brick", "brick", "rigid", "box", label, np.array([0.0, 0.0, 1.0]), mass,
        (StablePose(np.eye(3), 0.03, 1.0),), Provenance("test", "brick", "none"),
    )  # fmt: skip
    return write_asset(made, (Body("brick", box, box, mass),))


def _write(folder: Path, head: str, body: str) -> None:
    (folder / "classes.xml").write_text(CLASSES)
    (folder / MODEL_FILE).write_text(
        f'<mujoco>{head}<include file="classes.xml"/>'
        f'<worldbody><body name="brick"><freejoint/>{body}</body></worldbody></mujoco>'
    )


@pytest.mark.parametrize(
    ("head", "body"),
    [
        ("", GEOMS.format(turn=30)),
        ('<compiler angle="degree"/>', GEOMS.format(turn=30)),
        ('<compiler angle="radian" eulerseq="ZYX"/>', GEOMS.format(turn=0.4)),
        ('<option timestep="0.004" gravity="0 0 -1"/>', GEOMS.format(turn=30)),
        (
            '<compiler angle="radian" meshdir="own"/><asset><mesh file="x.obj"/></asset>',
            GEOMS.format(turn=0.1) + '<geom class="vis" name="seen" type="mesh" mesh="x"/>',
        ),
    ],
)
def test_an_object_is_in_a_scene_what_it_is_alone(asset, head, body):
    (asset.folder / "own").mkdir()
    write_obj(trimesh.creation.box((0.1, 0.2, 0.3)), asset.folder / "own" / "x.obj", digits=6)
    _write(asset.folder, head, body)
    alone = mujoco.MjModel.from_xml_path(str(asset.model_path))
    arena = TableArena()
    before = mjcf.Physics.from_mjcf_model(arena.mjcf_model).model
    for name in ("one", "two"):
        arena.add_free_entity(RigidObject(asset, name=name))
    scene = mjcf.Physics.from_mjcf_model(arena.mjcf_model).model.ptr
    for name in ("one", "two"):
        for index in range(alone.ngeom):
            own, there = alone.geom(index), scene.geom(f"{name}/{alone.geom(index).name}")
            for what in ("pos", "quat", "size", "group", "contype"):
                np.testing.assert_allclose(getattr(there, what), getattr(own, what), atol=1e-6)
        body_there, body_own = scene.body(f"{name}/brick"), alone.body("brick")
        np.testing.assert_allclose(body_there.ipos, body_own.ipos, atol=1e-9)
        np.testing.assert_allclose(body_there.mass, body_own.mass)
        assert scene.geom(f"{name}/box").solref[0] == SCENE_CONTACT_TIME
    assert scene.opt.timestep == before.opt.timestep
    np.testing.assert_array_equal(scene.opt.gravity, before.opt.gravity)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ('<geom type="mesh" mesh="none"/>', "cannot be read: .*none"),
        (f'<frame pos="0 0 1">{GEOMS.format(turn=30)}</frame>', "scenes take no <frame>"),
    ],
)
def test_what_scenes_cannot_take_is_one_line(asset, body, said):
    _write(asset.folder, '<compiler angle="degree"/>', body)
    with pytest.raises(InputError, match=f"{MODEL_FILE}: {said}") as refusal:
        RigidObject(asset)
    assert "\n" not in str(refusal.value)


def test_the_check_says_what_scenes_cannot_take(asset):
    frame = f'<frame pos="0 0 1">{GEOMS.format(turn=30)}<geom class="vis" size="1"/></frame>'
    _write(asset.folder, "", frame)
    (failure,) = check_asset(asset.folder).failures
    assert "scenes take no <frame>" in failure
