"""A build replaces assets, and neither a person's files nor the asset of another file."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

import tests.asset_pipeline.labelled_assets as made
import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import build
from asset_pipeline.build.pool import BuildJob, run_jobs
from asset_pipeline.build.replaceable import check_origin, check_replaceable, place
from asset_pipeline.catalogue.parallel_build import build_catalogue
from asset_pipeline.sources import meshes
from asset_pipeline.sources.meshes import MeshOptions
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.errors import InputError
from manipose_mj.storage.staging import LOCK, PREFIX

SAID = MeshOptions("box", "mirror", "z", "m", "CC0 1.0")


def _box(path: Path, size: tuple[float, float, float] = (0.2, 0.25, 0.3)) -> Path:
    """Too wide to grasp: quick."""
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(size).export(path)
    return path


def _content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def _writes(folder: Path, target: Path) -> bool:
    target.mkdir()
    (target / "asset.json").write_text("new")
    return True


def _status(folder: Path, *sources: Path) -> tuple[str, str]:
    job = BuildJob(folder.name, folder, "here.obj", _writes, (), None, sources)
    (result,) = run_jobs([job])
    return result.status, result.reason


def test_a_folder_that_is_no_asset_stays_and_the_others_are_built(tmp_path):
    _box(tmp_path / "tea_box" / "model.obj")
    (tmp_path / "tea_box" / "notes.txt").write_text("mine")
    _box(tmp_path / "in" / "tea_box.obj")
    _box(tmp_path / "in" / "rice_box.obj")
    before = _content(tmp_path / "tea_box")
    results = {r.name: r for r in build("meshes", tmp_path / "in", tmp_path, said=SAID)}
    assert (results["tea_box"].status, results["rice_box"].status) == ("failed", "built")
    reason = results["tea_box"].reason
    assert f"{tmp_path / 'tea_box'}: is no asset" in reason and "\n" not in reason
    assert _content(tmp_path / "tea_box") == before


@pytest.mark.parametrize("source", ["meshes", "google_scanned_objects"])
def test_a_folder_that_holds_the_source_stays(tmp_path, source):
    if source == "meshes":
        path, said = _box(tmp_path / "Blue_Box" / "model.obj"), SAID
    else:
        box = files.box((0.2, 0.25, 0.3))
        content = {"Blue_Box/model.obj": files.obj(box), "Blue_Box/texture.png": files.image()}
        path, said = files.write_folder(tmp_path, content), None
    # Not even where it is an asset, too.
    (tmp_path / "Blue_Box" / "asset.json").write_text("{}")
    before = _content(tmp_path / "Blue_Box")
    (result,) = build(source, path, tmp_path, said=said)
    assert result.status == "failed" and "model.obj, which the asset would replace" in result.reason
    assert _content(tmp_path / "Blue_Box") == before


def test_what_may_be_replaced(tmp_path):
    folder = tmp_path / "mug"
    assert _status(folder)[0] == "built"
    (folder / "asset.json").write_text("old")
    assert _status(folder, tmp_path / "mug.obj")[0] == "built"
    assert (folder / "asset.json").read_text() == "new"
    shutil.rmtree(folder)
    folder.mkdir()
    assert _status(folder)[0] == "built"
    folder.joinpath("asset.json").rename(tmp_path / "file")
    folder.rmdir()
    (tmp_path / "file").rename(folder)
    status, reason = _status(folder)
    assert status == "failed" and f"{folder}: is a file" in reason


def test_a_source_behind_a_link_counts_as_in_the_folder(tmp_path):
    folder = tmp_path / "mug"
    folder.mkdir()
    (folder / "asset.json").touch()
    (folder / "mug.obj").touch()
    (tmp_path / "link.obj").symlink_to(folder / "mug.obj")
    with pytest.raises(InputError, match=r"holds .*link\.obj"):
        check_replaceable(folder, [tmp_path / "link.obj"])
    (tmp_path / "here").mkdir()
    with pytest.raises(InputError, match="holds"):
        check_replaceable(tmp_path / "here" / ".." / "mug", [folder / "mug.obj"])


def test_names_that_no_folder_can_have_are_refused_in_one_line(tmp_path):
    status, reason = _status(tmp_path / ("L" * 240))
    assert status == "failed" and "a name of 240 bytes; expected at most 200" in reason


@pytest.mark.parametrize("name", ["lock", "padlock", "model"])
def test_no_name_is_in_the_way_of_the_build(tmp_path, name):
    assert LOCK.startswith(PREFIX)
    assert _status(tmp_path / name) == ("built", "")
    assert [p.name for p in tmp_path.iterdir()] == [name]


def _asset(out: Path, file: Path) -> str:
    (result,) = build("meshes", file, out, said=SAID)
    return f"{result.status} {result.reason}"


def test_another_file_of_the_same_name_does_not_replace_an_asset(tmp_path):
    out = tmp_path / "out"
    first, second = _box(tmp_path / "s1" / "cup.obj"), _box(tmp_path / "s2" / "cup.obj")
    assert _asset(out, first) == "built "
    assert _asset(out, second) == "skipped "  # a copy is no other file
    _box(second, (0.2, 0.25, 0.28))
    refused = _asset(out, second)
    assert refused.startswith(
        f"failed {second}: {out / 'cup'} was built from another file, a cup.obj"
    )
    np.testing.assert_allclose(
        sorted(read_asset(out / "cup").label.extents), [0.2, 0.25, 0.3], atol=1e-3
    )
    # What was exported again is built again, also where the folder of everything has moved.
    _box(first, (0.2, 0.25, 0.26))
    (tmp_path / "elsewhere").mkdir()
    for name in ("out", "s1"):
        (tmp_path / name).rename(tmp_path / "elsewhere" / name)
    assert (
        _asset(tmp_path / "elsewhere" / "out", tmp_path / "elsewhere" / "s1" / "cup.obj")
        == "built "
    )


def test_the_asset_of_another_source_is_not_replaced(tmp_path):
    file = _box(tmp_path / "Blue_Box.obj")
    box = files.box((0.2, 0.25, 0.3))
    content = {"Blue_Box/model.obj": files.obj(box), "Blue_Box/texture.png": files.image()}
    build(
        "google_scanned_objects", files.write_folder(tmp_path / "scans", content), tmp_path / "out"
    )
    assert "was built from another file, Blue_Box of " in _asset(tmp_path / "out", file)


def test_data_sets_and_the_catalogue_do_not_replace_the_asset_of_another_source(tmp_path):
    out = tmp_path / "out"
    for name in ("Blue_Box", "box_003"):
        made.block(out / name)
    before = _content(out)
    box = files.box((0.2, 0.25, 0.3))
    content = {"Blue_Box/model.obj": files.obj(box), "Blue_Box/texture.png": files.image()}
    scans = files.write_folder(tmp_path / "scans", content)
    results = build("google_scanned_objects", scans, out) + build_catalogue(out, only=["box_003"])
    for result, source in zip(
        results, ("Google Scanned Objects", "procedural catalogue"), strict=True
    ):
        assert result.status == "failed" and "\n" not in result.reason
        assert "was built from another source, block of test; expected" in result.reason
        assert f"{result.folder}: " in result.reason and source in result.reason
    assert _content(out) == before


def test_an_asset_that_does_not_say_where_its_file_lay_is_replaced(tmp_path):
    out = tmp_path / "out"
    file = _box(tmp_path / "cup.obj")
    _asset(out, file)
    text = (out / "cup" / "asset.json").read_text()
    other = tmp_path / "s2" / "cup.obj"
    _box(other, (0.2, 0.25, 0.28))
    (out / "cup" / "asset.json").write_text(text.replace('"place"', '"other"'))
    (item,) = meshes.items(other, SAID)
    check_origin(out / "cup", item.file, meshes.SOURCE, meshes.inputs(item))
    assert place(file, out / "cup") != place(other, out / "cup")
