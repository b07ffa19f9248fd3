"""A protocol's list of scans that users build: who has them all plays it, who lacks some is told which."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.protocol import frozen, own_assets
from manipose_mj.evaluation.protocol.freeze import document_of_assets, pool_for
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import task_spec
from manipose_mj.tasks.core.scene_source import SceneSource

REAL = json.loads(frozen.protocol_path("v1-real").read_text(encoding="utf-8"))
TASK = "single_object/target_pose"
DRAWN = "articulated/open_microwave"


def _stated(folder: Path, name: str, source: str = "YCB, google_16k", made: str = "a") -> Path:
    """As much of an asset folder as says what it is."""
    (folder / name).mkdir(parents=True)
    document = {"name": name, "provenance": {"source": source, "inputs": {"mesh.obj": made}}}
    (folder / name / "asset.json").write_text(json.dumps(document), encoding="utf-8")
    return folder / name


@pytest.fixture
def listed(monkeypatch, tmp_path):
    """A version of two objects, in whose place it is loaded."""
    entry = {"seed": 1, "object": "mug", "objects": ["mug"]}
    content = {
        "version": "v1-real",
        "assets": {"ycb": ["mug"], "partnet_mobility": ["101"]},
        "tasks": {
            TASK: {**REAL["tasks"][TASK], "pool": ["mug"], "episodes": [entry]},
            DRAWN: {**REAL["tasks"][DRAWN], "pool": ["101"], "episodes": [entry]},
        },
    }
    path = tmp_path / "list.json"
    path.write_text(json.dumps({**content, "sha256": frozen.digest(content)}), encoding="utf-8")
    monkeypatch.setattr(frozen, "protocol_path", lambda version: path)
    known = frozen.load.__wrapped__("v1-real")
    for module in (frozen, own_assets, protocol):
        monkeypatch.setattr(module, "load", lambda version: known)
    own_assets._found.cache_clear()
    yield known
    own_assets._found.cache_clear()


def test_the_list_states_its_hash_and_50_different_seeds_of_each_task():
    loaded = protocol.load("v1-real")
    assert loaded.sha256 == frozen.digest(REAL) == REAL["sha256"]
    for name, task in loaded.tasks.items():
        assert len(set(task.seeds.values())) == len(task.episodes) == 50
        assert not set(task.seeds.values()) & set(protocol.load("v1").task(name).seeds.values())
        assert set(task.objects) <= set(task.pool) <= set(loaded.sources)


def test_the_list_names_objects_of_three_data_sets_and_holds_nothing_else_of_them():
    assert set(REAL["assets"]) == set(own_assets.PROVENANCE)
    assert {type(name) for names in REAL["assets"].values() for name in names} == {str}
    used = {name for task in REAL["tasks"].values() for name in task["pool"]}
    assert used == {name for names in REAL["assets"].values() for name in names}


def test_what_is_missing_is_named_in_one_line_with_the_way_to_it(listed, tmp_path):
    _stated(tmp_path / "scans" / "ycb", "mug")
    with pytest.raises(InputError, match="lacks 1 of 2 objects") as caught:
        own_assets.find_assets("v1-real", (TASK, DRAWN), [tmp_path / "scans"])
    assert "manipose assets build partnet_mobility PATH --out DIR --only 101`" in str(caught.value)
    assert "\n" not in str(caught.value)
    # Who only plays what has all its objects needs no others.
    found = own_assets.find_assets("v1-real", (TASK,), [tmp_path / "scans"])
    assert {name: asset.folder.parent.name for name, asset in found.items()} == {"mug": "ycb"}


def test_a_name_of_another_data_set_is_another_object(listed, tmp_path):
    _stated(tmp_path, "mug", "own mesh")
    with pytest.raises(InputError, match="lacks 1 of 1 objects"):
        own_assets.find_assets("v1-real", (TASK,), [tmp_path])


def test_the_same_object_twice_is_refused(listed, tmp_path):
    for folder in ("a", "b"):
        _stated(tmp_path / folder, "mug")
    with pytest.raises(InputError, match="the same object as"):
        own_assets.find_assets("v1-real", (TASK,), [tmp_path])


def test_an_evaluation_names_list_and_build_and_plays_with_the_users_folders(listed, tmp_path):
    folder = _stated(tmp_path / "scans", "mug")
    config = EvaluationConfig(
        (TASK,), tmp_path / "out", 1, protocol="v1-real", assets=(str(tmp_path / "scans"),)
    )
    assert config.env_config(TASK).objects == (str(folder),)
    assert config.identity["protocol sha256"] == listed.sha256
    assert f"--protocol v1-real --assets {tmp_path / 'scans'}" in config.command
    _stated(tmp_path / "others", "mug", made="b")
    other = replace(config, assets=(str(tmp_path / "others"),))
    assert config.identity["assets sha256"] != other.identity["assets sha256"]


def test_nothing_is_written_where_objects_are_missing(listed, tmp_path):
    with pytest.raises(InputError, match="--assets, which is not given, lacks 1 of 1 objects"):
        evaluate(EvaluationConfig((TASK,), tmp_path / "out", 1, protocol="v1-real"))
    assert not (tmp_path / "out").exists()


def test_folders_without_such_a_protocol_are_refused(tmp_path):
    for version in (None, "v1"):
        with pytest.raises(InputError, match="--assets"):
            EvaluationConfig((TASK,), tmp_path, 1, protocol=version, assets=(str(tmp_path),))


def test_a_frozen_list_draws_the_same_objects_from_other_folders(tmp_path):
    """Built-in objects play the part of scans."""
    for name, source, data_set in (
        ("mug_000", "YCB, google_16k", "ycb"),
        ("box_000", "Google Scanned Objects", "gso"),
    ):
        asset = catalogue.load_by_name(name)
        for place in ("first", "second"):
            copy = tmp_path / place / data_set / name
            shutil.copytree(asset.folder, copy)
            document = json.loads((copy / "asset.json").read_text(encoding="utf-8"))
            document["provenance"]["source"] = source
            (copy / "asset.json").write_text(json.dumps(document), encoding="utf-8")
    content = document_of_assets("v1-real", own_assets.built_assets([tmp_path / "first"]))
    assert content["assets"] == {"google_scanned_objects": ["box_000"], "ycb": ["mug_000"]}
    assert not [name for name in content["tasks"] if name.startswith("articulated")]
    spec = task_spec("single_object", "target_pose")
    entries = content["tasks"][TASK]["episodes"]
    assert {entry["object"] for entry in entries} == {"box_000", "mug_000"}
    elsewhere = [read_asset(tmp_path / "second" / p) for p in ("gso/box_000", "ycb/mug_000")]
    config = EvaluationConfig((TASK,), tmp_path).env_config(TASK)
    scenes = SceneSource(spec, replace(config, objects=pool_for(spec, elsewhere)))
    for entry in entries[:4]:
        asked = EpisodeSpec(seed=entry["seed"], object=entry["object"])
        drawn = scenes.draw(np.random.RandomState(entry["seed"]), asked)
        assert [asset.name for asset in drawn.assets] == entry["objects"]


def test_the_data_sets_furniture_of_a_task_is_what_it_draws_with_a_users():
    """Nothing that is frozen is left out by the preference for kinds."""
    cabinet = catalogue.load("cabinet", 0)
    scans = [
        replace(cabinet, name=name, category=name)
        for name in ("cabinet", "table", "refrigerator", "microwave", "oven", "dishwasher", "safe")
    ]
    for task in (name for name in REAL["tasks"] if name.startswith("articulated/open")):
        spec = task_spec(*task.split("/"))
        pool = {asset.name for asset in pool_for(spec, scans)}
        groups = SceneSource(spec, EnvConfig(task, objects=scans)).strata()
        assert {each.furniture for group in groups for each in group} == pool
