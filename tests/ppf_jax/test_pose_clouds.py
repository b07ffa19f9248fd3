"""The clouds of a training: of the catalogue, and of built assets besides."""

from __future__ import annotations

import json
import logging

import numpy as np
import pytest

from manipose_mj.cli.pose.clouds import PoseClouds
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.data.view_cache import VIEWS_PER_FILE
from manipose_mj.ppf_jax.points.cloud_files import INDEX, write_clouds
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry, common_symmetry
from tests.ppf_jax.catalogue_assets import write_asset

AXIAL = CommonSymmetry(axial=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    directory = tmp_path_factory.mktemp("assets")
    write_asset(directory, "round", "cup")
    write_asset(directory, "bent", "cup", SymmetryGroup.identity())
    write_asset(directory, "sheet", "razor")
    return directory


def names(clouds):
    return {cloud.name.split("/")[0] for cloud in clouds}


def test_assets_of_a_type_join_where_they_are_as_symmetric_as_the_catalogue_s(folder, caplog):
    source = PoseClouds("axial")
    with caplog.at_level(logging.WARNING):
        assets = source.fitting_assets([folder], AXIAL)
    clouds = source.of_assets(assets, "anywhere", 3)
    assert [cloud.name for cloud in clouds] == [f"round/{i}" for i in range(3)]
    assert "bent: less symmetric than what is trained, left out" in caplog.text
    assert common_symmetry(cloud.symmetry for cloud in clouds).axial


def test_all_join_where_nothing_is_assumed(folder):
    source = PoseClouds("cup")
    assets = source.fitting_assets([folder], CommonSymmetry())
    assert names(source.of_assets(assets, "anywhere", 2)) == {"round", "bent"}
    assert source.fitting_assets([], CommonSymmetry()) == ()


def test_training_tapers_assets_as_it_tapers_the_catalogue(folder):
    source = PoseClouds("cup")
    (asset,) = (a for a in source.fitting_assets([folder], CommonSymmetry()) if a.name == "round")
    as_it_is = source.of_assets([asset], "anywhere", 1)
    drawn = source.of_assets([asset], "training", VIEWS_PER_FILE + 1)
    extents = {tuple(cloud.extents) for cloud in drawn}
    assert len(extents) == 2
    assert tuple(as_it_is[0].extents) not in extents
    # It is as high as it was.
    assert {x for x, *_ in extents} == {as_it_is[0].extents[0]}


def test_objects_are_made_of_an_asset_and_another(folder):
    source = PoseClouds("cup")
    assets = source.fitting_assets([folder], CommonSymmetry())
    clouds = source.part_swapped_assets(assets, 2)
    assert names(clouds) == {"asset_part_swap_00000", "asset_part_swap_00001"}
    assert len(clouds) == 2 * VIEWS_PER_FILE
    again = source.part_swapped_assets(assets, 1)
    np.testing.assert_array_equal(again[0].points, clouds[0].points)
    assert source.part_swapped_assets(assets, 0) == []
    with pytest.raises(InputError, match="name some with --assets"):
        source.part_swapped_assets((), 1)


def test_what_cannot_be_trained_is_named(folder, tmp_path):
    with pytest.raises(InputError, match="no rigid asset of category or type 'mirror'"):
        PoseClouds("mirror").fitting_assets([folder], CommonSymmetry())
    with pytest.raises(InputError, match="no asset has the symmetry of the catalogue's functional"):
        PoseClouds("functional").fitting_assets([folder], AXIAL)
    with pytest.raises(InputError, match="leave out --labels original or --assets"):
        PoseClouds("cup", labels="original").fitting_assets([folder], AXIAL)


def test_assets_of_categories_that_are_left_out_do_not_join(folder, tmp_path):
    write_asset(tmp_path, "round", "cup")
    write_asset(tmp_path, "shallow", "bowl")
    source = PoseClouds("axial", leave_out=["cup"])
    assert [asset.name for asset in source.fitting_assets([tmp_path], AXIAL)] == ["shallow"]
    with pytest.raises(InputError, match="--leave-out leaves no asset of axial"):
        source.fitting_assets([folder], AXIAL)


def view(category):
    rows = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32)
    pose, extents = np.eye(4, dtype=np.float32), np.ones(3, np.float32)
    return LabelledCloud(rows, rows, pose, extents, SymmetryGroup.about_x(), "a/0", category)


@pytest.fixture
def scans(tmp_path):
    index = {"one": ["cup", "axial"], "two": ["bowl", "axial"], "three": ["flask", "axial"]}
    for name, (category, _) in index.items():
        write_clouds(tmp_path / f"{name}.npz", [view(category)])
    (tmp_path / INDEX).write_text(json.dumps(index))
    return tmp_path


def test_scans_of_categories_that_are_left_out_do_not_join(scans):
    source = PoseClouds("axial", leave_out=["cup"])
    assert names(source.of_scans([scans], AXIAL)) == {"two", "three"}
    assert names(PoseClouds("axial").of_scans([scans], AXIAL)) == {"one", "two", "three"}
    assert PoseClouds("mug").of_scans([], AXIAL) == []


def test_scans_of_which_none_can_be_trained_on_are_named(scans):
    with pytest.raises(InputError, match="none of 3 scans is of mug"):
        PoseClouds("mug").of_scans([scans], CommonSymmetry())
    with pytest.raises(InputError, match="leave out --labels original or --scan-views"):
        PoseClouds("cup", labels="original").of_scans([scans], AXIAL)


@pytest.mark.parametrize("index", ["[1]", '{"one": "cup"}', '{"one": ["cup", 1]}'])
def test_an_index_that_is_none_is_named(scans, index):
    (scans / INDEX).write_text(index)
    with pytest.raises(InputError, match="scans.json: expected a dictionary of scans"):
        PoseClouds("cup").of_scans([scans], AXIAL)


def test_views_that_are_damaged_or_missing_are_named(scans):
    whole = (scans / "two.npz").read_bytes()
    (scans / "two.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="two.npz: not a whole file of views"):
        PoseClouds("cup").of_scans([scans], AXIAL)
    (scans / "two.npz").unlink()
    with pytest.raises(InputError, match="two.npz: missing, though scans.json names it"):
        PoseClouds("cup").of_scans([scans], AXIAL)
