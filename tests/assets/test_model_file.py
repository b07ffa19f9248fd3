"""An asset whose MJCF or meshes are missing or broken is refused in one line that names the file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.emit import write_asset
from manipose_mj.assets import model_file
from manipose_mj.assets.asset import MODEL_FILE, Asset, MovingPart, Provenance, StablePose
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.assets.geometry import Body, Joint, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.errors import InputError
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import SymmetryGroup
from manipose_mj.tasks.core.object_selection import select_assets


@pytest.fixture
def folder(tmp_path) -> Path:
    """An asset whose shape is a mesh."""
    mass = MassProperties(0.5, np.zeros(3), 1e-3 * np.eye(3))
    label = PoseLabel(np.zeros(3), np.eye(3), "mirror", np.full(3, 0.1), SymmetryGroup.identity())
    asset = Asset(
        tmp_path / "wedge", "wedge", "rigid", "box", label, np.array([0.0, 0.0, 1.0]), mass,
        (StablePose(np.eye(3), 0.0, 1.0),), Provenance("test", "wedge", "none"),
    )  # fmt: skip
    shape = (Shape(kind="mesh", mesh=trimesh.creation.icosphere(subdivisions=1, radius=0.05)),)
    return write_asset(asset, (Body("wedge", shape, shape, mass),)).folder


def _without_meshes(folder: Path) -> None:
    for mesh in folder.glob("meshes/*.obj"):
        mesh.unlink()


def _garbled_mesh(folder: Path) -> None:
    for mesh in folder.glob("meshes/*.obj"):
        mesh.write_text("no mesh\nat all\n")


def _truncated(folder: Path) -> None:
    (folder / MODEL_FILE).write_text((folder / MODEL_FILE).read_text()[:90])


def _empty(folder: Path) -> None:
    (folder / MODEL_FILE).write_text("<mujoco/>")


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        (_without_meshes, "does not compile: .*meshes"),
        (_garbled_mesh, "does not compile: "),
        (_truncated, "does not compile: "),
        (_empty, "has no body with a geom"),
    ],
)
def test_a_broken_model_is_one_line_with_its_file(folder, broken, said):
    broken(folder)
    for chosen in (str(folder), str(folder.parent), read_asset(folder)):
        with pytest.raises(InputError, match=f"{folder}/{MODEL_FILE}: {said}") as refusal:
            select_assets([chosen])
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("broken", [_without_meshes, _truncated])
def test_an_entity_of_a_model_that_cannot_be_read_is_one_line(folder, broken):
    asset = read_asset(folder)
    assert RigidObject(asset).mjcf_model.find_all("geom")
    broken(folder)
    with pytest.raises(InputError, match=f"{folder}/{MODEL_FILE}: cannot be read: ") as refusal:
        RigidObject(asset)
    assert "\n" not in str(refusal.value)


def test_moving_parts_have_bodies_and_joints_in_the_model(folder):
    path = folder / MODEL_FILE
    door = MovingPart("door", Joint("hinge", np.zeros(3), np.eye(3)[2], (0.0, 1.5)), None, None)
    cupboard = replace(read_asset(folder), kind="articulated", parts=(door,))
    with pytest.raises(InputError, match="has no body 'door', a part of asset.json"):
        select_assets([cupboard])
    path.write_text(path.read_text().replace('body name="wedge"', 'body name="door"'))
    model_file.compiled_names.cache_clear()
    with pytest.raises(InputError, match="has no joint 'door', a part of asset.json"):
        select_assets([cupboard])
