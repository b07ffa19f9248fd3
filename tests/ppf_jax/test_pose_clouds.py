"""The clouds of a training: of the catalogue, and of built assets besides."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

from asset_pipeline.build.emit import write_asset
from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, Provenance
from manipose_mj.cli.pose.clouds import PoseClouds
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry, common_symmetry

AXIAL = CommonSymmetry(axial=True)


def write(directory, name, category, symmetry=None):
    specimen = catalogue.generate(category, 0)
    label = specimen.label if symmetry is None else replace(specimen.label, symmetry=symmetry)
    asset = Asset(
        folder=directory / name,
        name=name,
        kind="rigid",
        category=category,
        label=label,
        up=np.array([0.0, 0.0, 1.0]),
        mass_properties=specimen.bodies[0].mass_properties,
        stable_poses=(),
        provenance=Provenance(source="test", item=category, licence="Apache-2.0", inputs={}),
    )
    write_asset(asset, specimen.bodies)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    directory = tmp_path_factory.mktemp("assets")
    write(directory, "round", "cup")
    write(directory, "bent", "cup", SymmetryGroup.identity())
    write(directory, "sheet", "razor")
    return directory


def test_assets_of_a_type_join_where_they_are_as_symmetric_as_the_catalogue_s(folder, caplog):
    with caplog.at_level(logging.WARNING):
        clouds = PoseClouds("axial").of_assets([folder], "training", 3, AXIAL)
    assert [cloud.name for cloud in clouds] == [f"round/{i}" for i in range(3)]
    assert "bent: less symmetric than what is trained, left out" in caplog.text
    assert common_symmetry(cloud.symmetry for cloud in clouds).axial


def test_all_join_where_nothing_is_assumed(folder):
    clouds = PoseClouds("cup").of_assets([folder], "training", 2, CommonSymmetry())
    assert {cloud.name.split("/")[0] for cloud in clouds} == {"round", "bent"}
    assert PoseClouds("cup").of_assets([], "training", 2, CommonSymmetry()) == []


def test_what_cannot_be_trained_is_named(folder, tmp_path):
    with pytest.raises(InputError, match="no rigid asset of category or type 'mirror'"):
        PoseClouds("mirror").of_assets([folder], "training", 2, CommonSymmetry())
    with pytest.raises(InputError, match="no asset has the symmetry of the catalogue's functional"):
        PoseClouds("functional").of_assets([folder], "training", 2, AXIAL)
    with pytest.raises(InputError, match="leave out --labels original or --assets"):
        PoseClouds("cup", labels="original").of_assets([folder], "training", 2, AXIAL)
