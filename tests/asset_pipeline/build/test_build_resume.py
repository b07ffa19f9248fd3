"""A build that is killed, at whatever moment, goes on where it was and ends as if it had not been."""

from __future__ import annotations

import hashlib
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import tests.asset_pipeline.labelled_assets as made
import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import build, up_to_date
from asset_pipeline.build.pool import BuildJob, run_jobs
from asset_pipeline.build.workers.limited_call import Limits
from asset_pipeline.catalogue.parallel_build import build_catalogue
from manipose_mj.assets import catalogue, categories
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.errors import InputError
from manipose_mj.storage.staging import LOCK, clear_staging, put_in_place, staging
from tests.places import ROOT

SOURCE = "google_scanned_objects"
NAMES = ("Blue_Box", "Green_Box")
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")


def _scans(root: Path) -> Path:
    content = {}
    for index, name in enumerate(NAMES):
        box = files.box((0.2, 0.25 + 0.02 * index, 0.3))  # too wide to grasp: quick
        content[f"models/{name}/model.obj"] = files.obj(box)
        content[f"models/{name}/texture.png"] = files.image()
    return files.write_folder(root, content)


def _hashes(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def _descendants(pid: int) -> set[int]:
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            parents[int(stat.parent.name)] = int(fields[1])
    found = {pid}
    while more := {p for p, parent in parents.items() if parent in found} - found:
        found |= more
    return found & set(parents)


def _started(scans: Path, out: Path, jobs: int) -> subprocess.Popen[bytes]:
    """A build in a process of its own, caught with an object half done."""
    command = ["assets", "build", SOURCE, str(scans), "--out", str(out), "--jobs", str(jobs)]
    process = subprocess.Popen(
        [sys.executable, "-m", "manipose_mj.cli.main", *command],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 60
    # Something is being written: the texture's copy, the meshes.
    while not list(out.glob(".building-*/*/*")) and time.monotonic() < deadline:
        assert process.poll() is None, "the build ended before it could be killed"
        time.sleep(0.002)
    return process


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory) -> tuple[Path, dict[str, str]]:
    folder = tmp_path_factory.mktemp("resume")
    scans = _scans(folder / "scans")
    results = build(SOURCE, scans, folder / "out")
    assert [(r.status, r.reason) for r in results] == [("built", "")] * 2
    assert sorted(p.name for p in (folder / "out").iterdir()) == sorted(NAMES)
    return scans, _hashes(folder / "out")


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(("jobs", "everything"), [(1, True), (2, False)])
def test_killed_build_goes_on_and_ends_the_same(uninterrupted, tmp_path, jobs, everything):
    scans, expected = uninterrupted
    out = tmp_path / "out"
    process = _started(scans, out, jobs)
    family = _descendants(process.pid)
    assert len(family) >= 3  # the build, its server, the object
    for pid in family if everything else {process.pid}:
        os.kill(pid, signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 20
    while (left := [p for p in family if p in _descendants(p)]) and time.monotonic() < deadline:
        if not everything and all(_is_idle(p) for p in left):
            break
        time.sleep(0.05)
    for name in NAMES:  # whole or not at all
        assert not (out / name).exists() or (out / name / "asset.json").is_file()
    results = build(SOURCE, scans, out)
    assert {r.status for r in results} <= {"built", "skipped"}
    assert _hashes(out) == expected
    assert sorted(p.name for p in out.iterdir()) == sorted(NAMES)


def _is_idle(pid: int) -> bool:
    """Whether it is not part of building an object any more (loky's tracker ends when it likes)."""
    try:
        return b"asset_pipeline" not in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return True


def test_time_limit_is_a_failure_of_that_object(uninterrupted, tmp_path):
    scans, _ = uninterrupted
    results = build(SOURCE, scans, tmp_path, only=NAMES[:1], limits=Limits(seconds=0.1))
    (result,) = results
    assert result.status == "failed" and "time limit of 0.1 s" in result.reason
    assert str(scans) in result.reason and "\n" not in result.reason
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "lost", ["model.xml", "grasps.json", "meshes/block_visual_00.obj", "meshes/block_visual_00.png"]
)
def test_an_asset_that_lost_a_file_is_not_up_to_date(tmp_path, lost):
    asset = made.block(tmp_path / "block")
    provenance = asset.provenance
    assert up_to_date(asset.folder, provenance.inputs, provenance.generator)
    (asset.folder / lost).unlink()
    assert not up_to_date(asset.folder, provenance.inputs, provenance.generator)


def test_a_model_edited_by_hand_is_up_to_date_where_its_files_are_there(tmp_path):
    asset = made.block(tmp_path / "block")
    text = asset.model_path.read_text().replace('="meshes/', '="')
    text = text.replace("<compiler ", '<compiler meshdir="meshes" texturedir="meshes" ')
    asset.model_path.write_text(text)
    provenance = asset.provenance
    assert up_to_date(asset.folder, provenance.inputs, provenance.generator)
    next(asset.folder.glob("meshes/*.png")).unlink()
    assert not up_to_date(asset.folder, provenance.inputs, provenance.generator)


def test_furniture_is_up_to_date_without_grasps(tmp_path):
    asset = made.cupboard(tmp_path / "cupboard")
    assert up_to_date(asset.folder, {}, asset.provenance.generator)


def test_folders_of_the_dead_are_removed_and_those_of_the_living_are_not(tmp_path):
    folder = tmp_path / "thing"
    left = tmp_path / ".building-thing-left"
    left.mkdir()
    (left / LOCK).touch()
    with staging(folder) as mine:
        clear_staging(tmp_path)
        assert not left.exists() and mine.is_dir()
        with staging(folder) as other:
            assert mine.is_dir() and other != mine
            for content, place in (("1", mine), ("2", other)):
                (place / "built").mkdir()
                (place / "built" / "file").write_text(content)
                put_in_place(place / "built", folder)
    assert (folder / "file").read_text() == "2"
    assert [p.name for p in tmp_path.iterdir()] == ["thing"]


def _breaks(kind: type[Exception], folder: Path, target: Path) -> bool:
    target.mkdir()
    (target / "half").touch()
    raise kind(f"something in {target}\nis wrong")


@pytest.mark.parametrize("kind", [InputError, ZeroDivisionError])
def test_what_fails_leaves_nothing_and_says_why_in_one_line(tmp_path, kind):
    job = BuildJob("thing", tmp_path / "thing", "here.obj", _breaks, (kind,), None)
    (result,) = run_jobs([job])
    name = "" if kind is InputError else "ZeroDivisionError: "
    assert result.status == "failed"
    assert result.reason == f"{name}something in here.obj/thing is wrong"
    assert not list(tmp_path.iterdir())


def _warns(folder: Path, target: Path) -> bool:
    logging.getLogger(__name__).warning("thing: its texture is not there")
    return False


def test_a_warning_names_the_object_once(tmp_path, caplog):
    run_jobs([BuildJob("thing", tmp_path / "thing", "here.obj", _warns, (), Limits())])
    assert [r.getMessage() for r in caplog.records] == ["thing: here.obj: its texture is not there"]


def test_catalogue_builds_skips_and_survives_a_generator_that_fails(tmp_path, monkeypatch):
    missing = catalogue.Category("unwritten", "mirror", "none", (0.1, 0.2), 5)
    monkeypatch.setitem(catalogue.CATALOGUE, "unwritten", missing)
    seen = []
    results = build_catalogue(
        tmp_path,
        only=["box_003", "unwritten_001"],
        progress=lambda r, n: seen.append((r.name, n)),
    )
    assert [(r.name, r.status) for r in results] == [
        ("box_003", "built"),
        ("unwritten_001", "failed"),
    ]
    assert "asset_pipeline.procedural.mirror.unwritten" in results[1].reason
    assert sorted(seen) == [("box_003", 2), ("unwritten_001", 2)]
    assert [p.name for p in tmp_path.iterdir()] == ["box_003"]
    before = _hashes(tmp_path)
    assert [r.status for r in build_catalogue(tmp_path, only=["box_003"])] == ["skipped"]
    monkeypatch.setattr(categories, "_code_hash", lambda module: "other code")
    assert [r.status for r in build_catalogue(tmp_path, only=["box_003"])] == ["built"]
    after = _hashes(tmp_path)
    assert {f for f in before if before[f] != after[f]} == {"box_003/asset.json"}


def test_a_catalogue_of_which_nothing_is_built_leaves_no_new_folder(tmp_path, monkeypatch):
    missing = catalogue.Category("unwritten", "mirror", "none", (0.1, 0.2), 5)
    monkeypatch.setitem(catalogue.CATALOGUE, "unwritten", missing)
    (result,) = build_catalogue(tmp_path / "new" / "out", only=["unwritten_001"])
    assert result.status == "failed" and not list(tmp_path.iterdir())


def test_catalogue_fills_the_cache_that_load_reads(tmp_path, monkeypatch):
    monkeypatch.setenv(catalogue.CACHE_VARIABLE, str(tmp_path))
    (result,) = build_catalogue(only=["box_002"])
    assert (result.status, result.folder) == ("built", catalogue.cached("box", 2))
    modified = (result.folder / "asset.json").stat().st_mtime_ns
    assert catalogue.load("box", 2).provenance.inputs == {"code": catalogue.code_hash("box")}
    assert (result.folder / "asset.json").stat().st_mtime_ns == modified
    with pytest.raises(InputError, match="did you mean box"):
        build_catalogue(only=["boxx"])


def test_catalogue_builds_objects_beyond_its_own(tmp_path):
    (result,) = build_catalogue(tmp_path, only=["box"], beyond=1)
    count = catalogue.CATALOGUE["box"].instances
    assert (result.status, result.name) == ("built", f"box_{count:03d}")
    assert result.name not in catalogue.instances("box")
    assert read_asset(tmp_path / result.name).graspable is not None
    with pytest.raises(InputError, match="box_000"):  # it is not beyond
        build_catalogue(tmp_path, only=["box_000"], beyond=1)
    for out, beyond, told in ((None, 1, "--out DIR"), (tmp_path, -1, "beyond is -1")):
        with pytest.raises(InputError, match=told) as caught:
            build_catalogue(out, beyond=beyond)
        assert "\n" not in str(caught.value)
