"""Cameras of batched worlds against the tasks' own."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from manipose_mj import batch
from manipose_mj.batch.perception.cameras import Cameras
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.observations.sensor_config import SensorConfig
from tests.batch.batched import make, on_the_cpu

TASK, OBJECTS = "single_object/target_pose", ("mug_000", "box_000")
HEIGHT, WIDTH = 30, 40


@pytest.mark.full
def test_depth_and_segmentation_are_the_cpu_cameras():
    worlds = make(TASK, 2, seeds=(0, 1), objects=OBJECTS, obs_mode="state")
    cameras = Cameras(worlds, ("left", "front"), height=HEIGHT, width=WIDTH)
    state = worlds.at([0, 1])
    images = jax.jit(cameras.look)(state)
    assert images.depth.shape == (2, 2, HEIGHT, WIDTH) and images.rgb is None
    sensors = SensorConfig(height=HEIGHT, width=WIDTH)
    for world, seed in enumerate((0, 1)):
        alone = on_the_cpu(
            TASK, seed, objects=OBJECTS, obs_mode="depth+segmentation", sensors=sensors
        )
        seen = alone.reset(EpisodeSpec(seed=seed)).observation
        for i, name in enumerate(("left", "front")):
            np.testing.assert_allclose(
                images.depth[world, i], np.squeeze(seen[f"depth/{name}"]), atol=1e-6
            )
            np.testing.assert_array_equal(
                images.instance[world, i], np.squeeze(seen[f"segmentation/{name}"])
            )
        assert (np.asarray(images.instance[world]) == int(cameras.numbers(state)[world, 0])).any()
        assert len(np.unique(images.instance[world])) > 2  # the robot, the object, the rest
        rig = alone.task.sensors._rig
        pose = np.asarray(images.poses[world, 0])
        np.testing.assert_allclose(pose, rig.pose(alone.physics, "left"), atol=1e-6)
        pinhole = rig.intrinsics(alone.physics, "left")
        np.testing.assert_allclose(
            images.pinholes[world, 0], (pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy), rtol=1e-6
        )


def test_what_cannot_be_seen_is_refused_in_one_line():
    worlds = make(TASK, 1, seeds=(0,), objects=("box_000",), obs_mode="state")
    with pytest.raises(InputError, match="left"):
        Cameras(worlds, ("lift",))
    with pytest.raises(InputError, match="height is 0; expected a whole number, at least 1"):
        Cameras(worlds, height=0)
    for names in ("front", 5):
        with pytest.raises(InputError, match=f"names is {names!r}; expected a tuple of cameras'"):
            Cameras(worlds, names)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="names is empty; expected some of front, left, .* None"):
        Cameras(worlds, ())
    blind = SensorConfig(cameras=())
    with pytest.raises(InputError, match="have no cameras; make them with sensors that name some"):
        Cameras(make(TASK, 1, seeds=(0,), objects=("box_000",), obs_mode="state", sensors=blind))
    with pytest.raises(InputError, match="colours need engine 'warp'"):
        Cameras(worlds, rgb=True)


@pytest.mark.full
@pytest.mark.parametrize("task", [TASK, "articulated/open_middle_drawer"])
def test_worlds_with_different_objects_look_as_on_the_cpu(task, monkeypatch):
    pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
    monkeypatch.setenv("MANIPOSE_WARP_ON_CPU", "1")
    objects = OBJECTS if task == TASK else ("cabinet_018", "cabinet_012")
    pool = batch.make(
        task, worlds=1, seeds=range(4), engine="c", objects=objects, obs_mode="state"
    ).pool
    assert len(pool.scenes) == 2
    worlds = [batch.from_pool(pool, 4, "c"), batch.from_pool(pool, 4, "warp", visual=True)]
    size = {"height": HEIGHT, "width": WIDTH}
    expected, found = (Cameras(w, **size).look(w.at(pool.seeds)) for w in worlds)
    same = np.asarray(found.instance) == np.asarray(expected.instance)
    assert same.mean() > 0.999
    near = np.abs(np.asarray(found.depth) - np.asarray(expected.depth)) < 1e-3
    assert near.mean() > 0.999
    assert (np.asarray(found.instance) > 0).any(axis=(1, 2, 3)).all()
    with pytest.raises(InputError, match="visual=True"):
        Cameras(batch.from_pool(pool, 4, "warp"), **size)
    coloured = Cameras(worlds[1], ("front",), rgb=True, **size).look(worlds[1].at(pool.seeds))
    assert coloured.rgb.shape == (4, 1, HEIGHT, WIDTH, 3)
    assert np.ptp(np.asarray(coloured.rgb)[0, 0]) > 60
