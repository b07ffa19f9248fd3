"""Errors that stay the same throughout an episode: their size, what they reach, and that they change no start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.depth_noise import KINECT, measure
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics, camera_pose
from manipose_mj.poses import invert, pose_error, rotation_angle, transform
from manipose_mj.tasks.observations.fixed_error import FixedError
from manipose_mj.tasks.observations.sensor_config import SensorConfig
from tests import few_objects
from tests.tasks.observed_scenes import SMALL, TARGET_POSE, hold, load

ERROR = FixedError(0.02, 0.2)


def test_an_error_has_its_size_and_goes_the_same_way_whatever_that_is():
    drawn = [FixedError(0.01 * k, 0.1 * k).drawn(7, "object") for k in (1, 2)]
    for k, pose in enumerate(drawn, start=1):
        assert np.linalg.norm(pose[:3, 3]) == pytest.approx(0.01 * k)
        assert rotation_angle(pose[:3, :3], np.eye(3)) == pytest.approx(0.1 * k)
    np.testing.assert_allclose(2 * drawn[0][:3, 3], drawn[1][:3, 3])
    others = [ERROR.drawn(8, "object"), ERROR.drawn(7, "other")]
    assert not any(np.allclose(ERROR.drawn(7, "object"), other) for other in others)
    axial = ERROR.drawn(7, "object", axial=True)
    assert np.arccos(axial[0, 0]) == pytest.approx(0.2), "a share of the angle is a symmetry"


def test_an_error_is_not_negative():
    with pytest.raises(InputError, match="rotation is -1"):
        FixedError(0.0, -1.0)


def test_numbers_of_numpy_are_sizes():
    assert SensorConfig(camera_error=FixedError(rotation=np.deg2rad(1.0))).camera_error
    assert not FixedError(np.float64(0.0), np.float64(0.0))


def test_observed_poses_are_off_by_the_same_in_every_step_and_starts_are_the_same():
    plain = load(TARGET_POSE, "pose", SMALL, seed=3)
    wrong = load(TARGET_POSE, "pose", replace(SMALL, pose_error=ERROR), seed=3)
    plain.reset()
    first = wrong.reset()
    np.testing.assert_array_equal(plain.physics.data.qpos, wrong.physics.data.qpos)
    seen = [first, wrong.step(hold(wrong))]
    obj = wrong.task.object
    true = obj.label_pose(wrong.physics)
    shift, turn = pose_error(seen[-1].observation["pose/object"], true, obj.asset.label.symmetry)
    assert (float(shift), float(turn)) == pytest.approx((0.02, 0.2))
    errors = [invert(true) @ step.observation["pose/object"] for step in seen]
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-3)  # it has hardly moved
    np.testing.assert_array_equal(
        seen[-1].observation["pose/goal"], wrong.task.goals[0].pose, "goals are exact"
    )


def test_a_wrong_calibration_moves_clouds_and_leaves_images():
    plain = load(TARGET_POSE, "depth+pointcloud", SMALL, seed=3).reset().observation
    wrong = load(TARGET_POSE, "depth+pointcloud", replace(SMALL, camera_error=ERROR), seed=3)
    seen = wrong.reset().observation
    np.testing.assert_array_equal(seen["depth/left"], plain["depth/left"])
    stated = seen["camera/left/pose"]
    model, data = wrong.physics.model.ptr, wrong.physics.data.ptr
    np.testing.assert_allclose(plain["camera/left/pose"], camera_pose(model, data, "left"))
    error = invert(plain["camera/left/pose"]) @ stated
    assert np.linalg.norm(error[:3, 3]) == pytest.approx(0.02)
    # Cameras follow one another in a cloud: the first points are the first camera's.
    own = slice(0, 200)
    change = stated @ invert(plain["camera/left/pose"])
    moved = transform(change, plain["pointcloud/points"][own])
    np.testing.assert_allclose(seen["pointcloud/points"][own], moved, atol=1e-5)
    turned = plain["pointcloud/normals"][own] @ change[:3, :3].T
    np.testing.assert_allclose(seen["pointcloud/normals"][own], turned, atol=1e-5)
    np.testing.assert_array_equal(seen["pointcloud/colours"][own], plain["pointcloud/colours"][own])


def test_poses_in_a_cameras_frame_follow_its_stated_pose():
    wrong = load(TARGET_POSE, "pose+depth", replace(SMALL, camera_error=ERROR), seed=3)
    seen = wrong.reset().observation
    for index, camera in enumerate(wrong.task.env_config.sensors.camera_names):
        for name in ("object", "goal"):
            stated = seen[f"camera/{camera}/pose"] @ seen[f"pose/cameras/{name}"][index]
            np.testing.assert_allclose(stated, seen[f"pose/{name}"], atol=1e-9)


def test_depth_noise_grows_with_its_factor():
    rng = np.random.default_rng(0)
    depth, cosine = np.full((60, 80), 0.8), np.ones((60, 80))
    intrinsics = Intrinsics(80, 60, 70.0, 70.0, 40.0, 30.0)
    deviations = []
    for noise in (1.0, 4.0):
        measured = measure(depth, cosine, intrinsics, rng, replace(KINECT, noise=noise)).depth
        deviations.append(np.std(measured[measured > 0]))
    assert deviations[1] == pytest.approx(4 * deviations[0], rel=0.15)


def test_late_servos_follow_later_by_the_latency():
    arrivals = []
    for latency in (0.0, 0.2):
        environment = few_objects.load(*TARGET_POSE, seed=0, obs_mode="state", latency=latency)
        environment.reset()
        action = hold(environment)
        action[0] += 0.05
        first = environment.task.robot.configuration(environment.physics)[0][0]
        for step in range(1, 60):
            environment.step(action)
            moved = environment.task.robot.configuration(environment.physics)[0][0] - first
            if moved > 0.025:
                arrivals.append(step * environment.task.control_timestep)
                break
    assert arrivals[1] - arrivals[0] == pytest.approx(0.2, abs=0.021)


def test_a_latency_is_not_negative():
    with pytest.raises(InputError, match="latency is -1"):
        few_objects.config("/".join(TARGET_POSE), latency=-1.0)


@pytest.mark.parametrize("error", ["pose_error", "camera_error"])
def test_batched_worlds_refuse_errors_that_they_would_not_make(error):
    sensors = replace(SMALL, **{error: ERROR})
    config = few_objects.config("/".join(TARGET_POSE), obs_mode="pose", sensors=sensors)
    with pytest.raises(InputError, match="no errors of poses or cameras"):
        draw_pool(config, (0,))
