"""The catalogue: names, the cache, the same object every time and everywhere."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from asset_pipeline.catalogue import instance
from manipose_mj.assets import catalogue, categories
from manipose_mj.errors import InputError
from manipose_mj.storage.source_hash import source_hash, sources

CATEGORIES = ("chips_can", "mug", "box", "bowl", "cabinet")


@pytest.fixture(scope="module", autouse=True)
def cache_root(tmp_path_factory):
    """A cache of this module's own."""
    root = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(catalogue.CACHE_VARIABLE, str(root))
        yield root


def contents(folder: Path) -> dict[str, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_names_and_instances():
    assert set(CATEGORIES) < set(catalogue.names())
    assert catalogue.instances("mug")[3] == "mug_003"
    assert catalogue.find("cabinet_039") == ("cabinet", 39)
    rows = list(catalogue.CATALOGUE.values())
    rigid = [row for row in rows if row.object_type != "articulated"]
    assert len(rigid) == 56 and sum(row.instances for row in rigid) == 2936
    assert sum(row.instances for row in rows) == 2936 + 100
    assert len(set(dict(catalogue.entries()))) == 3036


def test_one_in_five_is_for_testing():
    for row in catalogue.CATALOGUE.values():
        splits = [row.split(index) for index in range(row.instances)]
        assert splits.count("test") == row.instances // 5
        assert splits[:6] == ["train", "train", "train", "train", "test", "train"]


@pytest.mark.sample(12)
@pytest.mark.parametrize("row", catalogue.CATALOGUE.values(), ids=lambda row: row.name)
def test_rows_say_what_their_generators_make(row):
    label = catalogue.generate(row.name, 1).label
    assert label.object_type == row.object_type
    assert row.size[0] <= label.extents.max() <= row.size[1]
    turns, axial = len(label.symmetry.rotations), label.symmetry.axial
    expected = {
        "axis": (1, True),
        "axis and flip": (2, True),
        "none": (1, False),
        "half turn": (2, False),
        "three half turns": (4, False),
    }
    assert row.symmetry == "varies" or (turns, axial) == expected[row.symmetry]


@pytest.mark.sample(2)
@pytest.mark.parametrize("category", CATEGORIES)
def test_every_category_loads_and_its_model_compiles(category):
    asset = catalogue.load(category)
    assert asset.name == f"{category}_000" and asset.category == category
    assert asset.label.object_type == catalogue.CATALOGUE[category].object_type
    assert asset.up == pytest.approx([0, 0, 1])
    model = mujoco.MjModel.from_xml_path(str(asset.model_path))
    assert model.nbody == 2 + len(asset.parts)
    if category == "cabinet":
        assert asset.kind == "articulated" and asset.stable_poses == ()
        assert [part.name for part in asset.parts] == [
            "bottom_drawer",
            "middle_drawer",
            "top_drawer",
            "door",
        ]
    else:
        assert sum(pose.probability for pose in asset.stable_poses) == pytest.approx(1, abs=1e-3)
        assert len(asset.grasps) > 20 and asset.grasps.clear.any()
        # It can stand upright; for a box, either way up.
        upright = [abs(pose.rotation[2, 2]) > 0.999 for pose in asset.stable_poses]
        assert any(upright)


def test_second_load_reads_the_cache():
    folder = catalogue.load("box").folder
    before = (folder / "asset.json").stat().st_mtime_ns
    assert catalogue.load_by_name("box_000").folder == folder
    assert (folder / "asset.json").stat().st_mtime_ns == before


@pytest.mark.parametrize("category", ["box", "cabinet"])
def test_same_index_gives_identical_bytes(category, tmp_path):
    again = instance.build(category, 1, tmp_path / f"{category}_001")
    assert contents(again.folder) == contents(catalogue.load(category, 1).folder)


def test_two_indices_differ(tmp_path):
    first, second = catalogue.load("cabinet", 0), catalogue.load("cabinet", 1)
    assert not np.allclose(first.label.extents, second.label.extents, atol=1e-3)


def start_loading(root: Path, name: str, hash_seed: str) -> subprocess.Popen:
    code = (
        f"from manipose_mj.assets import catalogue; print(catalogue.load_by_name({name!r}).folder)"
    )
    environment = {
        **os.environ,
        catalogue.CACHE_VARIABLE: str(root),
        "PYTHONHASHSEED": hash_seed,
        "MUJOCO_GL": "disable",
    }
    return subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True
    )


@pytest.mark.full
def test_fresh_processes_agree_and_may_build_the_same_at_once(tmp_path):
    """Two share a cache and start together; the third is alone; hash seeds differ."""
    roots = (tmp_path / "shared", tmp_path / "shared", tmp_path / "alone")
    processes = [start_loading(root, "box_001", str(i)) for i, root in enumerate(roots)]
    folders = [Path(process.communicate(timeout=120)[0].strip()) for process in processes]
    assert all(process.returncode == 0 for process in processes)
    assert folders[0] == folders[1] != folders[2]
    assert contents(folders[0]) == contents(folders[2])
    assert sorted(path.name for path in folders[0].parent.iterdir()) == ["box_001"]


def test_losing_the_race_keeps_the_winners_folder(monkeypatch, cache_root):
    folder = catalogue.cached("cabinet", 5)
    real_build = instance.build

    def overtaken(category, index, staging):
        real_build(category, index, folder)
        return real_build(category, index, staging)

    monkeypatch.setattr(instance, "build", overtaken)
    assert catalogue.load("cabinet", 5).folder == folder
    assert not [path for path in folder.parent.iterdir() if path.name.startswith(".")]


def test_misspelt_names_get_the_nearest():
    with pytest.raises(InputError, match="unknown category 'mugg'; did you mean mug"):
        catalogue.load("mugg")
    with pytest.raises(InputError, match="unknown category"):
        catalogue.instances("spon")
    with pytest.raises(InputError, match="unknown built-in object 'mug_03'; did you mean mug_0"):
        catalogue.load_by_name("mug_03")
    with pytest.raises(InputError, match="no mug with index 60; the catalogue has 0 to 51"):
        catalogue.load("mug", 60)


def test_unwritable_cache_is_named(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv(catalogue.CACHE_VARIABLE, str(blocked))
    with pytest.raises(InputError, match=f"cannot write the catalogue's cache {blocked}"):
        catalogue.load("cabinet")


def test_cache_folder_follows_the_code():
    mug = catalogue.CATALOGUE["mug"].module
    names = {path.name for path in sources(("asset_pipeline.catalogue.instance", mug))}
    assert {"mug.py", "solids.py", "emit.py", "sampler.py", "label.py", "poses.py"} <= names
    assert not {"data_set.py", "bowl.py"} & names
    mass = ("asset_pipeline.geometry.mass",)
    assert len(source_hash(mass)) == 12 and source_hash(mass) != source_hash(mass, "1.0")
    assert categories.cache_folder("mug") != categories.cache_folder("bowl")
