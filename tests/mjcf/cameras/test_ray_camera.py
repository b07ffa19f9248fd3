"""The ray camera against closed forms, against `mj_ray` and against MuJoCo's GL renderer."""

import os
import subprocess
import sys
import time

import mujoco
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras import gl
from manipose_mj.mjcf.cameras.ray_camera import RayCamera, camera_intrinsics, camera_pose
from manipose_mj.mjcf.cameras.ray_casting import bundle_rays, cast_rays, geom_boxes
from tests.places import ROOT

SHAPES = """
<mujoco><worldbody>
  <geom name="floor" type="plane" size="3 3 .1"/>
  <geom name="ball" type="sphere" size=".2" pos="0 0 .5" group="1"/>
  <geom name="crate" type="box" size=".1 .2 .15" pos=".6 0 .15" group="2"/>
  <geom name="proxy" type="box" size=".5 .5 .5" pos="0 0 1" group="3"/>
  <geom name="ghost" type="box" size=".5 .5 .5" pos="0 0 1" rgba="1 0 0 0"/>
  <geom name="marker" type="box" size=".5 .5 .5" pos="0 0 1" group="4"/>
  <camera name="top" pos="0 0 2" fovy="60"/>
  <camera name="level" pos=".6 -2 .15" xyaxes="1 0 0 0 0 1" fovy="40"/>
  <camera name="flat" pos="0 0 2" projection="orthographic"/>
</worldbody></mujoco>"""

# Bodies whose visual geoms lie outside their collision geoms, near and far cameras, an open shell.
CLUTTER = """
<mujoco><statistic extent="2" center="0 0 .3"/><asset>
  <mesh name="wedge" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .25 .3 .2 .1"/>
</asset><worldbody>
  <light pos="0 0 3"/>
  <geom type="plane" size="2 2 .1"/>
  <body pos=".1 .1 .5" euler="20 30 40"><freejoint/>
    <geom type="sphere" size=".02" group="3"/>
    <geom type="box" size=".3 .02 .05" pos=".2 0 .1" contype="0" conaffinity="0" group="2"/>
    <geom type="cylinder" size=".03 .2" pos="-.2 .2 .05" group="1" contype="0" conaffinity="0"/>
    <geom type="capsule" size=".03 .2" pos="-.1 -.2 .05"/>
  </body>
  <body pos="-.3 -.2 .3" euler="10 80 5"><freejoint/>
    <geom type="mesh" mesh="wedge"/>
    <geom type="ellipsoid" size=".1 .05 .2" pos=".1 .3 .1"/>
  </body>
  <camera name="far" pos="1.4 -1.2 1.0" xyaxes=".65 .76 0 -.31 .27 .91"/>
  <camera name="near" pos=".35 -.15 .75" xyaxes=".5 .87 0 -.6 .35 .7" fovy="80"/>
  <camera name="down" pos=".05 .05 1.6"/>
  <camera name="sensor" pos="1.0 .9 1.1" xyaxes="-.65 .76 0 -.4 -.34 .85" resolution="80 60"
    sensorsize=".004 .0025" focal=".004 .0035" principal=".0004 -.0003"/>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def shapes():
    return _ready(SHAPES)


@pytest.fixture(scope="module")
def clutter():
    return _ready(CLUTTER)


def _ready(xml):
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _expected_top_view(slopes):
    """Depth below the camera at (0, 0, 2): a ball at 0 0 .5, a crate's lid at z .3, the floor."""
    x, y = slopes[..., 0], slopes[..., 1]
    a, b, c = x**2 + y**2 + 1, -2 * 1.5, 1.5**2 - 0.2**2
    root = b**2 - 4 * a * c
    ball = np.where(root >= 0, (-b - np.sqrt(np.maximum(root, 0))) / (2 * a), np.inf)
    lid = np.where((np.abs(1.7 * x - 0.6) <= 0.1) & (np.abs(1.7 * y) <= 0.2), 1.7, np.inf)
    # The crate's inner wall, seen past the lid's near edge.
    wall_depth = 0.5 / np.where(np.abs(x) > 1e-12, x, 1e-12)
    height = 2 - wall_depth
    wall = (wall_depth > 0) & (height >= 0) & (height <= 0.3) & (np.abs(wall_depth * y) <= 0.2)
    return np.minimum.reduce([ball, lid, np.where(wall, wall_depth, np.inf), np.full_like(x, 2.0)])


def test_depth_is_exact(shapes):
    model, data = shapes
    image = RayCamera(90, 120).render(model, data, "top")
    slopes = camera_intrinsics(model, "top", 90, 120).slopes()
    np.testing.assert_allclose(image.depth, _expected_top_view(slopes), atol=1e-6)


def test_segmentation_and_hidden_geoms(shapes):
    model, data = shapes
    image = RayCamera(90, 120).render(model, data, "top")
    seen = {model.geom(i).name for i in np.unique(image.geom_id) if i >= 0}
    assert seen == {"floor", "ball", "crate"}
    assert model.geom(image.geom_id[45, 60]).name == "ball"
    assert model.geom(image.geom_id[0, 0]).name == "floor"


def test_normals(shapes):
    model, data = shapes
    image = RayCamera(90, 120).render(model, data, "top")
    intrinsics = camera_intrinsics(model, "top", 90, 120)
    pose = camera_pose(model, data, "top")
    rays = np.concatenate([intrinsics.slopes(), np.ones((90, 120, 1))], -1) @ pose[:3, :3].T
    points = pose[:3, 3] + image.depth[..., None] * rays
    ball = image.geom_id == model.geom("ball").id
    expected = (points[ball] - [0, 0, 0.5]) / 0.2
    np.testing.assert_allclose(image.normal[ball], expected, atol=1e-5)
    floor = image.geom_id == model.geom("floor").id
    np.testing.assert_allclose(image.normal[floor], np.tile([0, 0, 1], (floor.sum(), 1)), atol=1e-6)
    assert (np.sum(image.normal * rays, axis=-1) < 0).all()


def test_orientation_of_the_image(shapes):
    """The camera looks along +y: the world's x runs to the right, its z upwards; sky is empty."""
    model, data = shapes
    image = RayCamera(60, 80).render(model, data, "level")
    assert model.geom(image.geom_id[30, 40]).name == "crate"
    assert image.depth[30, 40] == pytest.approx(1.8, abs=1e-6)
    assert image.geom_id[0, 79] == -1 and image.depth[0, 79] == 0
    assert not image.normal[0, 79].any()
    assert model.geom(image.geom_id[59, 79]).name == "floor"
    ball_columns = np.flatnonzero((image.geom_id == model.geom("ball").id).any(axis=0))
    assert ball_columns.max() < 40  # the ball is at smaller x


def test_inside_of_a_box_is_seen_with_normals_inwards():
    model, data = _ready(
        "<mujoco><worldbody><geom type='box' size='1 1 1'/><camera name='c'/></worldbody></mujoco>"
    )
    image = RayCamera(20, 20).render(model, data, "c")
    np.testing.assert_allclose(image.depth, 1.0, atol=1e-6)
    np.testing.assert_allclose(image.normal[10, 10], [0, 0, 1], atol=1e-6)


def _checked_picture(model, data, camera):
    """A picture of 60 by 80 pixels, after comparing each with `mj_ray`."""
    image = RayCamera(60, 80).render(model, data, camera)
    pose = camera_pose(model, data, camera)
    slopes = camera_intrinsics(model, camera, 60, 80).slopes()
    rays = np.concatenate([slopes, np.ones((60, 80, 1))], -1) @ pose[:3, :3].T
    groups, geom = np.array([1, 1, 1, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    for v, u in np.ndindex(60, 80):
        scale = mujoco.mj_ray(model, data, pose[:3, 3], rays[v, u], groups, True, -1, geom)
        assert geom[0] == image.geom_id[v, u]
        assert max(scale, 0) == pytest.approx(image.depth[v, u], abs=1e-6)
    return image


@pytest.mark.parametrize("camera", ["far", "near", "down", "sensor"])
def test_equals_a_ray_at_a_time(clutter, camera):
    model, data = clutter
    image = _checked_picture(model, data, camera)
    assert len(np.unique(image.geom_id)) >= 5


def test_meshes_that_fill_the_picture_hide_each_other_as_by_a_ray_at_a_time():
    model, data = _ready(
        """<mujoco><asset><mesh name='block' vertex='-1 -1 -1 1 -1 -1 -1 1 -1 1 1 -1
             -1 -1 1 1 -1 1 -1 1 1 1 1 1'/><mesh name='wedge' vertex='-1 -1 -1 1 -1 -1 -1 1 -1 1 1 -1 0 0 1'/></asset>
           <worldbody><camera name='c' pos='0 0 6' euler='9 4 0'/>
             <geom name='behind' type='mesh' mesh='block' pos='0.2 0 -1.5' euler='10 20 30'/>
             <body><geom name='first' type='mesh' mesh='wedge' euler='0 0 20'/>
               <geom name='same' type='mesh' mesh='wedge' euler='0 0 20'/></body>
             <body pos='0.5 0.4 2'><geom name='before' type='mesh' mesh='block' size='.2 .2 .2' euler='40 0 0'/></body>
             <geom name='post' type='capsule' size='.1 2' pos='-0.7 0 1'/></worldbody></mujoco>"""
    )
    image = _checked_picture(model, data, "c")
    seen = {model.geom(g).name for g in np.unique(image.geom_id) if g >= 0}
    assert seen == {"behind", "first", "before", "post"}


def test_model_is_left_as_it_was(clutter):
    model, data = clutter
    groups, volumes = model.geom_group.copy(), model.body_bvhadr.copy()
    RayCamera(30, 40).render(model, data, "near")
    np.testing.assert_array_equal(model.geom_group, groups)
    np.testing.assert_array_equal(model.body_bvhadr, volumes)


def test_primitive_sizes_may_be_edited():
    model, data = _ready(
        "<mujoco><worldbody><geom name='g' type='sphere' size='.01'/>"
        "<camera name='c' pos='0 0 2'/></worldbody></mujoco>"
    )
    model.geom_size[0] = 0.3
    assert (RayCamera(40, 40).render(model, data, "c").geom_id == 0).sum() > 100
    np.testing.assert_allclose(geom_boxes(model)[1], 0.3)


def test_boxes_of_primitives_are_the_compilers(clutter):
    model, _ = clutter
    centre, half = geom_boxes(model)
    bounded = model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    np.testing.assert_allclose(centre[bounded], model.geom_aabb[bounded, :3], atol=1e-12)
    np.testing.assert_allclose(half[bounded], model.geom_aabb[bounded, 3:], atol=1e-12)


def test_scattered_rays_keep_their_order(clutter):
    model, data = clutter
    xy = np.random.default_rng(0).normal(size=(3000, 2))
    pose = camera_pose(model, data, "down")
    together = cast_rays(model, data, pose, bundle_rays(xy))
    for rows in (slice(0, 1), slice(100, 103), slice(1234, 2345)):
        alone = cast_rays(model, data, pose, bundle_rays(xy[rows]))
        np.testing.assert_array_equal(alone.geom_id, together.geom_id[rows])
        np.testing.assert_allclose(alone.scale, together.scale[rows])
    assert len(cast_rays(model, data, pose, bundle_rays(xy[:0])).scale) == 0


def test_intrinsics_of_a_sensor(clutter):
    """Focal lengths and the principal point scale with the image; the middle of 80 is 39.5."""
    model, _ = clutter
    k = camera_intrinsics(model, "sensor", 60, 80).matrix
    np.testing.assert_allclose(k, [[80, 0, 39.5 - 8], [0, 84, 29.5 + 7.2], [0, 0, 1]], rtol=1e-5)


@pytest.mark.parametrize(
    ("camera", "message"),
    [("topp", "did you mean top"), (7, "camera id 7"), (-1, "camera id -1"), ("flat", "orthogr")],
)
def test_bad_cameras(shapes, camera, message):
    with pytest.raises(InputError, match=message):
        RayCamera(10, 10).render(*shapes, camera)


def test_bad_size():
    with pytest.raises(InputError, match="0 x 10"):
        RayCamera(0, 10)


def test_speed(clutter):
    """19,200 rays; 4 to 15 ms on one idle core. The bound allows for a busy machine."""
    model, data = clutter
    camera = RayCamera(120, 160)
    times = []
    for _ in range(5):
        start = time.process_time()
        camera.render(model, data, "far")
        times.append(time.process_time() - start)
    assert min(times) < 0.1


COMPARE = """
import sys
import mujoco, numpy as np
from manipose_mj.mjcf.cameras import gl
from manipose_mj.mjcf.cameras.ray_camera import RayCamera
from tests.places import ROOT
gl.activate()
model = mujoco.MjModel.from_xml_string(sys.stdin.read())
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 120, 160) as renderer:
    for camera in ("far", "near", "down", "sensor"):
        renderer.update_scene(data, camera)
        renderer.enable_depth_rendering()
        depth = renderer.render().copy()
        renderer.enable_segmentation_rendering()
        ids, kind = np.moveaxis(renderer.render(), -1, 0)
        ids = np.where(kind == mujoco.mjtObj.mjOBJ_GEOM, ids, -1)
        image = RayCamera(120, 160).render(model, data, camera)
        inner = np.ones(ids.shape, bool)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                inner &= np.roll(ids, (dy, dx), (0, 1)) == ids
        inner &= ids >= 0
        same = ids == image.geom_id
        error = np.abs(depth - image.depth)[inner & same]
        print(camera, same.mean(), same[inner].mean(), np.quantile(error, 0.99), inner.mean())
"""


def test_agrees_with_gl():
    """In a child process: GL is bound once per process and may crash."""
    environment = {
        k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")
    }
    works = [b for b in ("osmesa", "egl") if gl.probe(b).works]
    if not works:
        pytest.skip("; ".join(f"{s.backend}: {s.reason}" for s in gl.probe_all()))
    child = subprocess.run(
        [sys.executable, "-c", COMPARE],
        input=CLUTTER,
        env={**environment, "MUJOCO_GL": works[0], "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert child.returncode == 0, child.stderr
    lines = [line.split() for line in child.stdout.splitlines()]
    assert len(lines) == 4
    for camera, same, same_inside, error, inside in lines:
        assert float(same) > 0.985, (camera, same)
        assert float(same_inside) > 0.999, (camera, same_inside)
        # GL draws cylinders and ellipsoids as polyhedra, which are up to 2 mm off here and there.
        assert float(error) < 1e-3, (camera, error)
        assert float(inside) > 0.3, (camera, inside)
