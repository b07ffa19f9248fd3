"""Rendered clouds lie on the object, look at the camera, and are the same ones every time."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_erosion

from manipose_mj.assets import catalogue
from manipose_mj.assets.label import PoseLabel
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.depth_normals import depth_normals
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics, image_rays
from manipose_mj.mjcf.cameras.ray_casting import cast_rays
from manipose_mj.poses import SymmetryGroup, compose, invert, quaternion_to_rotation, transform
from manipose_mj.ppf_jax.data import view_cache
from manipose_mj.ppf_jax.data.occlusion import Occluder
from manipose_mj.ppf_jax.data.rasteriser import Triangles, rasterise
from manipose_mj.ppf_jax.data.rendering import Subject, render_clouds, render_view
from manipose_mj.ppf_jax.data.view_cache import batch_stream, catalogue_clouds, catalogue_subject
from manipose_mj.ppf_jax.data.view_settings import SETTINGS, ViewSetting, view_setting
from manipose_mj.ppf_jax.points.cloud_files import read_clouds, write_clouds
from manipose_mj.ppf_jax.points.clouds import MAX_POINTS, LabelledCloud, batch_clouds
from manipose_mj.storage.cache_root import CACHE_VARIABLE

QUICK = ViewSetting("quick", "anywhere", image_heights=(120,))


@pytest.fixture(scope="module")
def mug() -> Subject:
    return catalogue_subject("mug", 4, resting=True)


@pytest.fixture(scope="module")
def bowl() -> Subject:
    return catalogue_subject("bowl", 4, resting=False)


def cloud(points: int, group: SymmetryGroup, name: str = "thing_000/0") -> LabelledCloud:
    rng = np.random.default_rng(points)
    xyz = rng.standard_normal((points, 3)).astype(np.float32)
    pose, extents = np.eye(4, dtype=np.float32), np.ones(3, np.float32)
    return LabelledCloud(xyz, xyz, pose, extents, group, name, "object")


@pytest.mark.parametrize("category", ["mug", "toy_car"])
def test_the_rasteriser_sees_what_rays_see(category):
    mesh = catalogue.generate(category, 1).bodies[0].surface()
    spec = mujoco.MjSpec()
    shape = spec.add_mesh(name="shape")
    shape.uservert = np.asarray(mesh.vertices).ravel()
    shape.userface = np.asarray(mesh.faces, np.int32).ravel()
    shape.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    body = spec.worldbody.add_body(mocap=True)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="shape")
    model = spec.compile()
    data = mujoco.MjData(model)
    camera = Intrinsics(101, 91, 300.0, 310.0, 47.3, 44.8)
    for quaternion in np.random.default_rng(0).standard_normal((3, 4)):
        pose = compose(quaternion_to_rotation(quaternion), np.array([0.01, -0.02, 0.6]))
        # MuJoCo moves a mesh to its own principal frame; the body's pose is what counts.
        data.mocap_pos[0], data.mocap_quat[0] = pose[:3, 3], quaternion
        mujoco.mj_kinematics(model, data)
        hits = cast_rays(model, data, np.eye(4), image_rays(camera))
        drawn = rasterise([(Triangles.of_mesh(mesh), pose)], camera)
        requested = np.maximum(hits.scale, 0).reshape(drawn.depth.shape)
        seen = (requested > 0) & (drawn.depth > 0)
        assert np.count_nonzero((requested > 0) != (drawn.depth > 0)) <= 2
        np.testing.assert_allclose(np.abs(requested - drawn.depth)[seen], 0, atol=1e-5)
        normal = hits.normal.reshape(drawn.normal.shape)[seen]
        assert np.median(np.sum(normal * drawn.normal[seen], axis=-1)) > 0.9999


def test_clean_points_lie_on_the_surface(mug):
    (seen,) = render_clouds(mug, view_setting("clean"), 1, np.random.default_rng(0))
    in_mesh = transform(mug.label.pose @ invert(seen.pose.astype(float)), seen.points.astype(float))
    flat = mug.triangles.corners.reshape(-1, 3)
    mesh = trimesh.Trimesh(flat, np.arange(len(flat)).reshape(-1, 3), process=False)
    _, apart, _ = trimesh.proximity.closest_point(mesh, in_mesh[:200])
    assert apart.max() < 2e-5


@pytest.mark.parametrize("name", [n for n, s in SETTINGS.items() if s.cameras == (1, 1)])
def test_points_are_near_the_object_and_normals_face_the_camera(mug, name):
    clouds = render_clouds(mug, SETTINGS[name], 4, np.random.default_rng(1))
    for each in clouds:
        assert 32 <= len(each) <= MAX_POINTS
        assert each.points.dtype == each.normals.dtype == each.pose.dtype == np.float32
        np.testing.assert_allclose(np.linalg.norm(each.normals, axis=1), 1, atol=1e-5)
        assert (np.sum(each.normals * each.points, axis=1) < 1e-6).all()
        inside = np.abs(transform(invert(each.pose), each.points)) < each.extents / 2 + 0.01
        assert inside.all(axis=1).mean() > 0.8
        np.testing.assert_allclose(np.linalg.det(each.pose[:3, :3]), 1, atol=1e-5)


def test_anywhere_means_any_orientation_and_the_distances_it_says(bowl):
    clouds = render_clouds(bowl, QUICK, 150, np.random.default_rng(2))
    axes = np.stack([c.pose[:3, 0] for c in clouds])
    # Of uniform unit vectors: means within three deviations of 0, second moments of 1/3.
    assert np.abs(axes.mean(axis=0)).max() < 3 * np.sqrt(1 / 3 / 150)
    np.testing.assert_allclose(axes.T @ axes / 150, np.eye(3) / 3, atol=0.1)
    away = np.linalg.norm([c.pose[:3, 3] for c in clouds], axis=1)
    assert away.min() >= 0.5 - 1e-6 and away.max() <= 1.0 + 1e-6


def test_what_rests_stands_on_the_ground_that_the_camera_looks_down_on(mug):
    rng = np.random.default_rng(3)
    for _ in range(5):
        view = render_view(mug, view_setting("resting"), rng)
        ground = view.exact.item == 2
        assert ground.any()
        normal = view.exact.normal[ground][0]
        rows, columns = np.nonzero(ground)
        point = np.append(view.intrinsics.slopes()[rows[0], columns[0]], 1)
        point *= view.exact.depth[rows[0], columns[0]]
        heights = (transform(view.T_camera_mesh, mug.hull) - point) @ normal
        assert heights.min() == pytest.approx(0, abs=1e-3)
        assert (point @ normal) < 0  # the camera is above the plane


def test_something_in_front_hides_a_part(mug):
    setting = view_setting("occluded")
    hidden = 0
    for seed in range(6):
        view = render_view(mug, setting, np.random.default_rng(seed))
        hidden += (view.exact.item == 1).any()
        assert (view.exact.item == 0).any()
    assert hidden >= 5


def test_the_outline_bleeds_by_about_a_pixel(bowl):
    wrong = []
    for seed in range(5):
        view = render_view(bowl, view_setting("anywhere"), np.random.default_rng(seed))
        true = view.exact.item == 0
        outline = true ^ binary_erosion(true)
        wrong.append(np.count_nonzero(view.mask != true) / np.count_nonzero(outline))
    assert 0.1 < np.mean(wrong) < 1.0


def test_normals_of_a_noisy_plane():
    camera = Intrinsics(60, 60, 580.0, 580.0, 29.5, 29.5)
    normal = np.array([0.4, -0.3, -np.sqrt(0.75)])
    rays = np.concatenate([camera.slopes(), np.ones((60, 60, 1))], axis=-1)
    depth = 0.7 * normal[2] / (rays @ normal)
    noisy = depth + np.random.default_rng(0).normal(0, 0.0013, depth.shape)
    mask = np.ones(depth.shape, bool)
    pixels = np.argwhere(mask)
    exact = depth_normals(depth, mask, pixels, camera)
    assert np.degrees(np.arccos(np.clip(exact @ normal, -1, 1))).max() < 1.5
    found = depth_normals(noisy, mask, pixels, camera)
    assert np.degrees(np.arccos(np.clip(found @ normal, -1, 1))).mean() < 5


def test_a_lone_pixel_faces_the_camera():
    camera = Intrinsics(9, 9, 580.0, 580.0, 4.0, 4.0)
    depth = np.zeros((9, 9))
    depth[4, 4] = 0.5
    normal = depth_normals(depth, depth > 0, np.array([[4, 4]]), camera)
    np.testing.assert_allclose(normal, [[0, 0, -1]], atol=1e-6)


@pytest.mark.parametrize("name", ["several", "several_tasks"])
def test_what_several_cameras_see_is_one_cloud_of_points_seen_from_many_places(mug, name):
    clouds = render_clouds(mug, view_setting(name), 6, np.random.default_rng(0))
    again = render_clouds(mug, view_setting(name), 6, np.random.default_rng(0))
    flat = mug.triangles.corners.reshape(-1, 3)
    mesh = trimesh.Trimesh(flat, np.arange(len(flat)).reshape(-1, 3), process=False)
    counts = []
    for seen, same in zip(clouds, again, strict=True):
        assert seen.eyes is not None and len(seen.eyes) == len(seen) <= 7 * MAX_POINTS // 4
        np.testing.assert_array_equal(seen.points, same.points)
        counts.append(len(np.unique(seen.eyes, axis=0)))
        assert (np.sum(seen.normals * (seen.eyes - seen.points), axis=1) > 0).mean() > 0.99
        in_mesh = transform(
            mug.label.pose @ invert(seen.pose.astype(float)), seen.points.astype(float)
        )
        _, apart, _ = trimesh.proximity.closest_point(mesh, in_mesh[::8])
        assert np.median(apart) < 0.004
    assert max(counts) > 2


def test_eyes_are_kept_in_files_and_batches(mug, tmp_path):
    clouds = render_clouds(mug, view_setting("several"), 2, np.random.default_rng(0))
    write_clouds(tmp_path / "mug_004.npz", clouds)
    back = read_clouds(tmp_path / "mug_004.npz", "mug_004", "mug")
    for seen, same in zip(clouds, back, strict=True):
        np.testing.assert_array_equal(seen.eyes, same.eyes)
    batch = batch_clouds(back, rng=np.random.default_rng(0), points=512)
    rows = batch.mask[0]
    assert len(np.unique(batch.eyes[0][rows], axis=0)) == len(np.unique(clouds[0].eyes, axis=0))
    assert (
        np.sum(batch.normals * (batch.eyes - batch.points), axis=2)[batch.mask] > 0
    ).mean() > 0.99
    one = batch_clouds([cloud(40, SymmetryGroup.identity())], rng=np.random.default_rng(0))
    assert not one.eyes.any()


def test_an_object_in_millimetres_is_named():
    box = trimesh.creation.box(extents=(0.00005, 0.00008, 0.0001))
    label = PoseLabel(
        np.zeros(3), np.eye(3), "mirror", np.ptp(box.bounds, axis=0), SymmetryGroup.identity()
    )
    tiny = Subject.of_mesh(box, label, name="tiny", category="box")
    with pytest.raises(InputError, match="tiny: .* in metres"):
        render_clouds(tiny, QUICK, 1, np.random.default_rng(0))


def test_a_setting_with_a_table_needs_resting_poses(bowl):
    with pytest.raises(InputError, match="resting poses"):
        render_clouds(bowl, view_setting("resting"), 1, np.random.default_rng(0))


def test_an_unknown_setting_is_named():
    with pytest.raises(InputError, match="did you mean anywhere"):
        view_setting("anywere")


def test_occluders_have_unit_size():
    occluder = Occluder.random_box(np.random.default_rng(0))
    assert np.linalg.norm(occluder.triangles.corners, axis=-1).max() == pytest.approx(1)


def test_the_cache_gives_the_same_clouds_however_it_was_filled(monkeypatch, tmp_path):
    monkeypatch.setattr(view_cache, "VIEWS_PER_FILE", 2)
    found = []
    for folder, asked in (("one", (3,)), ("two", (1, 3))):
        monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / folder))
        for views in asked:
            clouds = catalogue_clouds("razor", "test", QUICK, views=views)
        found.append(clouds)
    assert [c.name for c in found[0]][:4] == [
        "razor_004/0",
        "razor_004/1",
        "razor_004/2",
        "razor_009/0",
    ]
    assert len({c.name for c in found[0]}) == len(found[0]) == 3 * 10
    for one, two in zip(*found, strict=True):
        np.testing.assert_array_equal(one.points, two.points)
        np.testing.assert_array_equal(one.normals, two.normals)
        np.testing.assert_array_equal(one.pose, two.pose)


def test_batches_pad_with_zeros_at_the_end():
    clouds = [cloud(300, SymmetryGroup.about_x()), cloud(40, SymmetryGroup.three_planes())]
    batch = batch_clouds(clouds, rng=np.random.default_rng(0))
    assert batch.points.shape == (2, 256, 3) and batch.symmetry.rotations.shape == (2, 4, 3, 3)
    assert batch.mask.sum(axis=1).tolist() == [256, 40]
    assert not batch.points[1, 40:].any() and batch.mask[1, :40].all()
    assert np.any(batch.symmetry.rotations != np.eye(3), axis=(2, 3)).sum(axis=1).tolist() == [0, 3]
    assert batch.symmetry.axial.tolist() == [True, False]
    # A sample is without repetition, and all of a small cloud.
    assert len(np.unique(batch.points[0], axis=0)) == 256
    assert {tuple(p) for p in batch.points[1, :40]} == {tuple(p) for p in clouds[1].points}


@pytest.mark.parametrize(
    ("clouds", "message"),
    [
        ([], "no clouds"),
        ([cloud(0, SymmetryGroup.identity())], "has no points"),
        ([cloud(40, SymmetryGroup.three_planes())], "4 members; the batch has room for 2"),
    ],
)
def test_what_cannot_be_batched_is_named(clouds, message):
    with pytest.raises(InputError, match=message):
        batch_clouds(clouds, rng=np.random.default_rng(0), members=2)


def test_a_stream_can_start_anywhere_and_shows_every_cloud_in_turn():
    clouds = [cloud(64 + i, SymmetryGroup.identity(), f"thing_000/{i}") for i in range(5)]
    stream = batch_stream(clouds, 2, seed=1, points=128)
    steps = stream(0)
    first = [next(steps) for _ in range(8)]
    later = next(stream(7))
    np.testing.assert_array_equal(first[7].points, later.points)
    sizes = np.concatenate([b.mask.sum(axis=1) for b in first])
    assert sorted(sizes[:5]) == sorted(sizes[5:10]) == [64, 65, 66, 67, 68]
