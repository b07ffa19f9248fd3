"""Scenes of furniture: points and labels agree, and batches are the same every time."""

from __future__ import annotations

import shutil
from dataclasses import replace

import jax
import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.articulated.body_frame import BODY_IN_LABEL
from manipose_mj.ppf_jax.data.articulated.assets import asset_scenes
from manipose_mj.ppf_jax.data.articulated.cache import (
    furniture_scenes,
    furniture_stream,
    parallel_furniture_stream,
)
from manipose_mj.ppf_jax.data.articulated.clouds import (
    FurnitureScene,
    fused_cloud,
    handle_poses,
)
from manipose_mj.ppf_jax.data.articulated.views import FurnitureSetting, render_furniture


def test_labels_move_with_their_parts(cabinet):
    drawer, door = cabinet.joints[0], cabinet.joints[-1]
    assert not drawer.hinge and door.hinge
    out = drawer.motion(0.2) @ drawer.handle
    np.testing.assert_allclose(out[:3, 3] - drawer.handle[:3, 3], 0.2 * drawer.axis, atol=1e-9)
    turned = door.motion(0.7) @ door.handle
    assert np.arccos(turned[:3, 1] @ door.handle[:3, 1]) == pytest.approx(0.7, abs=1e-6)
    # Opening leads away from the body, whose front is towards -x.
    assert turned[0, 3] < door.handle[0, 3]


def test_points_on_handles_are_where_handles_are(cabinet):
    openings = np.array([0.1, 0.0, 0.05, 0.4])
    rng = np.random.default_rng(0)
    setting = FurnitureSetting(image_heights=(240,), all_shut=0.0, shut=0.0)
    view = render_furniture(cabinet, openings, setting, rng)
    assert view.handle.any() and (view.part[view.handle] >= 0).all()
    scene = FurnitureScene("a/0", "cabinet", cabinet.label.pose, cabinet.joints, openings, (view,))
    cloud = fused_cloud(scene, [0])
    for i, pose in enumerate(handle_poses(cloud)):
        own = cloud.points[cloud.handle & (cloud.part == i)]
        if len(own):
            within = np.linalg.norm(own - pose[:3, 3], axis=1)
            assert within.max() < 0.5 * np.linalg.norm(cabinet.joints[i].handle_extents) + 0.02
    assert (np.sum(view.normals * view.points, axis=1) < 0.01).mean() > 0.98


def test_fused_views_agree(scene):
    """Points of two cameras lie on the same handles once they are in one frame."""
    cloud = fused_cloud(scene, [0, 1, 2])
    assert len(cloud.points) > len(scene.views[0].points)
    poses = handle_poses(cloud)
    for i in range(len(poses)):
        own = cloud.points[cloud.handle & (cloud.part == i)]
        reach = 0.5 * np.linalg.norm(scene.joints[i].handle_extents) + 0.02
        assert not len(own) or np.linalg.norm(own - poses[i, :3, 3], axis=1).max() < reach


@pytest.mark.full
def test_batches_are_the_same_whoever_makes_them(tmp_path, monkeypatch):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    objects = [("microwave", 0)]
    scenes = furniture_scenes(objects, "training", scenes=2)
    others = [replace(scene, name=f"built/{i}") for i, scene in enumerate(scenes)]
    alone = furniture_stream([*scenes, *others], 2, seed=3)(5)
    helped = parallel_furniture_stream(
        objects, "training", scenes=2, batch=2, seed=3, jobs=2, others=others
    )(5)
    for _ in range(9):  # more than are made ahead
        jax.tree.map(np.testing.assert_array_equal, next(alone), next(helped))


def test_body_columns_are_front_up_and_side(cabinet):
    rotation = cabinet.label.rotation @ BODY_IN_LABEL
    np.testing.assert_allclose(rotation[:, 0], [-1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(rotation[:, 1], [0, 0, 1], atol=1e-6)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_scenes_of_built_furniture_are_of_the_named_pieces(tmp_path):
    for name in ("microwave_000", "microwave_001"):
        shutil.copytree(catalogue.load_by_name(name).folder, tmp_path / name)
    (named,) = {
        s.name.split("/")[0]
        for s in asset_scenes(tmp_path, "front", scenes=1, only=["microwave_001"])
    }
    assert named == "microwave_001"
    assert len(asset_scenes(tmp_path, "front", scenes=1)) == 2
    with pytest.raises(InputError, match="did you mean microwave_001"):
        asset_scenes(tmp_path, "front", scenes=1, only=["microwave_01"])
