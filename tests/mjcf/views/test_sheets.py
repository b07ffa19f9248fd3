"""Contact sheets: axes are drawn where the label is, visible through the object, without GL."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import tests.asset_pipeline.labelled_assets as made
from manipose_mj.assets.asset import MODEL_FILE
from manipose_mj.assets.catalogue import draft
from manipose_mj.cli.main import main
from manipose_mj.mjcf.views.contact_sheet import Cell, contact_sheet
from manipose_mj.mjcf.views.thumbnails import thumbnail
from manipose_mj.poses import rotation_about

SIZE = 160
RED, GREEN, BLUE, CYAN = (230, 26, 26), (26, 178, 38), (31, 64, 242), (0, 204, 230)


def _pixels(picture: Image.Image, colour: tuple[int, int, int]) -> np.ndarray:
    """Columns and rows, from the picture's middle to the right and upwards, of this colour."""
    near = np.abs(np.asarray(picture, int) - colour).max(axis=2) < 20
    rows, columns = np.nonzero(near)
    return np.stack([columns - picture.width / 2, picture.height / 2 - rows], axis=1)


def test_axes_are_seen_through_the_object_from_the_labels_side(tmp_path):
    asset = made.block(tmp_path / "block")
    picture = thumbnail(asset, SIZE, engine="ray")
    assert picture.size == (SIZE, SIZE)
    ends = {}
    for name, colour in (("x", RED), ("y", GREEN), ("z", BLUE)):
        own = _pixels(picture, colour)
        assert len(own) > 12, name
        ends[name] = own[np.linalg.norm(own, axis=1).argmax()]
    assert ends["x"][1] > 40 and abs(ends["x"][0]) < 5  # up
    assert ends["y"][0] < -8 and ends["z"][0] > 8
    # Turned with its label, an object looks the same; with a label that lies, it does not.
    wrong = asset.label.rotation @ rotation_about(np.eye(3)[2], np.pi / 2)
    lies = replace(asset, label=replace(asset.label, rotation=wrong))
    one, other = (np.asarray(p, float) for p in (picture, thumbnail(lies, SIZE, engine="ray")))
    assert np.abs(one - other).mean() > 10


def test_whatever_group_of_those_seen_an_object_is_of_it_looks_the_same(tmp_path):
    asset = made.block(tmp_path / "block")
    before = thumbnail(asset, SIZE, engine="ray")
    text = asset.model_path.read_text()
    assert 'group="2"' in text
    asset.model_path.write_text(text.replace('group="2"', 'group="0"'))
    np.testing.assert_array_equal(thumbnail(asset, SIZE, engine="ray"), before)


def test_tools_lie_along_the_picture(tmp_path):
    knife = draft("knife", 0, tmp_path)
    picture = thumbnail(knife, SIZE, engine="ray")
    red = _pixels(picture, RED)
    assert np.ptp(red[:, 0]) > 2 * np.ptp(red[:, 1])


def test_moving_parts_are_ajar_with_cyan_axes_and_handle_axes(tmp_path):
    cabinet = draft("cabinet", 0, tmp_path)
    assert cabinet.kind == "articulated" and not list(tmp_path.glob("meshes/*collision*"))
    picture = thumbnail(cabinet, 160, engine="ray")
    assert len(_pixels(picture, CYAN)) > 100
    bare = replace(cabinet, parts=tuple(replace(p, handle=None) for p in cabinet.parts))
    assert len(_pixels(picture, RED)) > len(_pixels(thumbnail(bare, 160, engine="ray"), RED)) + 30


def test_all_cells_are_on_the_sheet_with_their_names():
    cells = [
        Cell(Image.new("RGB", (40, 40), (i * 20, 90, 200)), f"a_very_long_name_{i}", "axis")
        for i in range(11)
    ]
    sheet = np.asarray(contact_sheet("mug: 11", cells))
    for index in range(11):
        assert (sheet == (index * 20, 90, 200)).all(axis=2).sum() == 1600
    assert sheet.shape[1] < 10 * 60
    dark = (sheet < 80).all(axis=2).sum(axis=1)
    assert np.count_nonzero(np.diff((dark > 0).astype(int)) == 1) >= 3  # a title, two rows of names


def test_command_draws_a_sheet_a_category(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    made.block(tmp_path / "assets" / "one")
    made.cupboard(tmp_path / "assets" / "two")
    out = tmp_path / "sheets"
    command = ["assets", "sheet", str(tmp_path / "assets"), "--out", str(out), "--size", "48"]
    assert main([*command, "--jobs", "1"]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["box.png", "cabinet.png"]
    assert Image.open(out / "box.png").width > 48
    assert main([*command, "--category", "cabinett"]) == 2
    assert "unknown category 'cabinett'; did you mean cabinet?" in capsys.readouterr().err


def test_a_model_without_geoms_is_one_line(tmp_path, capsys):
    made.block(tmp_path / "assets" / "one")
    (tmp_path / "assets" / "one" / MODEL_FILE).write_text("<mujoco/>")
    command = ["assets", "sheet", str(tmp_path / "assets"), "--out", str(tmp_path / "sheets")]
    assert main([*command, "--jobs", "1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(f"one/{MODEL_FILE}: has no body with a geom")


def test_a_file_in_the_place_of_the_folder_is_told_before_anything_is_drawn(
    tmp_path, capsys, monkeypatch
):
    made.block(tmp_path / "assets" / "one")
    (tmp_path / "out").write_text("kept")
    started = []
    monkeypatch.setattr("joblib.Parallel", lambda **_: started.append)
    command = ["assets", "sheet", str(tmp_path / "assets"), "--out", str(tmp_path / "out")]
    assert main([*command, "--jobs", "1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("out: cannot write there (File exists); choose another --out")
    assert not started and (tmp_path / "out").read_text() == "kept"


def test_command_without_a_folder_says_what_it_is_about_to_draw(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("manipose_mj.cli.assets.sheet._built_in", lambda _: {"mug": [("mug", 0)]})
    command = ["assets", "sheet", "--out", str(tmp_path), "--size", "48", "--jobs", "1"]
    assert main(command) == 0
    first, *_, last = capsys.readouterr().out.splitlines()
    assert first.startswith(
        "no folder given: drawing 1 built-in objects of 1 categories; --category"
    )
    assert last.startswith("1 sheets in")


@pytest.mark.parametrize("arguments", [["--size", "8"], ["--category", "mugg"]])
def test_bad_arguments_are_one_line(tmp_path, capsys, arguments):
    assert main(["assets", "sheet", "--out", str(tmp_path), *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
