"""Pictures with a memory are those without, whatever moves in between."""

import mujoco
import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.mjcf.cameras import ray_memory
from manipose_mj.mjcf.cameras.ray_camera import RayCamera
from manipose_mj.mjcf.cameras.ray_casting import cast_rays
from manipose_mj.mjcf.cameras.ray_memory import RayMemory

# Two boxes share a face that is seen, so that hits at one place have to be told apart.
SCENE = """
<mujoco><asset>
  <mesh name="wedge" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .25 .3 .2 .1"/>
</asset><worldbody>
  <geom name="floor" type="plane" size="2 2 .1"/>
  <geom name="low" type="box" size=".2 .2 .1" pos="-.4 0 .1"/>
  <geom name="beside" type="box" size=".2 .2 .1" pos="-.4 .1 .1"/>
  <body name="mover" pos=".1 .1 .5" euler="20 30 40"><freejoint/>
    <geom name="bar" type="box" size=".3 .02 .05"/>
    <geom name="wedge" type="mesh" mesh="wedge" pos="0 .1 0"/>
  </body>
  <body name="other" pos=".3 -.3 .2"><freejoint/><geom name="ball" type="sphere" size=".15"/></body>
  <body name="eye" mocap="true" pos="0 0 1.8"><camera name="down" fovy="60"/></body>
</worldbody></mujoco>"""


class Scene:
    """Renders with a memory and without, and keeps which geoms the memory cast rays at."""

    def __init__(self, monkeypatch):
        self.model = mujoco.MjModel.from_xml_string(SCENE)
        self.data = mujoco.MjData(self.model)
        self.memory, self.camera, self.asked = RayMemory(), RayCamera(48, 64), []

        def noted(model, data, frame, bundles, *, shown):
            self.asked.append((np.flatnonzero(shown).tolist(), len(bundles.directions)))
            return cast_rays(model, data, frame, bundles, shown=shown)

        monkeypatch.setattr(ray_memory, "cast_rays", noted)

    def look(self):
        """The geoms by name, and how many rays, that were cast; the pictures have to be equal."""
        mujoco.mj_forward(self.model, self.data)
        self.asked.clear()
        image = self.camera.render(self.model, self.data, "down", self.memory)
        anew = self.camera.render(self.model, self.data, "down")
        for name, values in vars(anew).items():
            np.testing.assert_array_equal(getattr(image, name), values, err_msg=name)
        return [({self.model.geom(g).name for g in geoms}, rays) for geoms, rays in self.asked]


@pytest.fixture
def scene(monkeypatch):
    return Scene(monkeypatch)


ALL = {"floor", "low", "beside", "bar", "wedge", "ball"}
PIXELS = 48 * 64


def test_casts_at_what_moves_and_where_it_was(scene):
    assert scene.look() == [(ALL, PIXELS)]
    assert scene.look() == []
    scene.data.joint(0).qpos[0] += 0.2
    (behind, few), moved = scene.look()
    assert behind == ALL - {"bar", "wedge"}
    assert 0 < few < PIXELS / 4
    assert moved == ({"bar", "wedge"}, PIXELS)
    # Still moving, and nothing is behind it any more that was not seen before.
    scene.data.joint(0).qpos[1] -= 0.1
    assert scene.look() == [({"bar", "wedge"}, PIXELS)]
    # It stands, once more from now on.
    assert scene.look() == [({"bar", "wedge"}, PIXELS)]
    assert scene.look() == []


def test_casts_all_where_the_camera_moves(scene):
    scene.look()
    scene.data.mocap_pos[0, 0] += 0.01
    assert scene.look() == [(ALL, PIXELS)]
    assert scene.look() == []


def test_sees_sizes_and_transparency_change(scene):
    scene.look()
    scene.model.geom("ball").size[0] = 0.2
    assert ({"ball"}, PIXELS) in scene.look()
    scene.model.geom("low").rgba[3] = 0
    scene.look()
    scene.model.geom("low").rgba[3] = 1
    assert ({"low"}, PIXELS) in scene.look()


def test_is_equal_along_random_ways(scene):
    rng = np.random.default_rng(0)
    for _ in range(40):
        for joint in np.flatnonzero(rng.random(2) < 0.5):
            scene.data.joint(int(joint)).qpos[:3] += rng.normal(scale=0.1, size=3)
            scene.data.joint(int(joint)).qpos[3:] += rng.normal(scale=0.1, size=4)
        scene.look()


def test_another_model_is_cast_anew(scene):
    scene.look()
    scene.model = mujoco.MjModel.from_xml_string(SCENE.replace('size=".15"', 'size=".1"'))
    scene.data = mujoco.MjData(scene.model)
    assert scene.look() == [(ALL, PIXELS)]


@pytest.mark.parametrize("task", ["clutter/pick", "articulated/open_top_drawer"])
def test_is_equal_in_tasks(task):
    environment = suite.load(*task.split("/"), seed=0)
    environment.reset()
    physics, spec = environment.physics, environment.action_spec()
    rng, camera, memory = np.random.default_rng(0), RayCamera(60, 80), RayMemory()
    for _ in range(6):
        for _ in range(5):
            environment.step(rng.uniform(spec.minimum, spec.maximum))
        seen = physics.model.ptr, physics.data.ptr, "left"
        image, anew = camera.render(*seen, memory), camera.render(*seen)
        np.testing.assert_array_equal(image.depth, anew.depth)
        np.testing.assert_array_equal(image.geom_id, anew.geom_id)
        np.testing.assert_array_equal(image.normal, anew.normal)
