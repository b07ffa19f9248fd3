"""Colours of textures without GL: how often they repeat, and what belongs to which geom."""

import mujoco
import numpy as np
import pytest

from manipose_mj.mjcf.cameras.ray_camera import RayCamera
from manipose_mj.mjcf.cameras.surface_colours import SurfaceColours

# A square of 0.4 m with the corners of the texture at its own; halves of it are red and green.
QUAD = """<mesh name="quad" vertex="-.2 -.2 0  .2 -.2 0  .2 .2 0  -.2 .2 0  0 0 -.1"
  texcoord="0 0  1 0  1 1  0 1  .5 .5" face="0 1 2  0 2 3  1 0 4  2 1 4  3 2 4  0 3 4"/>"""
SCENE = """<mujoco><asset>
  <texture name="checks" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 1 0" width="64" height="64"/>
  <material name="once" texture="checks"/>
  <material name="often" texture="checks" texrepeat="3 1"/>
  <material name="unseen" rgba="1 1 1 0"/>
  %s</asset><worldbody>
  <geom name="small" type="plane" size=".2 .2 .1" material="once"/>
  <geom name="large" type="plane" size=".4 .4 .1" pos="0 0 -1" material="once"/>
  <geom name="mesh" type="mesh" mesh="quad" material="often" pos="0 0 1"/>
  <geom name="ghost" type="box" size=".1 .1 .1" pos="2 0 0" material="unseen" rgba="0 0 1 1"/>
  <camera name="above" pos="2 0 1"/>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def scene():
    model = mujoco.MjModel.from_xml_string(SCENE % QUAD)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_a_texture_is_stretched_over_each_plane(scene):
    model, data = scene
    rng = np.random.default_rng(0)
    places = np.concatenate([rng.uniform(-0.19, 0.19, (200, 2)), np.zeros((200, 1))], axis=1)
    both = SurfaceColours(model)  # one object has both
    found = []
    for name, size in (("small", 1.0), ("large", 2.0)):
        geom = model.geom(name).id
        points = data.geom_xpos[geom] + size * places
        found.append(both.at(data, points, np.full(len(points), geom)))
    np.testing.assert_array_equal(found[0].argmax(axis=1), found[1].argmax(axis=1))
    assert 0.3 < (found[0][:, 0] > found[0][:, 1]).mean() < 0.7


def test_a_texture_repeats_on_meshes_as_often_as_the_material_says(scene):
    model, data = scene
    along = np.linspace(-0.19, 0.19, 77)
    points = np.stack([along, np.full(77, 0.1), np.ones(77)], axis=1)
    colours = SurfaceColours(model).at(data, points, np.full(77, model.geom("mesh").id))
    changes = np.count_nonzero(np.diff(colours.argmax(axis=1)))
    assert changes == 5, "three repeats of two colours"


def test_a_geom_of_its_own_colour_is_seen_whatever_its_material(scene):
    model, data = scene
    seen = RayCamera(9, 9).render(model, data, model.camera("above").id)
    assert model.geom("ghost").id in np.unique(seen.geom_id)
