"""Assets that were built with a person's labels: labelled otherwise, taken back and built again."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import tests.asset_pipeline.labelled_assets as made
import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import build, up_to_date
from asset_pipeline.build.relabel import (
    MEASURED_FILE,
    OVERRIDE,
    measured,
    relabel,
    write_measured,
)
from asset_pipeline.labelling.overrides.reading import read_overrides
from asset_pipeline.sources.meshes import MeshOptions
from manipose_mj.assets.asset import Asset
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from tests.asset_pipeline.sources.valid_files import valid
from tests.places import ROOT


def _labels(folder: Path, text: str) -> Path:
    path = folder / "labels.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Asset:
    """A box that can be held, built with a mass of 0.3 kg."""
    folder = tmp_path_factory.mktemp("built")
    mesh = folder / "brick.obj"
    mesh.write_bytes(files.obj(files.box((0.12, 0.07, 0.05))))
    labels = _labels(folder, "brick: {mass: 0.3}\n")
    said = MeshOptions("box", None, "z", "m", "CC0")
    (result,) = build("meshes", mesh, folder / "out", labels=labels, said=said)
    assert (result.status, result.reason) == ("built", "")
    return read_asset(result.folder)


def test_an_asset_built_with_labels_takes_others_and_gives_back_what_was_measured(built, tmp_path):
    assert len(built.grasps) > 0 and built.mass_properties.mass == 0.3
    before = measured(built)
    assert len(before.grasps) == len(built.grasps) and before.mass_properties.mass != 0.3
    assert len(read_asset(built.folder, MEASURED_FILE).stable_poses) == len(built.stable_poses)
    (after,) = relabel(built.folder, _labels(tmp_path, "brick: {mass: 0.4}\n"))
    assert after.mass_properties.mass == 0.4 and len(after.grasps) == len(built.grasps)
    (back,) = relabel(built.folder, _labels(tmp_path, "{}\n"))
    assert back.mass_properties.mass == before.mass_properties.mass
    assert not (built.folder / MEASURED_FILE).exists()


def test_what_was_measured_is_read_without_the_rest_poses_that_grasps_are_of(tmp_path):
    asset = made.block(tmp_path / "block")
    write_measured(asset.folder, replace(asset, stable_poses=()))
    assert read_asset(asset.folder, MEASURED_FILE).grasps is None
    (after,) = relabel(asset.folder, _labels(tmp_path, "block: {mass: 0.7}\n"))
    assert after.mass_properties.mass == 0.7
    np.testing.assert_array_equal(after.grasps.clear, asset.grasps.clear)


def test_labels_put_into_furniture_are_what_a_build_gives_but_not_those_of_rigid_assets(tmp_path):
    text = "cupboard: {category: oven}\nblock: {mass: 0.7}\n"
    assets = (made.cupboard(tmp_path / "out" / "cupboard"), made.block(tmp_path / "out" / "block"))
    labels = _labels(tmp_path, text)
    relabel(tmp_path / "out", labels)
    for asset, same in zip(assets, (True, False), strict=True):
        said = {OVERRIDE: read_overrides(labels)[asset.name].digest}
        inputs = asset.provenance.inputs | said
        assert up_to_date(asset.folder, inputs, asset.provenance.generator) is same
    assert relabel(tmp_path / "out", labels) == []


def test_a_label_that_is_measured_again_counts_its_print(tmp_path):
    asset = made.block(tmp_path / "block")  # of one colour
    labels = _labels(tmp_path, "block: {object_type: mirror, up: [1, 0, 0]}\n")
    (after,) = relabel(asset.folder, labels)
    assert len(after.label.symmetry.rotations) == 4
    assert len(after.label.symmetry_textured.rotations) == 4
    (image,) = asset.folder.glob("meshes/*.png")
    image.write_bytes(b"no image")
    with pytest.raises(InputError, match=r"does not compile: .*\.png") as caught:
        relabel(asset.folder, _labels(tmp_path, "block: {object_type: mirror, up: [0, 1, 0]}\n"))
    assert "\n" not in str(caught.value)


def test_a_mass_is_put_into_a_model_that_states_its_inertia_otherwise(tmp_path):
    asset = made.block(tmp_path / "block")
    text = re.sub(
        r'fullinertia="[^"]*"', 'diaginertia="1e-4 1e-4 1e-4"', asset.model_path.read_text()
    )
    asset.model_path.write_text(text)
    relabel(asset.folder, _labels(tmp_path, "block: {mass: 0.4}\n"))
    model = mujoco.MjModel.from_xml_path(str(asset.model_path))
    assert model.body("block").mass == 0.4


@pytest.mark.parametrize(
    ("moved", "said"),
    [
        ('<include file="inertial.xml"/>', "it has no inertial; state it in this file"),
        ('<frame pos="0 0 1">{}</frame>', "its centre of mass is"),
        ("<body name='own'>{}</body>", "weighs 0.4 kg in asset.json, but 0.88 kg"),
    ],
)
def test_a_model_whose_mass_is_elsewhere_is_refused_and_stays(tmp_path, moved, said):
    asset = made.block(tmp_path / "block")
    text = asset.model_path.read_text()
    (inertial,) = re.findall(r"<inertial[^>]*/>", text)
    (asset.folder / "inertial.xml").write_text(f"<mujoco>{inertial}</mujoco>")
    asset.model_path.write_text(text.replace(inertial, moved.format(inertial)))
    before = asset.model_path.read_text()
    with pytest.raises(InputError, match=rf"block/model.xml: cannot be relabelled: {said}") as told:
        relabel(asset.folder, _labels(tmp_path, "block: {mass: 0.4}\n"))
    assert "\n" not in str(told.value) and asset.model_path.read_text() == before


def test_a_build_that_measures_as_told_counts_the_print(tmp_path):
    box = files.box((0.2, 0.25, 0.3))  # too wide to grasp: quick
    content = {"Blue_Box/model.obj": files.obj(box), "Blue_Box/texture.png": files.image()}
    scans = files.write_folder(tmp_path / "scans", content)
    labels = _labels(tmp_path, "Blue_Box: {object_type: mirror, up: [0, 1, 0]}\n")
    (result,) = build("google_scanned_objects", scans, tmp_path / "out", labels=labels)
    assert result.status == "built", result.reason
    label = read_asset(result.folder).label
    assert len(label.symmetry.rotations) == len(label.symmetry_textured.rotations) == 4


def _furniture(folder: Path) -> Path:
    """A piece called 7167 whose door, which has no handle, is its link 0."""
    home = "dataset/7167/"
    drawn = valid("partnet_mobility").items()
    content = {path.replace("dataset/4711/", home): data for path, data in drawn}
    for path in (home + "mobility.urdf", home + "semantics.txt"):
        text = content[path].decode()
        text = re.sub(r"link_([01])", lambda m: f"link_{1 - int(m[1])}", text)
        content[path] = text.encode()
    del content[home + "mobility_v2.json"]
    return files.write_folder(folder, content)


def _documented_entry() -> str:
    page = (ROOT / "docs" / "guides" / "label_corrections.md").read_text(encoding="utf-8")
    (entry,) = re.findall(r'```yaml\n.*?(^"7167":.*?)```', page, re.DOTALL | re.MULTILINE)
    return entry


def test_the_documented_entry_relabels_a_door_by_the_name_that_show_prints(tmp_path, capsys):
    (result,) = build("partnet_mobility", _furniture(tmp_path / "raw"), tmp_path / "out")
    assert result.status == "built", result.reason
    (after,) = relabel(tmp_path / "out", _labels(tmp_path, _documented_entry()))
    (door,) = after.parts
    np.testing.assert_allclose(door.handle.extents, [0.2, 0.03, 0.02])
    np.testing.assert_allclose(door.joint.axis, [0, 0, -1])
    assert main(["assets", "show", str(after.folder)]) == 0
    assert "part door_0" in capsys.readouterr().out


def test_a_build_warns_of_a_door_without_a_handle_unless_labels_bring_one(tmp_path, caplog):
    raw, out = _furniture(tmp_path / "raw"), tmp_path / "out"
    said = (
        "7167: door_0: no handle found; tasks that open it refuse it; say `parts: door_0: handle:`"
    )
    build("partnet_mobility", raw, out)
    assert caplog.text.count(f"{said} in labels.yaml") == 1
    caplog.clear()
    (result,) = build("partnet_mobility", raw, out, labels=_labels(tmp_path, _documented_entry()))
    assert result.status == "built" and "no handle" not in caplog.text


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("joint: {origin: [500, -200, 0]}", "joint: origin: is 538 m from an object of 0.213 m"),
        ("handle: {origin: [-30, 0, 100]}", "handle: origin: is 104 m from an object of 0.213 m"),
        ("handle: {extents: [100, 20, 10]}", "handle: extents: reach 100 m along an object of"),
        ("handle: {adjust: {shift: [20, 0, 0]}}", "handle: origin: is 20 m from an object of"),
    ],
)
def test_millimetres_of_parts_are_told_before_anything_is_written(tmp_path, entry, message):
    asset = made.cupboard(tmp_path / "cupboard")
    before = {path: path.read_bytes() for path in asset.folder.rglob("*") if path.is_file()}
    labels = _labels(tmp_path, f"cupboard: {{parts: {{drawer: {{{entry}}}}}}}\n")
    with pytest.raises(InputError, match=f"cupboard: parts: drawer: {message}.*; expected metres"):
        relabel(asset.folder, labels)
    assert {p: p.read_bytes() for p in asset.folder.rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("away", [0.0, 0.009, 0.05])
def test_a_handle_where_nothing_is_seen_is_told(tmp_path, caplog, away):
    asset = made.cupboard(tmp_path / "cupboard")  # its front is at x = -0.03
    bar = f"{{origin: [{-0.04 - away}, 0, 0.05], x: [0, 0, 1], y: [-1, 0, 0], extents: [0.03, 0.02, 0.02]}}"
    labels = _labels(tmp_path, f"cupboard: {{parts: {{door: {{handle: {bar}}}}}}}\n")
    relabel(asset.folder, labels)
    told = f"{labels}: cupboard: parts: door: handle: nothing of the object is within 10 mm of it"
    assert (told in caplog.text) == (away > 0.01)
