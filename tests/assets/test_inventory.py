"""Lists and counts of assets, with and without a folder, and the audit that is published with them."""

from __future__ import annotations

import json
import shutil

import pytest

from asset_pipeline.catalogue import instance as catalogue_objects
from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import MIN_HELD
from manipose_mj.assets.inventory import (
    Filter,
    audited_grasps,
    built_in,
    in_folder,
    select,
    statistics,
)
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError


def test_the_catalogue_is_as_large_as_the_papers():
    counts = statistics(built_in())
    assert (counts["rigid"], counts["articulated"]) == (2936, 100)
    assert len(counts["categories"]) == 59
    graspable = sum(row["graspable"] for row in counts["categories"].values())
    assert graspable >= 0.85 * 3036


def test_filters_meet_every_condition():
    rows = built_in()
    chosen = select(rows, Filter(type="functional", split="test", graspable=True))
    assert {e.type for e in chosen} == {"functional"} and {e.split for e in chosen} == {"test"}
    mugs = select(rows, Filter(category="mug", source="PROCEDURAL"))
    assert [e.name for e in mugs] == list(catalogue.instances("mug"))
    assert not select(rows, Filter(source="YCB"))


def test_unknown_values_get_the_nearest():
    with pytest.raises(InputError, match="unknown category 'mugg'; did you mean mug"):
        select(built_in(), Filter(category="mugg"))
    with pytest.raises(InputError, match="unknown split 'tests'; did you mean test"):
        select(built_in(), Filter(split="tests"))


def test_statistics_for_scripts(capsys):
    assert main(["assets", "stats", "--json", "--category", "hammer"]) == 0
    counts = json.loads(capsys.readouterr().out)
    assert counts["categories"]["hammer"]["type"] == "functional"
    assert counts["categories"]["hammer"]["instances"] == 52


# One of each labelling rule; the audit must say what a build finds.
@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("category", "index"), [("pear", 9), ("teapot", 17), ("fork", 30), ("trash_bin", 2)]
)
def test_published_audit_is_what_a_build_finds(category, index, tmp_path):
    asset = catalogue_objects.build(category, index, tmp_path / f"{category}_{index:03d}")
    assert asset.grasps is not None
    # Contacts differ in their last digits between processors, so single grasps may.
    assert asset.graspable == (audited_grasps(category, index) >= MIN_HELD)
    (entry,) = in_folder(tmp_path)
    assert entry in select(built_in(), Filter(category=category))


def test_objects_beyond_the_catalogue_are_of_no_split(tmp_path, monkeypatch):
    folder = catalogue.load("box").folder
    shutil.copytree(folder, tmp_path / "box_999")
    path = tmp_path / "box_999" / "asset.json"
    path.write_text(path.read_text().replace("box_000", "box_999"))
    (entry,) = in_folder(tmp_path)
    assert entry.name == "box_999" and entry.split is None
