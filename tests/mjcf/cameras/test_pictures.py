"""Ray-cast pictures show light, shadow, colour and texture; GL pictures where GL works."""

import io
import os
import subprocess
import sys
import time

import mujoco
import numpy as np
import pytest
from PIL import Image

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras import gl, pictures
from manipose_mj.mjcf.cameras.pictures import painter, render
from manipose_mj.mjcf.cameras.ray_picture import RayPainter, RayShading
from manipose_mj.mjcf.cameras.surface_colours import SurfaceColours, to_linear
from manipose_mj.mjcf.views.film import encode_animation, encode_png, film_strip
from tests.places import ROOT

SCENE = """
<mujoco><asset>
  <texture name="halves" type="2d" builtin="checker" width="2" height="2" rgb1="1 0 0"
    rgb2="0 0 1"/>
  <material name="halves" texture="halves" texuniform="true" texrepeat="1 1"/>
</asset><worldbody>
  <light type="directional" dir="-.5 0 -1" castshadow="true"/>
  <geom name="floor" type="plane" size="3 3 .1" rgba=".7 .7 .7 1"/>
  <geom name="ball" type="sphere" size=".2" pos="0 0 .5" rgba=".9 .1 .1 1"/>
  <geom name="glass" type="box" size=".15 .15 .15" pos="0 .8 .15" rgba="0 0 1 .5"/>
  <geom name="proxy" type="box" size=".3 .3 .3" pos="0 -.8 .3" group="3"/>
  <geom name="marker" type="box" size=".1 .1 .1" pos=".8 .8 .1" rgba="0 1 0 1" group="4"/>
  <camera name="top" pos="0 0 4" fovy="45"/>
  <camera name="side" pos="0 -4 .5" xyaxes="1 0 0 0 0 1" fovy="30"/>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def scene():
    return _ready(SCENE)


@pytest.fixture(scope="module")
def top(scene):
    return render(*scene, "top", 121, 161, engine="ray")


def _ready(xml):
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _at(picture, x, y, z=0.0):
    """The pixel of a world point in the view from (0, 0, 4), fovy 45."""
    height, width = picture.shape[:2]
    focal = height / 2 / np.tan(np.radians(22.5))
    u, v = width / 2 + focal * x / (4 - z), height / 2 - focal * y / (4 - z)
    return picture[int(v), int(u)].astype(float)


def test_colours_are_the_geoms(top):
    assert top.shape == (121, 161, 3) and top.dtype == np.uint8
    red, green, blue = _at(top, 0, 0, 0.7)
    assert red > 100 and green < 0.6 * red and blue < 0.6 * red
    floor = _at(top, -1.2, -0.8)
    assert floor.min() > 100 and np.ptp(floor) < 25


def test_shadow_lies_away_from_the_light(top):
    """The light comes from +x at 1 : 2, so the ball's shadow is centred at x = -0.25."""
    shadow, mirrored, open_floor = (_at(top, x, y) for x, y in ((-0.3, 0), (0.5, 0), (-1, -0.8)))
    assert shadow.mean() < 0.8 * open_floor.mean()
    assert mirrored.mean() == pytest.approx(open_floor.mean(), rel=0.1)


def test_the_lit_side_is_brighter(scene):
    picture = render(*scene, "side", 120, 160, engine="ray").astype(float)
    rows, columns = np.nonzero(picture[..., 0] > 1.5 * picture[..., 1])
    middle = columns.mean()
    ball = picture[rows, columns, 0]
    assert ball[columns > middle + 3].mean() > 1.15 * ball[columns < middle - 3].mean()


def test_sky_gets_deeper_upwards(scene):
    picture = render(*scene, "side", 120, 160, engine="ray").astype(float)
    assert picture[0, 80, 2] > picture[0, 80, 0]
    assert picture[0, 80].mean() < picture[50, 2].mean()


def test_glass_lets_the_floor_through_and_collision_is_hidden(top):
    glass, floor = _at(top, 0, 0.8, 0.3), _at(top, -1.2, -0.8)
    assert glass[2] > glass[0] + 20 and glass[0] > 30
    np.testing.assert_allclose(_at(top, 0, -0.8, 0.6), floor, atol=12)


def test_markers_are_shown(top):
    red, green, blue = _at(top, 0.8, 0.8, 0.2)
    assert green > 100 and green > 2 * max(red, blue)


def test_same_state_same_bytes(scene, top):
    np.testing.assert_array_equal(top, render(*scene, "top", 121, 161, engine="ray"))


def test_supersampling_softens_edges(scene):
    model, data = scene
    one = RayPainter(model, 60, 80, RayShading(supersampling=1)).paint(data, "top").astype(float)
    four = RayPainter(model, 60, 80).paint(data, "top").astype(float)
    many = RayPainter(model, 60, 80, RayShading(supersampling=5)).paint(data, "top").astype(float)
    assert np.abs(four - many).mean() < 0.7 * np.abs(one - many).mean()


def test_plane_texture_is_sampled():
    xml = SCENE.replace('rgba=".7 .7 .7 1"', 'material="halves"')
    model, data = _ready(xml)
    quarter = np.array([[0.25, 0.25, 0], [-0.25, 0.25, 0], [-0.25, -0.25, 0], [0.25, -0.25, 0.0]])
    colours = SurfaceColours(model).at(data, quarter, np.zeros(4, int))
    assert len(np.unique(np.round(colours, 3), axis=0)) == 2
    np.testing.assert_allclose(colours[0], colours[2])
    assert not np.allclose(colours[0], colours[1])


def test_mesh_texture_is_sampled(tmp_path):
    """A pyramid upside down whose texture is red, green, then blue, white from v = 1 down."""
    texels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    Image.fromarray(np.kron(texels, np.ones((8, 8, 1), np.uint8))).save(tmp_path / "t.png")
    (tmp_path / "q.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .5 .5 -1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
        "f 2/1 1/1 5/1\nf 3/1 2/1 5/1\nf 4/1 3/1 5/1\nf 1/1 4/1 5/1\n"
    )
    (tmp_path / "m.xml").write_text(
        "<mujoco><asset><mesh name='q' file='q.obj' inertia='shell'/>"
        "<texture name='t' type='2d' file='t.png'/><material name='t' texture='t'/></asset>"
        "<worldbody><geom type='mesh' mesh='q' material='t'/></worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    points = np.array([[0.25, 0.75, 0], [0.75, 0.75, 0], [0.25, 0.25, 0], [0.75, 0.25, 0]])
    colours = SurfaceColours(model).at(data, points, np.zeros(4, int))
    np.testing.assert_allclose(colours, to_linear(texels.reshape(4, 3) / 255), atol=1e-6)


def test_a_painter_follows_the_state():
    model, data = _ready(
        "<mujoco><worldbody><body><freejoint/><geom size='.2'/></body>"
        "<camera name='c' pos='0 0 3'/></worldbody></mujoco>"
    )
    with painter(model, 40, 60, engine="ray") as paint:
        before = paint.paint(data, "c")
        data.qpos[0] = 0.6
        mujoco.mj_forward(model, data)
        after = paint.paint(data, "c")
    assert (before[20, 30] != after[20, 30]).any()


def test_auto_draws_without_gl(scene, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    expected = render(*scene, "top", 30, 40, engine="ray")
    np.testing.assert_array_equal(render(*scene, "top", 30, 40, engine="auto"), expected)
    with pytest.raises(InputError, match="MUJOCO_GL"):
        render(*scene, "top", 30, 40, engine="gl")


def test_sizes_beyond_memory_are_refused(scene):
    with pytest.raises(InputError, match="at most 67108864 pixels"):
        render(*scene, "top", 20_000, 20_000, engine="ray")


def test_sizes_beyond_the_renderers_buffer_are_refused(scene, monkeypatch):
    def no_room(*size):
        raise mujoco.FatalError("Offscreen framebuffer is not complete, error 0x8cd6")

    monkeypatch.setattr(pictures, "binds_gl", lambda engine: True)
    monkeypatch.setattr(mujoco, "Renderer", no_room)
    with pytest.raises(InputError, match=r"480 x 50000: cannot be drawn here .* a smaller one"):
        render(*scene, "top", 480, 50_000, engine="gl")


def test_bad_input(scene):
    with pytest.raises(InputError, match="unknown engine"):
        render(*scene, "top", engine="rays")
    with pytest.raises(InputError, match="unknown camera"):
        render(*scene, "topp", 20, 20, engine="ray")
    with pytest.raises(InputError, match="picture size"):
        render(*scene, "top", 0, 20, engine="ray")


GL_SCRIPT = """
import sys
import mujoco
from manipose_mj.mjcf.cameras.pictures import render
from tests.places import ROOT
model = mujoco.MjModel.from_xml_string(sys.stdin.read())
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
sys.stdout.buffer.write(render(model, data, "top", 700, 900, engine="gl").tobytes())
"""


def test_gl_draws_the_same_objects(scene):
    """MuJoCo was imported with no platform chosen; larger than the model's buffer."""
    works = [b for b in ("osmesa", "egl") if gl.probe(b).works]
    if not works:
        pytest.skip("; ".join(f"{s.backend}: {s.reason}" for s in gl.probe_all()))
    environment = {k: v for k, v in os.environ.items() if k != "MUJOCO_GL"}
    child = subprocess.run(
        [sys.executable, "-c", GL_SCRIPT],
        input=SCENE.encode(),
        env={**environment, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        timeout=120,
        check=False,
    )
    assert child.returncode == 0, child.stderr.decode()
    picture = np.frombuffer(child.stdout, np.uint8).reshape(700, 900, 3)
    assert _at(picture, 0, 0, 0.7)[0] > 2 * _at(picture, 0, 0, 0.7)[1]
    assert _at(picture, 0.8, 0.8, 0.2)[1] > 100  # the marker


def test_film_strip_and_animations():
    frames = [np.full((48, 64, 3), 40 * i, np.uint8) for i in range(4)]
    strip = Image.open(io.BytesIO(film_strip(frames, ["a", "b" * 200, "", "d"], columns=2)))
    assert strip.format == "PNG" and strip.width == 2 * 64 + 18 and strip.height > 2 * 48
    assert strip.getpixel((10, 10)) == (0, 0, 0) and strip.getpixel((80, 10)) == (40, 40, 40)
    for kind in ("webp", "gif", "png"):
        film = Image.open(io.BytesIO(encode_animation(frames, fps=5, format=kind)))
        assert film.n_frames == 4 and film.size == (64, 48)
        film.seek(2)
        assert abs(film.convert("RGB").getpixel((30, 20))[0] - 80) < 8
    picture = Image.open(io.BytesIO(encode_png(frames[1])))
    np.testing.assert_array_equal(np.asarray(picture), frames[1])


def test_bad_film():
    frame = np.zeros((4, 5, 3), np.uint8)
    with pytest.raises(InputError, match="no picture"):
        film_strip([], [])
    with pytest.raises(InputError, match="1 captions for 2"):
        film_strip([frame, frame], ["a"])
    with pytest.raises(InputError, match="expected one shape"):
        encode_animation([frame, frame[:3]])
    with pytest.raises(InputError, match="format 'avi'"):
        encode_animation([frame], format="avi")
    for fps, kind in ((0, "webp"), (float("inf"), "png"), (60, "gif")):
        with pytest.raises(InputError, match=f"more than 0, in {kind} at most"):
            encode_animation([frame], fps=fps, format=kind)
    with pytest.raises(InputError, match="pictures of shapes"):
        encode_animation([frame[:0]])


def test_speed(scene):
    """320x240, supersampled: about 0.1 s on one idle core. The bound allows for a busy machine."""
    model, data = scene
    paint = RayPainter(model, 240, 320)
    times = []
    for _ in range(3):
        start = time.process_time()
        paint.paint(data, "top")
        times.append(time.process_time() - start)
    assert min(times) < 1.0
