"""Observations: what each mode shows, as declared; single keys; and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.tasks.observations.sensors import MODES, CameraView, PoseNoise, SensorConfig
from tests.tasks.observed_scenes import EVERYTHING, NOISY, SMALL, STORE, TARGET_POSE, hold, load


@pytest.mark.parametrize("sensors", [SMALL, NOISY], ids=["ideal", "noisy"])
@pytest.mark.parametrize("task", [TARGET_POSE, STORE], ids="/".join)
def test_observations_keep_to_their_declared_specs(task, sensors):
    environment = load(task, EVERYTHING, sensors)
    declared = environment.observation_spec()
    steps = [environment.reset()]
    steps += [environment.step(hold(environment)) for _ in range(3)]
    specs = environment.observation_spec()
    assert specs == declared
    for step in steps:
        assert set(step.observation) == set(specs)
        for name, value in step.observation.items():
            specs[name].validate(value)
            assert np.isfinite(value).all(), name


@pytest.mark.sample(3)
@pytest.mark.parametrize("mode", MODES)
def test_a_mode_shows_its_own_keys_and_images_their_cameras(mode):
    found = {key.split("/")[0] for key in load(TARGET_POSE, mode).observation_spec()}
    images = mode in ("rgb", "depth", "segmentation")
    assert found == {"panda" if mode == "state" else mode, *(["camera"] if images else [])}


def test_single_keys_may_stand_in_place_of_modes():
    keys = {"panda/tcp_pose", "pose/object", "depth/above", "pointcloud/object/points"}
    assert set(load(TARGET_POSE, "+".join(sorted(keys))).observation_spec()) == keys


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ("observations", "near"),
    [
        ("state+pos", "did you mean pose"),
        ("rgbd", "did you mean rgb"),
        ("", "known: .*pointcloud"),
        ("pose/objct", "pose/object"),
        ("depth/abov", "depth/above"),
        ("panda/tcp", "panda/tcp_pose"),
        ("pointcloud/object/point", "pointcloud/object/points"),
    ],
)
def test_unknown_modes_and_keys_are_refused_with_the_nearest(observations, near):
    with pytest.raises(InputError, match=near) as caught:
        load(TARGET_POSE, observations)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ({"cameras": ("lft",)}, "unknown camera 'lft'; did you mean left"),
        ({"cameras": ("left", "left")}, "named 2 times"),
        ({"cameras": "left"}, "expected a tuple of cameras"),
        (
            {"cameras": (CameraView("left", (1, 0, 1), (0, 0, 0)),)},
            "the scene has one of that name",
        ),
        ({"cameras": ()}, "need a camera"),
        ({"height": 0}, "height is 0"),
        ({"width": 2.5}, "width is 2.5"),
        ({"width": 100_000}, "width is 100000; expected at most 8192 pixels"),
        ({"object_cloud_size": -1}, "object_cloud_size is -1"),
        ({"depth_model": "kinect"}, "unknown depth model 'kinect'; known: ideal, structured_light"),
        ({"renderer": "rays"}, "did you mean ray"),
    ],
)
def test_wrong_sensors_are_refused(sensors, message):
    with pytest.raises(InputError, match=message) as caught:
        load(TARGET_POSE, "rgb", SensorConfig(**sensors))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a b", (0, 0, 1), (0, 0, 0)), "letters, digits"),
        (("", (0, 0, 1), (0, 0, 0)), "letters, digits"),
        (("a", (0, 0, 1), (0, 0, 1)), "two different points"),
        (("a", (0, 0), (0, 0, 1)), "two different points"),
        (("a", (0, 0, np.nan), (0, 0, 1)), "two different points"),
        (("a", (0, 0, 1), (0, 0, 0), 180.0), "fovy 180"),
    ],
)
def test_impossible_cameras_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        CameraView(*arguments)


@pytest.mark.parametrize("noise", [(-0.1, 0.0), (0.0, np.nan), (np.inf, 0.0)])
def test_impossible_noise_is_refused(noise):
    with pytest.raises(InputError, match="pose noise"):
        PoseNoise(*noise)
