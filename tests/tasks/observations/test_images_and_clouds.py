"""Observed images and clouds: what cameras see, and what the cloud of an object is made of."""

from __future__ import annotations

import time

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.errors import InputError
from manipose_mj.evaluation.episode import start_state
from manipose_mj.mjcf.cameras import gl
from manipose_mj.mjcf.panda.robot import Visuals
from manipose_mj.poses import compose, invert, transform
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.observations.sensors import SensorConfig
from tests import few_objects
from tests.fake_menagerie import write_menagerie
from tests.tasks.observed_scenes import ABOVE, STORE, TARGET_POSE, hold, load


def test_a_camera_of_ones_own_sees_what_it_looks_at():
    environment = load(TARGET_POSE, "pose+depth+segmentation")
    found = 0
    for _ in range(4):
        observation = environment.reset().observation
        k = observation["camera/above/intrinsics"]
        position = observation["pose/cameras/object"][1][:3, 3]
        column, row = (k @ (position / position[2]))[:2]
        own = observation["segmentation/ids/object"][0]
        rows, columns = np.nonzero(observation["segmentation/above"] == own)
        if len(rows) > 12:  # else the hand is in the way
            found += 1
            assert abs(rows.mean() - row) < 3 and abs(columns.mean() - column) < 3
    assert found >= 2
    # Straight down: the world's x is up in the image, its y to the left.
    pose = observation["camera/above/pose"]
    np.testing.assert_allclose(pose[:3, :3], [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], atol=1e-12)
    assert observation["depth/above"].max() < 1.3 + 0.75 + 0.01


def test_rgb_and_clouds_show_the_red_can():
    sensors = SensorConfig(cameras=("left",), renderer="ray")
    observation = load(STORE, "rgb+segmentation+pointcloud", sensors, 3).reset().observation
    mask = observation["segmentation/left"] == observation["segmentation/ids/object"][0]
    count = int(observation["pointcloud/object/count"][0])
    shaded = observation["pointcloud/object/colours"][:count]
    plain = (
        load(STORE, "pointcloud", sensors, 3)
        .reset()
        .observation["pointcloud/object/colours"][:count]
    )
    assert count == mask.sum() > 50
    for colours in (observation["rgb/left"][mask], shaded, plain):
        red, green, blue = colours.T.astype(float)
        # The rest is the grey end and the yellow rims.
        assert ((red > 1.8 * green) & (red > 1.8 * blue)).mean() > 0.15
    # Without rgb the colours are the paint's, with it those of the picture, in which there is shade.
    assert len(np.unique(shaded, axis=0)) > 2 * len(np.unique(plain, axis=0))


def test_sensors_do_not_see_the_goal_marker():
    environment = load(TARGET_POSE, "rgb+depth")
    environment.reset()
    task, physics = environment.task, environment.physics
    pictures = []
    for place in ([0.5, 0.0, 0.3], [0.0, 0.0, 5.0]):
        task.scene.fixtures["goal"].place(physics, compose(np.eye(3), np.array(place)))
        physics.forward()
        task.forget_images()
        pictures.append(task.observables["rgb/above"](physics))
    assert np.array_equal(*pictures) and pictures[0].any()


def test_gl_is_asked_for_where_there_is_none(monkeypatch):
    monkeypatch.setattr(gl, "working_backend", lambda: None)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    sensors = SensorConfig(cameras=("left",), height=20, width=30, renderer="gl")
    with pytest.raises(InputError, match="libosmesa6") as caught:
        load(TARGET_POSE, "rgb", sensors)
    assert "\n" not in str(caught.value)
    sensors = SensorConfig(cameras=("left",), height=20, width=30, renderer="auto")
    assert load(TARGET_POSE, "rgb", sensors).reset().observation["rgb/left"].std() > 10


def test_an_objects_cloud_is_its_own_and_padded_with_zeros(ideal):
    observation = ideal.reset().observation
    task = ideal.task
    assert isinstance(task, ManipulationTask)
    count = int(observation["pointcloud/object/count"][0])
    points = observation["pointcloud/object/points"]
    assert 10 < count <= 64
    for name in ("points", "normals", "colours"):
        assert not observation[f"pointcloud/object/{name}"][count:].any()
    label = task.objects["object"].asset.label
    local = transform(invert(observation["pose/object"]), points[:count].astype(float))
    assert (np.abs(local) < label.extents / 2 + 0.002).all()
    lengths = np.linalg.norm(observation["pointcloud/object/normals"][:count], axis=1)
    np.testing.assert_allclose(lengths, 1, atol=1e-5)
    own = observation["pointcloud/ids/object"][0]
    assert own == task.instance_names.index(task.objects["object"].mjcf_model.model)
    assert own == observation["segmentation/ids/object"][0]
    of_all = observation["pointcloud/points"][observation["pointcloud/instance"] == own]
    together = {tuple(p) for p in points[:count]} & {tuple(p) for p in of_all}
    assert together


def test_normals_of_a_noisy_cloud_are_near_the_true_ones():
    # Points of the table: up is the truth.
    sensors = SensorConfig(cameras=(ABOVE,), depth_model="structured_light")
    observation = load(TARGET_POSE, "pointcloud", sensors).reset().observation
    points, normals = observation["pointcloud/points"], observation["pointcloud/normals"]
    # Away from the table's edge, the robot and the object.
    table = (np.abs(points[:, 2]) < 0.02) & (np.abs(points[:, 1]) > 0.4)
    table &= (np.abs(points[:, 1]) < 0.7) & (np.abs(points[:, 0] - 0.5) < 0.4)
    assert table.sum() > 300
    angle = np.degrees(np.arccos(np.clip(normals[table, 2], -1, 1)))
    assert np.median(angle) < 15


def test_the_cloud_of_three_cameras_is_quick():
    """Some 20 ms on one idle core; the bound allows for a busy machine."""
    environment = few_objects.load(*STORE, seed=0, obs_mode="pointcloud/points")
    environment.reset()
    task, times = environment.task, []
    for _ in range(4):
        task.forget_images()
        start = time.process_time()
        task.observables["pointcloud/points"](environment.physics)
        times.append(time.process_time() - start)
    assert min(times) < 0.2


def test_meshes_of_menagerie_show_in_pictures_and_not_to_sensors(monkeypatch, tmp_path):
    def seen():
        environment = load(TARGET_POSE, "state+rgb+depth+segmentation+pointcloud")
        environment.reset()
        return environment.step(hold(environment)).observation

    def meshes(visuals: Visuals = "primitive"):
        config = EnvConfig(
            "single_object/target_pose", "state", objects=("mug_000",), robot_visuals=visuals
        )
        environment = suite.make(config, 0)
        return environment.physics.model.nmesh, start_state(config, EpisodeSpec(0))[0].nmesh

    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    without, (plain, drawn) = seen(), meshes()
    assert drawn == plain
    monkeypatch.setenv("MENAGERIE_ROOT", str(write_menagerie(tmp_path)))
    observation, (measured, drawn) = seen(), meshes()
    assert {*without} == {*observation}
    for name, values in without.items():
        np.testing.assert_array_equal(observation[name], values, name)
    assert (measured, drawn) == (plain, plain + 1)
    assert meshes("menagerie")[0] == plain + 1
