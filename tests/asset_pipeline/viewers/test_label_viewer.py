"""Going through labels: order, adjustments, saving and taking back; with viser, also the page."""

from __future__ import annotations

import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import tests.asset_pipeline.labelled_assets as made
from asset_pipeline.build.relabel import MEASURED_FILE
from asset_pipeline.viewers.label_session import OBJECT, LabelSession
from manipose_mj.assets.asset_json import read_asset, write_asset_json
from manipose_mj.assets.label_marks import label_lines, symmetry_planes
from manipose_mj.assets.symmetry_names import SYMMETRIES, symmetry_name
from manipose_mj.assets.visible_shapes import visible_shapes
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, rotation_about, rotation_angle


@pytest.fixture
def assets(tmp_path) -> Path:
    folder = tmp_path / "assets"
    made.block(folder / "sure", confidence=0.9)
    made.block(folder / "unsure", confidence=0.2)
    made.block(folder / "exact", confidence=None)
    made.cupboard(folder / "cupboard")
    return folder


@pytest.fixture
def session(assets) -> LabelSession:
    return LabelSession(assets, assets / "labels.yaml")


def test_the_least_certain_label_comes_first_and_steps_go_round(session):
    assert session.names == ("unsure", "sure", "cupboard", "exact")
    seen = []
    for _ in range(5):
        seen.append(session.asset.name)
        session.step(1)
    assert seen == [*session.names, "unsure"]
    session.step(-1)
    assert session.asset.name == "unsure"
    with pytest.raises(InputError, match="unknown asset 'sur'; did you mean sure"):
        session.open("sur")


def test_a_saved_adjustment_is_in_the_file_and_in_the_asset(session, assets):
    before = session.label
    session.turn(2, 30.0)
    session.shift(0, 0.01)
    session.set_symmetry("none")
    assert read_asset(assets / "unsure").label.symmetry.rotations.shape[0] == 2  # not yet
    session.save()
    after = read_asset(assets / "unsure")
    assert rotation_angle(after.label.rotation, before.rotation) == pytest.approx(
        np.pi / 6, abs=1e-5
    )
    moved = after.label.rotation[:, 0] * 0.01
    np.testing.assert_allclose(after.label.origin, before.origin + moved, atol=1e-6)
    assert after.label_quality is None
    entry = yaml.safe_load(session.labels.read_text())["unsure"]
    assert entry["symmetry"] == "none" and set(entry) == {"origin", "x", "y", "symmetry"}
    session.reset_to_measured()
    np.testing.assert_allclose(session.label.origin, before.origin)
    session.reset()
    np.testing.assert_allclose(session.label.origin, after.label.origin)
    session.forget()
    back = read_asset(assets / "unsure")
    np.testing.assert_array_equal(back.label.rotation, before.rotation)
    assert back.label_quality.confidence == 0.2
    assert yaml.safe_load(session.labels.read_text()) is None


def test_what_cannot_be_taken_back_stays_in_the_file(session, assets):
    session.turn(2, 30.0)
    session.save()
    text = session.labels.read_text()
    (assets / "unsure" / MEASURED_FILE).write_text("{}")
    with pytest.raises(InputError, match="measured.json"):
        session.forget()
    assert session.labels.read_text() == text


def test_symmetry_goes_with_the_axes_that_a_person_sees(session, assets):
    session.set_symmetry("axis")
    session.turn(1, 90.0)
    session.save()
    assert symmetry_name(read_asset(assets / "unsure").label.symmetry) == "axis"
    assert yaml.safe_load(session.labels.read_text())["unsure"]["symmetry"] == "axis"


def test_a_label_that_keeps_its_symmetry_keeps_that_of_its_print(tmp_path):
    block = made.block(tmp_path / "assets" / "printed")
    printed = replace(block.label, print_symmetry=SymmetryGroup.identity())
    write_asset_json(replace(block, label=printed))
    session = LabelSession(tmp_path / "assets", tmp_path / "labels.yaml")
    session.shift(0, 0.01)
    session.save()
    label = read_asset(tmp_path / "assets" / "printed").label
    assert label.print_symmetry is not None and len(label.print_symmetry.rotations) == 1
    assert "symmetry" not in yaml.safe_load(session.labels.read_text())["printed"]
    session.set_symmetry(symmetry_name(label.symmetry))  # of its print as well
    session.save()
    assert read_asset(tmp_path / "assets" / "printed").label.print_symmetry is None


def test_saving_keeps_what_else_the_file_says(session, assets):
    session.labels.write_text(
        "unsure:\n  mass: 2.0\n  adjust: {turn: [0, 0, 5]}\n# ours\nother: {mass: 1}\n"
    )
    session.place(compose(rotation_about(np.eye(3)[2], 1.0), np.array([0.0, 0.0, 0.05])))
    session.save()
    text = session.labels.read_text()
    assert "# ours\nother: {mass: 1}\n" in text
    entry = yaml.safe_load(text)["unsure"]
    assert entry["mass"] == 2.0 and "adjust" not in entry
    asset = read_asset(assets / "unsure")
    assert asset.mass_properties.mass == 2.0
    np.testing.assert_allclose(asset.label.origin, [0, 0, 0.05])


def test_handles_are_labels_too(session, assets):
    session.open("cupboard")
    assert session.targets == (OBJECT, "drawer")
    session.select("drawer")
    session.shift(1, 0.02)
    assert session.shown.part("drawer").handle is session.label
    session.save()
    asset = read_asset(assets / "cupboard")
    np.testing.assert_allclose(asset.part("drawer").handle.origin, [-0.32, 0, 0.1])
    np.testing.assert_array_equal(asset.label.origin, made.label().origin)
    with pytest.raises(InputError, match="unknown label 'door'"):
        session.select("door")


def test_what_cannot_be_applied_is_not_saved(session, assets):
    session.labels.write_text("cupboard: {mass: 3}\n")
    session.open("cupboard")
    files = {p: p.read_bytes() for p in assets.rglob("*") if p.is_file()}
    with pytest.raises(InputError, match="mass: an articulated object's follows"):
        session.save()
    assert {p: p.read_bytes() for p in assets.rglob("*") if p.is_file()} == files


def test_looks_are_read_back_as_they_were_written(assets):
    (block,) = visible_shapes(assets / "sure")["block"]
    assert block.texture.is_file() and block.mesh.visual.uv is not None
    np.testing.assert_allclose(block.mesh.extents, made.SIZE, atol=1e-5)
    shapes = visible_shapes(assets / "cupboard")
    assert list(shapes) == ["base", "drawer", "door"]
    assert shapes["door"][0].size == (0.03, 0.02, 0.1)
    assert shapes["door"][0].rgba == (0.2, 0.4, 0.6, 1.0)


@pytest.mark.parametrize(
    ("name", "normals"),
    [
        ("none", [2]),
        ("half turn", [2, 1]),
        ("three half turns", [2, 1, 0]),
        ("quarter turns", [2, 1]),
    ],
)
def test_planes_are_those_of_the_conventions(name, normals):
    planes = symmetry_planes(made.label(symmetry=SYMMETRIES[name]))
    assert [int(box.extents.argmin()) for box in planes] == normals
    assert symmetry_planes(made.label("functional")) == ()


def test_a_slides_axis_goes_through_its_handle_and_with_it(assets):
    asset = read_asset(assets / "cupboard")
    joints = [line for line in label_lines(asset) if line.colour == (0.0, 0.80, 0.90)]
    np.testing.assert_allclose((joints[0].start + joints[0].end) / 2, [-0.3, 0, 0.1])
    assert [line.body for line in joints] == ["drawer", None]


def test_without_viser_the_command_says_what_to_install(assets, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "viser", None)
    assert main(["assets", "label", str(assets)]) == 2
    assert 'pip install -e ".[label]"' in capsys.readouterr().err


def test_the_page_answers_and_its_buttons_move_and_save(assets):
    pytest.importorskip("viser")
    from asset_pipeline.viewers.label_viewer import LabelViewer

    session = LabelSession(assets, assets / "labels.yaml")
    with LabelViewer(session, host="127.0.0.1", port=18080) as viewer:
        with urllib.request.urlopen(viewer.address, timeout=10) as page:
            assert page.status == 200 and b"<html" in page.read().lower()
        before = session.label
        for _ in range(4):
            viewer.turn("Y", -1)
        viewer.shift("Z", 1)
        viewer.set_symmetry("axis")
        viewer.save()
        saved = read_asset(assets / "unsure").label
        assert rotation_angle(saved.rotation, before.rotation) == pytest.approx(
            np.deg2rad(2), abs=1e-5
        )
        assert np.linalg.norm(saved.origin - before.origin) == pytest.approx(0.0005, abs=1e-6)
        assert symmetry_name(saved.symmetry) == "axis"
        for name in session.names:  # everything can be drawn
            viewer.open(name)
        viewer.open("cupboard")
        viewer.select("drawer")
        assert session.target == "drawer"
        session.labels.write_text("cupboard: {mass: 3}\n")
        viewer.save()  # said on the page; the server lives on
        viewer.step(1)
        assert session.asset.name == "exact"
        viewer.open("unsure")
        viewer.reset_to_measured()
        viewer.forget()
        np.testing.assert_array_equal(read_asset(assets / "unsure").label.rotation, before.rotation)
