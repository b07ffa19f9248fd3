"""Noise of observed poses, images and clouds: its size, and that it replays and changes no episode."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.mjcf.cameras.depth_noise import StructuredLight
from manipose_mj.mjcf.cameras.ray_camera import camera_pose
from manipose_mj.poses import invert, rotation_angle, transform
from manipose_mj.tasks.core.snapshot import restore, save
from manipose_mj.tasks.observations.sensors import CameraView, SensorConfig
from tests.tasks.observed_scenes import ABOVE, EVERYTHING, NOISY, STORE, TARGET_POSE, hold, load


def test_pose_noise_has_the_size_that_was_set_and_spares_goals():
    environment = load(TARGET_POSE, "pose", NOISY)
    environment.reset()
    shifts, turns = [], []
    for _ in range(150):
        observation = environment.step(hold(environment)).observation
        true = environment.task.object.label_pose(environment.physics)
        seen = observation["pose/object"]
        shifts.append(seen[:3, 3] - true[:3, 3])
        turns.append(rotation_angle(seen[:3, :3], true[:3, :3]))
        np.testing.assert_allclose(seen[:3, :3] @ seen[:3, :3].T, np.eye(3), atol=1e-9)
        np.testing.assert_array_equal(observation["pose/goal"], environment.task.goals[0].pose)
        # One error a moment: all frames tell of the same pose.
        camera = observation["pose/cameras/object"][0]
        T_world_camera = camera_pose(
            environment.physics.model.ptr, environment.physics.data.ptr, "left"
        )
        np.testing.assert_allclose(T_world_camera @ camera, seen, atol=1e-9)
    assert np.std(shifts) == pytest.approx(0.004, rel=0.12)
    assert np.abs(np.mean(shifts, axis=0)).max() < 4 * 0.004 / np.sqrt(150)
    # Of a vector with three normal components the mean square is three times the variance.
    assert np.sqrt(np.mean(np.square(turns)) / 3) == pytest.approx(0.02, rel=0.12)


def test_noisy_episodes_replay_bit_for_bit_and_differ_from_each_other():
    first, second = (load(STORE, EVERYTHING, NOISY, seed=5) for _ in range(2))
    one, other = first.reset(), second.reset()
    before = one.observation
    for _ in range(3):
        for name, value in one.observation.items():
            assert np.array_equal(value, other.observation[name]), name
        one, other = first.step(hold(first)), second.step(hold(second))
    for name in ("depth/left", "pose/object"):
        assert not np.array_equal(one.observation[name], before[name]), name


def test_noise_comes_back_with_a_snapshot():
    environment = load(TARGET_POSE, "pose+depth", NOISY, seed=5)
    environment.reset()
    environment.step(hold(environment))
    saved = save(environment)
    still = hold(environment)
    after = environment.step(still).observation
    environment.reset()
    restore(environment, saved)
    for name, value in environment.step(still).observation.items():
        np.testing.assert_array_equal(value, after[name], name)


def test_what_is_observed_changes_no_episode():
    blind, seeing = load(TARGET_POSE, "state"), load(TARGET_POSE, EVERYTHING, NOISY)
    for _ in range(3):
        blind.reset(), seeing.reset()
        for _ in range(3):
            blind.step(hold(blind)), seeing.step(hold(seeing))
        assert np.array_equal(blind.physics.data.qpos, seeing.physics.data.qpos)


@pytest.mark.parametrize("task", [TARGET_POSE, STORE], ids="/".join)
def test_structured_light_reaches_depth_outlines_and_cloud(task):
    # From near, where an outline strays by half a pixel; from afar it does by less than one shows.
    close = (CameraView("close", (0.1, -1.1, 0.5), (0.45, -0.1, 0.05), 22.0),)
    shown = "depth+segmentation+pointcloud"
    exact, rough = (
        load(task, shown, SensorConfig(cameras=close, depth_model=model), seed=2)
        .reset()
        .observation
        for model in ("ideal", "structured_light")
    )
    depth, measured = exact["depth/close"], rough["depth/close"]
    both = (depth > 0) & (measured > 0)
    assert 0.0005 < np.median(np.abs(measured - depth)[both]) < 0.01
    assert 0.5 < (measured > 0).mean() < (depth > 0).mean()
    ids, moved = exact["segmentation/close"], rough["segmentation/close"]
    assert 10 < (ids != moved).sum() < 0.05 * ids.size
    for observation in (exact, rough):
        # A point of the cloud is a pixel's: it has its camera's depth and instance.
        instance = observation["pointcloud/instance"]
        points = observation["pointcloud/points"][instance >= 0].astype(float)
        seen = transform(invert(observation["camera/close/pose"]), points)
        k = observation["camera/close/intrinsics"]
        column, row = np.rint((seen @ k.T)[:, :2] / seen[:, 2:]).astype(int).T
        np.testing.assert_allclose(observation["depth/close"][row, column], seen[:, 2], atol=1e-5)
        same = observation["segmentation/close"][row, column] == instance[instance >= 0]
        assert same.all() and len(same) > 5000


def test_a_sensor_of_ones_own():
    sensor = StructuredLight(near=3.0)
    sensors = SensorConfig(cameras=(ABOVE,), height=30, width=40, depth_model=sensor)
    assert not load(TARGET_POSE, "depth", sensors).reset().observation["depth/above"].any()
