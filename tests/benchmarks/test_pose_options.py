"""Tables of poses refuse what they cannot measure or write before they render anything, in one line."""

from __future__ import annotations

import importlib
import json

import pytest

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.estimator import PoseEstimator

RENDERED = ("catalogue_clouds", "views_of", "scans", "clouds_of", "furniture_scenes")


@pytest.fixture
def refusal(monkeypatch, capsys):
    """What a script says that ends with 2 and has rendered nothing."""

    def run(script, *words):
        table = importlib.import_module(script)
        for name in RENDERED:
            if hasattr(table, name):
                monkeypatch.setattr(table, name, lambda *_, **__: pytest.fail("rendered"))
        assert table.main([str(word) for word in words]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"{script}: ") and said.count("\n") == 1
        return said

    return run


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("pose_table", ("--setting",)),
        ("type_table", ("--setting",)),
        ("pose_robustness", ("--setting",)),
        ("real_scan_table", ("scans", "--setting")),
        ("lost_signs", ("--settings", "anywhere")),
    ],
)
def test_settings_of_several_cameras_are_refused(refusal, script, words):
    """Networks of one camera are tens of degrees off on what several see."""
    assert "'several' is of several cameras" in refusal(script, *words, "several")


@pytest.mark.parametrize("script", ["pose_table", "pose_robustness", "lost_signs"])
def test_types_and_unknown_names_are_no_categories(refusal, script):
    assert "axial is a type; expected categories" in refusal(script, "--categories", "mug", "axial")
    assert "did you mean mug" in refusal(script, "--categories", "mug", "mgu")


def test_speed_is_of_a_category(refusal):
    assert "axial is a type" in refusal("pose_speed", "--category", "axial", "--parts", "one")


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("pose_table", ("--json",)),
        ("type_table", ("--json",)),
        ("pose_robustness", ("--json",)),
        ("pose_robustness", ("--picture",)),
        ("pose_speed", ("--json",)),
        ("real_scan_table", ("scans", "--json")),
        ("real_scan_table", ("scans", "--pictures")),
        ("lost_signs", ("--json",)),
        ("articulated_table", ("--json",)),
        ("articulated_table", ("--pictures",)),
    ],
)
def test_what_cannot_be_written_is_refused(refusal, tmp_path, script, words):
    (tmp_path / "file").write_text("")
    assert "file/rows.json: cannot be written" in refusal(
        script, *words, tmp_path / "file/rows.json"
    )


def test_weights_that_are_not_there_are_refused(refusal, tmp_path):
    assert "none.npz: no such file" in refusal("articulated_table", "--weights", "none.npz")
    for script in ("pose_robustness", "type_table"):
        assert "no such file of weights" in refusal(script, "--weights", tmp_path)


def test_all_networks_are_read_before_the_first_is_measured(refusal, tmp_path):
    """A missing one is not found when others have been measured for minutes."""
    (tmp_path / "axial").mkdir()
    shipped = importlib.import_module("manipose_mj.ppf_jax").__path__[0]
    weights = tmp_path / "axial" / "weights.npz"
    weights.symlink_to(f"{shipped}/weights/axial.npz")
    assert PoseEstimator.from_file(weights).trained.cameras == "one"
    assert "mirror/weights.npz" in refusal("type_table", "--weights", tmp_path)


def test_rows_are_written_whole_or_not_at_all(tmp_path):
    options = importlib.import_module("pose_tables.options")
    target = tmp_path / "new" / "rows.json"
    options.check_files(target, None)
    assert not target.parent.exists()
    options.write_rows(target, [{"n": 1}])
    with pytest.raises(TypeError):
        options.write_rows(target, [{"n": object()}])
    assert json.loads(target.read_text()) == [{"n": 1}]
    assert [path.name for path in target.parent.iterdir()] == ["rows.json"]
    with pytest.raises(InputError, match="is a folder; expected a file"):
        options.check_files(tmp_path)
    with pytest.raises(InputError, match="cannot be written"):
        options.write_rows(tmp_path, [])
