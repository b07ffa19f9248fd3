"""Whole images are those that clouds come from."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data import view_cache
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.data.view_stream import catalogue_views, split_indices


def test_views_are_those_of_the_cached_clouds(monkeypatch, tmp_path):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    monkeypatch.setattr(view_cache, "VIEWS_PER_FILE", 2)
    monkeypatch.setattr("manipose_mj.ppf_jax.data.view_stream.VIEWS_PER_FILE", 2)
    setting = view_setting("occluded")
    view_cache._fill("mug", 4, setting, 3)
    kept = view_cache._read("mug", 4, setting, 3)
    for seen, cloud in zip(catalogue_views("mug", 4, setting, 3), kept, strict=True):
        np.testing.assert_array_equal(seen.cloud.points, cloud.points)
        np.testing.assert_array_equal(seen.cloud.pose, cloud.pose)
        assert seen.cloud.name == cloud.name
        np.testing.assert_allclose(seen.T_camera_label, cloud.pose, atol=1e-6)


def test_every_point_is_a_pixel_of_the_mask_at_its_depth():
    for seen in catalogue_views("mug", 4, view_setting("tasks"), 2):
        own, points = seen.picture, seen.cloud.points.astype(float)
        image = points @ own.intrinsics.matrix.T
        u, v = np.round(image[:, :2] / image[:, 2:]).astype(int).T
        assert own.mask[v, u].all()
        np.testing.assert_allclose(own.depth[v, u], points[:, 2], atol=1e-6)
        assert own.rgb.shape == (480, 640, 3) and (own.silhouette >= own.visible).all()
        around = ~own.mask & (own.depth > 0)
        assert around.mean() > 0.3  # the table


def test_settings_that_change_shapes_are_refused():
    with pytest.raises(InputError, match="wider and narrower"):
        next(catalogue_views("mug", 4, view_setting("training"), 1))


def test_test_objects_are_every_fifth():
    assert split_indices("mug", "test") == list(range(4, 52, 5))
