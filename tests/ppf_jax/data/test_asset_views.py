"""Built assets are seen as they were written."""

from __future__ import annotations

import numpy as np
import pytest

from asset_pipeline.build.emit import write_asset
from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, Provenance
from manipose_mj.errors import InputError
from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.data.asset_views import asset_clouds
from manipose_mj.ppf_jax.data.view_settings import ViewSetting, view_setting
from manipose_mj.ppf_jax.data.view_stream import asset_views

QUICK = ViewSetting("quick", "anywhere", image_heights=(240,), bleed=0.0, sensor=None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    directory = tmp_path_factory.mktemp("assets")
    for category in ("razor", "box"):
        specimen = catalogue.generate(category, 0)
        asset = Asset(
            folder=directory / f"{category}_000",
            name=f"{category}_000",
            kind="rigid",
            category=category,
            label=specimen.label,
            up=np.array([0.0, 0.0, 1.0]),
            mass_properties=specimen.bodies[0].mass_properties,
            stable_poses=(),
            provenance=Provenance(source="test", item=category, licence="Apache-2.0", inputs={}),
        )
        write_asset(asset, specimen.bodies)
    return directory


@pytest.mark.parametrize("name", ["razor", "functional"])
def test_assets_of_a_category_or_a_type_are_seen(folder, name):
    clouds = asset_clouds(folder, name, QUICK, views=3)
    assert [cloud.name for cloud in clouds] == [f"razor_000/{i}" for i in range(3)]
    specimen = catalogue.generate("razor", 0)
    vertices = np.asarray(specimen.bodies[0].surface().vertices)
    bounds = transform(invert(specimen.label.pose), vertices)
    for cloud in clouds:
        own = transform(invert(cloud.pose), cloud.points)
        assert (own > bounds.min(axis=0) - 1e-3).all() and (own < bounds.max(axis=0) + 1e-3).all()


def test_whole_images_of_assets_are_those_of_their_clouds(folder):
    clouds = asset_clouds(folder, "razor", QUICK, views=2)
    for seen, cloud in zip(asset_views(folder, "razor", QUICK, 2), clouds, strict=True):
        np.testing.assert_array_equal(seen.cloud.points, cloud.points)
        assert seen.picture.rgb[seen.picture.visible].max() > 60


def test_what_is_not_there_is_named(folder):
    with pytest.raises(InputError, match="no rigid asset of category or type 'mug'"):
        asset_clouds(folder, "mug", QUICK, views=1)
    with pytest.raises(InputError, match="razor_000: setting 'resting' needs its resting poses"):
        asset_clouds(folder, "razor", view_setting("resting"), views=1)
