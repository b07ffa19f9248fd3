"""Clouds lie on the surfaces they come from, keep their shape and survive fusing."""

import mujoco
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.clouds import (
    NO_INSTANCE,
    cloud_from_depth,
    fuse,
    geom_instances,
    normals_from_points,
    pixel_instances,
)
from manipose_mj.mjcf.cameras.ray_camera import RayCamera, camera_intrinsics, camera_pose

SCENE = """
<mujoco><worldbody>
  <geom name="floor" type="plane" size="3 3 .1"/>
  <body name="ball" pos=".1 0 .3"><geom type="sphere" size=".1"/></body>
  <body name="cabinet" pos="-.3 .1 .2">
    <geom type="box" size=".1 .1 .2"/>
    <body name="drawer" pos=".1 0 0"><geom type="box" size=".02 .08 .08"/>
      <body pos=".03 0 0"><geom type="box" size=".01 .03 .01"/></body>
    </body>
  </body>
  <camera name="a" pos="1.0 -.8 .9" xyaxes=".62 .78 0 -.42 .34 .84"/>
  <camera name="b" pos=".8 .9 .8" xyaxes="-.75 .66 0 -.38 -.43 .82"/>
</worldbody></mujoco>"""
SIZE = (90, 120)


@pytest.fixture(scope="module")
def scene():
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _bodies(model, *names):
    return [model.body(name).id for name in names]


def _cloud(scene, camera, bodies, *, with_normals=True):
    model, data = scene
    image = RayCamera(*SIZE).render(model, data, camera)
    return cloud_from_depth(
        image.depth,
        pixel_instances(image.geom_id, geom_instances(model, bodies)),
        camera_intrinsics(model, camera, *SIZE),
        camera_pose(model, data, camera),
        normal=image.normal if with_normals else None,
    )


@pytest.mark.parametrize("camera", ["a", "b"])
def test_points_lie_on_the_ball_and_normals_point_outwards(scene, camera):
    cloud = _cloud(scene, camera, _bodies(scene[0], "ball"))
    assert len(cloud) > 100 and cloud.points_world.dtype == np.float32
    outwards = cloud.points_world - [0.1, 0, 0.3]
    np.testing.assert_allclose(np.linalg.norm(outwards, axis=1), 0.1, atol=1e-6)
    np.testing.assert_allclose(cloud.normals_world, outwards / 0.1, atol=1e-4)
    eye = camera_pose(*scene, camera)[:3, 3]
    assert (np.sum(cloud.normals_world * (eye - cloud.points_world), axis=1) > 0).all()


def test_instances_follow_the_innermost_body(scene):
    model, _ = scene
    owner = geom_instances(model, _bodies(model, "cabinet", "drawer"))
    assert owner.tolist() == [NO_INSTANCE, NO_INSTANCE, 0, 1, 1]
    cloud = _cloud(scene, "a", _bodies(model, "cabinet", "drawer"))
    assert set(np.unique(cloud.instance)) == {0, 1}
    front = cloud.of_instance(1).points_world
    assert len(front) and (front[:, 0] > -0.3 + 0.1 - 1e-5).all()


def test_estimated_normals_agree_with_the_true_ones(scene):
    bodies = _bodies(scene[0], "ball", "cabinet")
    true = _cloud(scene, "a", bodies).normals_world
    estimated = _cloud(scene, "a", bodies, with_normals=False).normals_world
    known = np.linalg.norm(estimated, axis=1) > 0.5
    assert known.mean() > 0.9
    angle = np.degrees(np.arccos(np.clip(np.sum(true * estimated, axis=1)[known], -1, 1)))
    assert np.median(angle) < 5 and np.quantile(angle, 0.9) < 25
    flat = _cloud(scene, "a", _bodies(scene[0], "cabinet"))
    assert len(flat) > 50


def test_estimated_normals_of_a_tilted_plane_are_exact():
    v, u = np.indices((20, 30)) / 30.0
    depth = 1 / (1 - 0.5 * u + 0.3 * v)  # the plane 0.5 x - 0.3 y + 1 = z seen by slopes u, v
    points = np.stack([u * depth, v * depth, depth], axis=-1)
    expected = np.array([0.5, -0.3, -1.0]) / np.linalg.norm([0.5, -0.3, -1.0])
    np.testing.assert_allclose(
        normals_from_points(points), np.broadcast_to(expected, (20, 30, 3)), atol=1e-9
    )


def test_nothing_seen_gives_no_points(scene):
    model, data = scene
    intrinsics, pose = camera_intrinsics(model, "a", 4, 5), camera_pose(model, data, "a")
    depth = np.array([[0, np.inf, np.nan, -1, 1]] * 4, np.float32)
    instance = np.zeros((4, 5), int)
    instance[0, 4] = -1
    for normal in (None, np.ones((4, 5, 3))):
        cloud = cloud_from_depth(depth, instance, intrinsics, pose, normal=normal)
        assert len(cloud) == 3 and np.isfinite(cloud.points_world).all()


def test_fused_clouds_cover_more_and_agree(scene):
    bodies = _bodies(scene[0], "ball")
    a, b = (_cloud(scene, camera, bodies) for camera in "ab")
    both = fuse([a, b.resized(len(b) + 50)])
    assert len(both) == len(a) + len(b) and both.valid.all()
    distance = np.linalg.norm(both.points_world - [0.1, 0, 0.3], axis=1)
    np.testing.assert_allclose(distance, 0.1, atol=1e-6)
    assert np.ptp(both.points_world[:, 1]) > np.ptp(a.points_world[:, 1])
    assert len(fuse([])) == 0


def test_resizing_down_is_repeatable_and_spread(scene):
    cloud = _cloud(scene, "a", _bodies(scene[0], "ball"))
    small = cloud.resized(64)
    assert small.points_world.shape == (64, 3) and small.valid.all()
    np.testing.assert_array_equal(small.points_world, cloud.resized(64).points_world)
    assert len(np.unique(small.points_world, axis=0)) == 64
    whole = np.ptp(cloud.points_world, axis=0)
    assert (np.ptp(small.points_world, axis=0) > 0.8 * whole).all()


def test_resizing_up_pads_with_marked_rows(scene):
    cloud = _cloud(scene, "a", _bodies(scene[0], "ball"))
    large = cloud.resized(len(cloud) + 7)
    assert large.valid.sum() == len(cloud) and not large.valid[-7:].any()
    assert not large.points_world[-7:].any()
    np.testing.assert_array_equal(large.resized(len(cloud)).points_world, cloud.points_world)
    assert not fuse([]).resized(5).valid.any()


def test_bad_input(scene):
    model, data = scene
    cloud = _cloud(scene, "a", _bodies(model, "ball"))
    with pytest.raises(InputError, match="at least one point"):
        cloud.resized(0)
    with pytest.raises(InputError, match="depth image"):
        cloud_from_depth(
            np.ones((3, 3)),
            np.zeros((3, 3), int),
            camera_intrinsics(model, "a", 4, 5),
            camera_pose(model, data, "a"),
        )


@pytest.mark.usefixtures("wrong_arrays")
@pytest.mark.parametrize("name", ["normal", "colour"])
def test_images_of_another_size_are_refused(scene, name):
    model, data = scene
    image = np.zeros((8, 10, 3), np.uint8 if name == "colour" else float)
    sight, pose = camera_intrinsics(model, "a", 4, 5), camera_pose(model, data, "a")
    with pytest.raises(InputError, match=rf"{name} image is \(8, 10\)"):
        cloud_from_depth(np.ones((4, 5)), np.zeros((4, 5), int), sight, pose, **{name: image})
