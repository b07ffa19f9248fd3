"""A person's labels: read with one-line complaints, saved around comments, applied and taken back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

import tests.asset_pipeline.labelled_assets as made
import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import build
from asset_pipeline.build.relabel import MEASURED_FILE, OVERRIDE, measured, relabel
from asset_pipeline.labelling.overrides.applying import moved, overridden
from asset_pipeline.labelling.overrides.fields import rotation_of
from asset_pipeline.labelling.overrides.reading import FrameOverride, parsed, read_overrides
from asset_pipeline.labelling.overrides.writing import put_entry
from manipose_mj.assets.asset import GRASPS_FILE
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.assets.label_marks import area_boxes
from manipose_mj.assets.symmetry_names import SYMMETRIES, symmetry_name
from manipose_mj.assets.visible_shapes import surface, visible_shapes
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, pose_error, rotation_about, rotation_angle, transform
from tests.places import ROOT

DOCS = ROOT / "docs" / "guides" / "label_corrections.md"


def _file(folder: Path, text: str) -> Path:
    path = folder / "labels.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def _entry(**fields):
    return parsed(Path("labels.yaml"), "block", fields)


def test_the_documented_file_is_read_and_every_documented_field_is_known(tmp_path):
    page = DOCS.read_text(encoding="utf-8")
    example = re.search(r"```yaml\n(.*?)```", page, re.DOTALL).group(1)
    found = read_overrides(_file(tmp_path, example))
    assert list(found) == ["065-a_cups", "035_power_drill", "7167"]
    np.testing.assert_array_equal(found["065-a_cups"].frame.rotation[:, 2], [0, 1, 0])
    assert found["065-a_cups"].frame.symmetry.axial
    drill = found["035_power_drill"]
    assert (drill.object_type, drill.category, drill.mass) == ("functional", "drill", 0.895)
    np.testing.assert_allclose(drill.frame.turn, [0, 0, np.deg2rad(2.5)])
    part = found["7167"].parts["door_0"]
    np.testing.assert_array_equal(part.joint_axis, [0, 0, -1])
    np.testing.assert_array_equal(part.handle.extents, [0.2, 0.03, 0.02])
    for name in SYMMETRIES:
        assert f"`{name}`" in page


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"orgin": [0, 0, 0]}, "block: unknown field 'orgin'; did you mean origin"),
        ({"origin": [0, 0]}, r"block: origin: is \[0, 0\]; expected 3 numbers"),
        ({"origin": [0, 0, float("nan")]}, "origin: is .*nan.*expected 3 numbers"),
        ({"origin": ["0", "0", "0"]}, "origin: .*expected 3 numbers"),
        ({"x": [0, 0, 1]}, "y: missing; a frame needs both axes"),
        ({"x": [0, 0, 1], "y": [0, 0, 2]}, "y: is 0 deg from x; expected about 90 deg"),
        ({"x": [0, 0, 0], "y": [0, 1, 0]}, "x: has no length"),
        ({"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "rotation: is not a right-handed"),
        ({"rotation": np.eye(3).tolist(), "x": [1, 0, 0]}, "both 'rotation' and axes"),
        (
            {"symmetry": "half turns"},
            "symmetry: unknown group 'half turns'; did you mean half turn",
        ),
        ({"object_type": "functonal"}, "object_type: unknown type .*did you mean functional"),
        ({"object_type": "handle"}, "object_type: 'handle' cannot be chosen; expected axial"),
        ({"mass": -1}, "mass: is -1; expected a positive number"),
        ({"mass": True}, "mass: is True; expected a finite number"),
        ({"mass": "1e-3"}, "mass: is '1e-3'; expected a finite number: write 0.001"),
        ({"category": 7}, "category: is 7; expected a name"),
        ({"category": "../"}, "category: is '../'; expected a name"),
        ({"adjust": {"twist": [0, 0, 1]}}, "adjust: unknown field 'twist'"),
        ({"adjust": {1: 2, "turn": [0, 0, 0]}}, "adjust: unknown field '1'"),
        ({"adjust": [0, 0, 1]}, "adjust: is a list; expected fields"),
        ({"parts": {"a": {}, 7: {}}}, "parts: 7 is no text; write the name in quotes"),
        ({"parts": {"lid": {"hinge": {}}}}, "parts: lid: unknown field 'hinge'"),
        ({"parts": {"lid": {"joint": {"axis": [0, 0, 0]}}}}, "lid: joint: axis: has no length"),
        ({"parts": {"lid": {"handle": {"extents": [1, 0, 1]}}}}, "extents: .*3 positive lengths"),
    ],
)
def test_wrong_fields_are_named_in_one_line(fields, message):
    with pytest.raises(InputError, match=message) as error:
        _entry(**fields)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("labels.yaml: block: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1,\n", "labels.yaml:2: not valid YAML"),
        ("- a\n", "holds a list; expected objects' names"),
        ("12: {mass: 1}\n", "object 12 is no text; write the name in quotes"),
        ("a: 3\n", "a: is 3; expected fields"),
        ("a: {mass: 1}\na: {mass: 2}\n", "labels.yaml:2: a has an entry already"),
        ("a: {mass: 1, mass: 2}\n", "labels.yaml:1: mass has a value already"),
        ("a:\n  adjust: {turn: 1,\n    turn: 2}\n", "labels.yaml:3: turn has a value already"),
        ("a: &x\n  parts: *x\n", "labels.yaml:1: what is named here holds itself"),
        ("a:\n  origin: &x [0, 0, *x]\n", "labels.yaml:2: what is named here holds itself"),
        ("a: !!python/object:os.system {}\n", "labels.yaml:1: not valid YAML"),
    ],
)
def test_files_that_are_no_labels_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_overrides(_file(tmp_path, text))
    assert read_overrides(_file(tmp_path, "# nothing yet\n")) == {}


def test_saving_an_entry_leaves_the_rest_of_the_file_as_it_was(tmp_path):
    text = (
        "# ours\na:\n  mass: 1  # weighed\n\n# of b\nb:\n  mass: 2\n\n# of c\nc: {mass: 3}  # kg\n"
    )
    path = _file(tmp_path, text)
    put_entry(path, "b", {"category": "mug"})
    put_entry(path, "d", {"mass": 4})
    rest = text.replace("b:\n  mass: 2\n", "b: {category: mug}\n")
    assert path.read_text() == rest + "\nd: {mass: 4}\n"
    put_entry(path, "c", {})
    assert list(yaml.safe_load(path.read_text())) == ["a", "b", "d"]
    braces = _file(tmp_path, "{a: {mass: 1}, b: {mass: 2}}\n")
    put_entry(braces, "a", {"mass": 5})
    assert yaml.safe_load(braces.read_text()) == {"a": {"mass": 5}, "b": {"mass": 2}}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["labels.yaml"]


def test_an_adjustment_is_about_the_labels_own_axes_and_comes_last():
    label = made.label()
    after = moved(
        label,
        FrameOverride(
            origin=np.array([0.1, 0.0, 0.0]),
            turn=np.array([0.0, 0.3, 0.0]),
            shift=np.array([0.01, 0.0, 0.0]),
        ),
    )
    np.testing.assert_allclose(after.origin, [0.1, 0.0, 0.01])  # the label's X is up
    np.testing.assert_allclose(after.rotation[:, 1], label.rotation[:, 1])
    assert rotation_angle(after.rotation, label.rotation) == pytest.approx(0.3)
    assert moved(label, FrameOverride()) is label


@pytest.mark.parametrize("turn", [[0, 90, 0], [0, 0, -90], [90, 90, 0], [0, 40, 30]])
def test_other_axes_leave_the_rotations_of_the_object_as_they_are(turn):
    printed = SYMMETRIES["half turn"]
    label = replace(made.label(symmetry=SYMMETRIES["quarter turns"]), print_symmetry=printed)
    after = moved(label, FrameOverride(turn=np.deg2rad(turn)))
    for own, before in (
        (after.symmetry, label.symmetry),
        (after.symmetry_textured, label.symmetry_textured),
    ):
        turns = after.rotation @ own.rotations @ after.rotation.T
        kept = label.rotation @ before.rotations @ label.rotation.T
        np.testing.assert_allclose(turns, kept, atol=1e-12)


def test_symmetry_goes_with_axes_that_are_corrected():
    label = made.label()
    after = moved(label, FrameOverride(turn=np.deg2rad([2.0, 5.0, -10.0])))
    assert symmetry_name(after.symmetry) == "half turn"
    # Y where X was, as well as a hand can write it.
    x, y = -label.rotation[:, 1], label.rotation[:, 0] + [0, 0.02, 0]
    after = moved(label, FrameOverride(rotation=rotation_of("", {"x": [*x], "y": [*y]})))
    assert symmetry_name(after.symmetry) == "half turn about y"


def test_an_axis_of_revolution_stays_x_unless_a_symmetry_is_said(tmp_path):
    asset = made.block(tmp_path / "block")
    asset = replace(asset, label=made.label("axial", SYMMETRIES["axis and flip"]))
    mesh = surface(visible_shapes(asset.folder))

    def told(**fields):
        return overridden(asset, _entry(**fields), mesh, textured=False).label.symmetry

    for turn in ([0, 0, 2.5], [130, 0, 0], [0, 180, 0], [40, 178, 0]):
        assert symmetry_name(told(adjust={"turn": turn})) == "axis and flip"
    axes = {"x": [1, 0, 0], "y": [0, 0, 1]}
    with pytest.raises(InputError, match="block: x: is 90 deg from .*; give 'symmetry' too") as no:
        told(**axes)
    assert "\n" not in str(no.value)
    assert symmetry_name(told(**axes, symmetry="half turn")) == "half turn"
    off = {"origin": [0.03, 0, 0.1]}
    with pytest.raises(InputError, match="block: origin: lies 30 mm off .*, or `symmetry: none`"):
        told(**off)
    with pytest.raises(InputError, match="block: origin: lies 30 mm off"):
        told(adjust={"shift": [0.02, 0.03, 0]})
    assert symmetry_name(told(**off, symmetry="none")) == "none"
    assert symmetry_name(told(origin=[0.004, 0.002, 0.17])) == "axis and flip"


def test_symmetry_names_are_of_closed_groups_and_told_apart():
    for name, group in SYMMETRIES.items():
        assert symmetry_name(group) == name
        products = group.rotations[:, None] @ group.rotations[None]
        gaps = np.abs(products[:, :, None] - group.rotations).max(axis=(3, 4)).min(axis=2)
        assert gaps.max() < 1e-9
    assert len(SYMMETRIES["cube"].rotations) == 24
    fifth = SymmetryGroup.generated(rotation_about(np.eye(3)[0], 0.4 * np.pi)[None])
    assert symmetry_name(fifth) == "5 rotations"


def test_overriding_moves_the_frame_and_leaves_the_object_where_it_is(tmp_path):
    asset = made.block(tmp_path / "block")
    mesh = surface(visible_shapes(asset.folder))
    after = overridden(
        asset, _entry(origin=[0, 0, 0], x=[1, 0, 0.001], y=[0, 1, 0], mass=1.0), mesh, textured=True
    )
    np.testing.assert_allclose(after.label.extents, made.SIZE, atol=3e-4)
    np.testing.assert_allclose(after.mass_properties.inertia, 2 * asset.mass_properties.inertia)
    assert after.label_quality is None
    before_box = area_boxes(asset.areas, asset.label)[0]
    after_box = area_boxes(after.areas, after.label)[0]
    for one, other in ((before_box, after_box), (after_box, before_box)):
        ends = transform(one.pose, np.array([one.extents, -one.extents]) / 2)
        inside = transform(np.linalg.inv(other.pose), ends)
        assert (np.abs(inside) <= other.extents / 2 + 2e-4).all()


def test_another_type_is_measured_anew(tmp_path):
    asset = made.block(tmp_path / "block")
    mesh = surface(visible_shapes(asset.folder))
    told = overridden(asset, _entry(object_type="axial", up=[1, 0, 0]), mesh, textured=True)
    np.testing.assert_allclose(told.label.rotation[:, 0], [1, 0, 0], atol=1e-3)
    box = overridden(asset, _entry(object_type="mirror", up=[1, 0, 0]), mesh, textured=True)
    np.testing.assert_allclose(box.label.extents, sorted(made.SIZE)[::-1], atol=1e-3)
    np.testing.assert_array_equal(told.up, [1, 0, 0])
    assert told.label_quality is not None
    held = overridden(
        asset,
        _entry(
            object_type="functional", origin=[0, 0, 0.05], x=[0, 0, 1], y=[1, 0, 0], symmetry="none"
        ),
        mesh,
        textured=True,
    )
    assert held.label.object_type == "functional" and held.label_quality is None
    np.testing.assert_array_equal(held.label.origin, [0, 0, 0.05])


def test_another_category_brings_its_type_unless_one_is_said(tmp_path):
    asset = made.block(tmp_path / "block")
    mesh = surface(visible_shapes(asset.folder))
    assert asset.label.object_type == "mirror"

    def told(**fields):
        return overridden(asset, _entry(**fields), mesh, textured=True)

    jar = told(category="Jar")
    assert (jar.category, jar.label.object_type) == ("jar", "axial")
    flat = told(category="jar", object_type="mirror")
    assert (flat.category, flat.label.object_type) == ("jar", "mirror")
    other = told(category="Ink-Cartridge")
    assert (other.category, other.label) == ("ink_cartridge", asset.label)
    with pytest.raises(InputError, match="category: cabinet has parts that move; expected that of"):
        told(category="cabinet")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"mass": 2}, "cupboard: mass: an articulated object's follows from its parts"),
        ({"parts": {"drawr": {}}}, "unknown part 'drawr'; did you mean drawer"),
        (
            {"parts": {"door": {"handle": {"origin": [0, 0, 0]}}}},
            "handle: none was found; a new one",
        ),
    ],
)
def test_what_an_object_does_not_have_cannot_be_overridden(tmp_path, fields, message):
    asset = made.cupboard(tmp_path / "cupboard")
    override = parsed(Path("labels.yaml"), "cupboard", fields)
    with pytest.raises(InputError, match=message):
        overridden(asset, override, surface(visible_shapes(asset.folder)), textured=False)


def test_relabelling_changes_only_what_was_said_and_can_be_taken_back(tmp_path):
    asset = made.block(tmp_path / "out" / "block")
    kept = {p.name: p.read_bytes() for p in asset.folder.rglob("*") if p.is_file()}
    labels = _file(tmp_path, "block: {adjust: {turn: [0, 0, 10]}, symmetry: none, mass: 0.7}\n")
    (after,) = relabel(asset.folder, labels)
    _, angle = pose_error(after.label.pose, asset.label.pose, after.label.symmetry)
    assert float(angle) == pytest.approx(np.deg2rad(10))
    assert len(after.label.symmetry.rotations) == 1
    assert after.provenance.inputs[OVERRIDE]
    assert len(after.stable_poses) == 1 and len(after.grasps) == 1
    model = mujoco.MjModel.from_xml_path(str(after.model_path))
    assert model.body("block").mass[0] == pytest.approx(0.7)
    assert (asset.folder / GRASPS_FILE).read_bytes() == kept[GRASPS_FILE]
    # Again the same, although an adjustment is relative; with another adjustment, from what was measured.
    assert relabel(asset.folder, labels) == []
    (again,) = relabel(tmp_path / "out", _file(tmp_path, "block: {adjust: {turn: [0, 0, 4]}}\n"))
    _, angle = pose_error(again.label.pose, asset.label.pose, SymmetryGroup.identity())
    assert float(angle) == pytest.approx(np.deg2rad(4))
    assert again.mass_properties.mass == 0.5
    relabel(asset.folder, _file(tmp_path, "{}\n"))
    assert {p.name: p.read_bytes() for p in asset.folder.rglob("*") if p.is_file()} == kept
    assert not (asset.folder / MEASURED_FILE).exists()


def test_millimetres_and_grams_are_told(tmp_path):
    asset = made.block(tmp_path / "block")
    for entry, said in (
        ("{origin: [0, 0, 60]}", "m from the middle of an object of 0.213 m; expected metres"),
        ("{adjust: {shift: [10, 0, 0]}}", "the origin is 10"),
        ("{mass: 800}", "mass 800 kg is more than osmium of that size weighs; expected kilograms"),
        (
            "{mass: 1.0e-6}",
            "mass 1e-06 kg is less than air of that size weighs; expected kilograms",
        ),
    ):
        with pytest.raises(InputError, match=said):
            relabel(asset.folder, _file(tmp_path, f"block: {entry}\n"))
    assert read_asset(asset.folder).label.origin.tolist() == asset.label.origin.tolist()


def test_an_entry_with_nearly_the_name_of_one_asset_is_refused(tmp_path, capsys):
    asset = made.block(tmp_path / "block")
    relabel(asset.folder, _file(tmp_path, "block: {mass: 0.7}\n"))
    with pytest.raises(InputError, match="unknown object 'blok'; did you mean block"):
        relabel(asset.folder, _file(tmp_path, "blok: {mass: 0.4}\n"))
    assert read_asset(asset.folder).mass_properties.mass == 0.7
    other = _file(tmp_path, "spoon: {mass: 0.4}\n")
    assert main(["assets", "relabel", str(asset.folder), "--labels", str(other)]) == 0
    assert "block: no entry in" in capsys.readouterr().out
    assert read_asset(asset.folder).mass_properties.mass == 0.5


def test_relabelling_refuses_objects_that_are_not_there(tmp_path):
    made.block(tmp_path / "block")
    with pytest.raises(InputError, match="unknown object 'blok'; did you mean block"):
        relabel(tmp_path, _file(tmp_path, "blok: {mass: 1}\n"))


def test_handles_and_joints_reach_asset_and_model(tmp_path):
    asset = made.cupboard(tmp_path / "cupboard")
    bar = "{origin: [-0.3, 0.2, 0.1], x: [0, 0, 1], y: [-1, 0, 0], extents: [0.1, 0.02, 0.02]}"
    text = f"cupboard:\n  parts:\n    door: {{handle: {bar}, joint: {{origin: [0, 0.2, 0], axis: [0, 0.6, 0.8]}}}}\n"
    (after,) = relabel(asset.folder, _file(tmp_path, text))
    door = after.part("door")
    np.testing.assert_allclose(door.handle.origin, [-0.3, 0.2, 0.1])
    np.testing.assert_allclose(door.handle.extents, [0.1, 0.02, 0.02])
    model = mujoco.MjModel.from_xml_path(str(after.model_path))
    np.testing.assert_allclose(model.joint("door").axis, [0, 0.6, 0.8])
    np.testing.assert_allclose(model.joint("door").pos, [0, 0.2, 0])
    np.testing.assert_allclose(after.part("drawer").joint.axis, asset.part("drawer").joint.axis)


@pytest.mark.full
def test_builds_read_labels_and_know_when_an_entry_changed(tmp_path, caplog):
    box = files.box((0.2, 0.25, 0.3))  # too wide to grasp: quick
    content = {"models/Blue_Box/model.obj": files.obj(box)}
    content["models/Blue_Box/texture.png"] = files.image()
    scans, out = files.write_folder(tmp_path / "scans", content), tmp_path / "out"
    out.mkdir()

    def status(text: str) -> str:
        (out / "labels.yaml").write_text(text)
        return build("google_scanned_objects", scans, out)[0].status

    entry = "Blue_Box: {symmetry: none, category: crate, adjust: {shift: [0.01, 0, 0]}}\n"
    assert status(entry + "Blue_Bx: {mass: 1}\n") == "built"
    assert "unknown object 'Blue_Bx'; did you mean Blue_Box" in caplog.text
    asset = read_asset(out / "Blue_Box")
    before = measured(asset)
    middle = asset.label.pose @ np.append(asset.label.center, 1)
    np.testing.assert_allclose(
        before.label.pose @ np.append(before.label.center, 1), middle, atol=1e-5
    )
    assert np.linalg.norm(middle[:3]) > 0.01
    assert (asset.category, len(asset.label.symmetry.rotations)) == ("crate", 1)
    assert before.category != "crate" and len(before.label.symmetry.rotations) > 1
    np.testing.assert_allclose(asset.label.origin - before.label.origin, [0, 0, 0.01], atol=1e-5)
    assert status(entry) == "skipped"
    # What is put into a built asset is not what a build gives, which has other rest poses.
    relabel(asset.folder, _file(tmp_path, entry.replace("crate", "case")))
    assert read_asset(asset.folder).category == "case"
    assert status(entry) == "built"
    assert status("{}\n") == "built"
    again = read_asset(asset.folder)
    assert again.category == before.category and again.label_quality is not None
    assert not (asset.folder / MEASURED_FILE).exists()
