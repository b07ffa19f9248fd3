"""Every task's sensors: specs, shapes, and that they show what is there, and nothing else."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from dm_control import composer, mjcf

from manipose_mj import suite
from manipose_mj.mjcf.cameras.ray_camera import RayCamera, camera_intrinsics, camera_pose
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import compose, invert, transform
from manipose_mj.tasks.articulated.take_out import TakeOut
from manipose_mj.tasks.clutter.task import Clutter
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.observations.sensors import SensorConfig
from tests.few_objects import load
from tests.tasks.contact import touches_robot
from tests.tasks.episode_driver import HOLD, hold, reset, wander

EVERYTHING = "state+pose+depth+segmentation+pointcloud"
SENSORS = SensorConfig(height=60, width=80, cloud_size=4096)
TARGET_POSE = ("single_object", "target_pose")
STORE = ("articulated", "store_chips_can_middle_drawer")
POINT_TOLERANCE = 0.005  # of the object's bounding box around its points [m]


@pytest.fixture(scope="module", params=suite.ALL_TASKS, ids="/".join)
def environment(request) -> composer.Environment:
    """One environment a task, with every sensor; tests reset it themselves."""
    return load(*request.param, seed=0, obs_mode=EVERYTHING, sensors=SENSORS)


@pytest.mark.sample(4)
def test_observations_are_as_declared_and_finite(environment):
    reset(environment, 4)
    specs = environment.observation_spec()
    steps = [environment.reset(), *(environment.step(a) for a in wander(environment, 5, 0))]
    for step in steps:
        assert set(step.observation) == set(specs)
        for name, value in step.observation.items():
            specs[name].validate(value)
            assert np.isfinite(value).all(), name
    for step in steps[1:]:
        environment.reward_spec().validate(np.asarray(step.reward))


@pytest.mark.sample(3)
def test_every_mode_has_its_shapes_and_types(environment):
    observation = environment.reset().observation
    image, cloud = (SENSORS.height, SENSORS.width), SENSORS.cloud_size
    for camera in SENSORS.cameras:
        assert observation[f"depth/{camera}"].shape == image
        assert observation[f"depth/{camera}"].dtype == np.float32
        assert observation[f"segmentation/{camera}"].shape == image
        assert np.issubdtype(observation[f"segmentation/{camera}"].dtype, np.integer)
    assert observation["pointcloud/points"].shape == (cloud, 3)
    assert observation["pointcloud/normals"].shape == (cloud, 3)
    assert observation["pointcloud/instance"].shape == (cloud,)
    for name in environment.task.objects:
        assert observation[f"pose/{name}"].shape == (4, 4)
    assert observation["panda/joint_positions"].shape == (7,)
    assert observation["panda/tcp_pose"].shape == (7,)


@pytest.mark.sample(2)
@pytest.mark.parametrize("mode", ["state", "pose", "depth", "segmentation", "pointcloud"])
def test_only_the_modes_asked_for_are_shown(mode):
    observation = load(*STORE, seed=0, obs_mode=mode, sensors=SENSORS).reset().observation
    found = {name.split("/")[0] for name in observation} - {"camera"}  # images bring their cameras
    assert found == {"panda" if mode == "state" else mode}


@pytest.mark.sample(3)
def test_instances_name_what_segmentation_shows(environment):
    task = reset(environment, 0)
    assert task.instance_names[0] == "background" and "robot" in task.instance_names
    frames = {
        mjcf.get_attachment_frame(e.mjcf_model).full_identifier for e in task.objects.values()
    }
    assert {frame.rstrip("/") for frame in frames} <= set(task.instance_names)


def test_unused_objects_stay_parked_and_out_of_sight():
    cameras = ("front", "left", "right", "overview", "panda/wrist")
    sensors = SensorConfig(cameras=cameras, height=60, width=80)
    environment = load(*TARGET_POSE, seed=0, obs_mode="segmentation", sensors=sensors)
    for seed in range(3):
        task = reset(environment, seed)
        hold(environment, 0.2)
        observation = environment.step(HOLD).observation
        active = task.instance_names.index(task.object.mjcf_model.model)
        seen = {
            int(i) for camera in cameras for i in np.unique(observation[f"segmentation/{camera}"])
        }
        assert seen <= {0, task.instance_names.index("robot"), active}
        assert active in seen
        for index, entity in enumerate(task.pool.entities):
            if entity is not task.object:
                pose = entity.object_pose(environment.physics)
                parked = compose(np.eye(3), np.array([index, 0.0, 50.0]))
                # All but weightless: the frame that carries an object weighs 10 mg.
                np.testing.assert_allclose(pose, parked, atol=0.05)


def test_the_goal_marker_is_neither_seen_nor_touched():
    environment = load(*TARGET_POSE, seed=0, obs_mode="depth", sensors=SENSORS)
    task = reset(environment, 2)
    marker = task.scene.fixtures["goal"]
    before = environment.step(HOLD).observation["depth/front"]
    physics = environment.physics
    marker.place(physics, task.object.label_pose(physics))
    after = environment.step(HOLD).observation["depth/front"]
    np.testing.assert_allclose(after, before, atol=1e-4)
    assert not touches_robot(task, physics, marker)


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", [2, 3])
def test_the_objects_points_lie_on_the_object(environment, seed):
    task = reset(environment, seed)
    step = environment.step(HOLD)
    obj = _in_sight(task, environment.physics)
    own = task.instance_names.index(obj.mjcf_model.model)
    cloud = step.observation["pointcloud/points"][step.observation["pointcloud/instance"] == own]
    assert len(cloud) > 20
    _assert_on(obj, environment.physics, cloud)
    normals = step.observation["pointcloud/normals"][step.observation["pointcloud/instance"] == own]
    lengths = np.linalg.norm(normals, axis=1)
    assert ((np.abs(lengths - 1) < 1e-3) | (lengths == 0)).all()
    spread = cloud.max(axis=0) - cloud.min(axis=0)
    assert spread.max() > 0.4 * obj.asset.label.extents.max()


def _in_sight(task: ManipulationTask, physics: mjcf.Physics) -> RigidObject:
    """The object that an episode is about, where cameras can see it at the start."""
    obj = task.objects.get("object")
    if obj is None or isinstance(task, TakeOut):
        pytest.skip("nothing lies in sight: there is furniture only, or the object is in it")
    if isinstance(task, Clutter):  # something large and high up
        height = {e: e.label_pose(physics)[2, 3] for e in task.objects.values()}
        return max(height, key=lambda e: height[e] * e.asset.label.extents.prod())
    return obj


def _assert_on(obj, physics, points_world: np.ndarray) -> None:
    points = transform(invert(obj.label_pose(physics)), points_world)
    outside = np.maximum(np.abs(points) - obj.asset.label.extents / 2, 0.0)
    assert np.linalg.norm(outside, axis=1).max() < POINT_TOLERANCE


@pytest.mark.sample(3)
def test_depth_and_segmentation_are_of_the_same_picture(environment):
    task = reset(environment, 6)
    environment.step(HOLD)
    observation = environment.step(HOLD).observation
    physics, obj = environment.physics, _in_sight(task, environment.physics)
    own = task.instance_names.index(obj.mjcf_model.model)
    model, data = physics.model.ptr, physics.data.ptr
    found = 0
    for camera in SENSORS.cameras:
        depth, ids = observation[f"depth/{camera}"], observation[f"segmentation/{camera}"]
        assert ids.min() >= 0 and ids.max() < len(task.instance_names)
        assert (depth[ids > 0] > 0).all()
        intrinsics = camera_intrinsics(
            model, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera), *depth.shape
        )
        slopes = intrinsics.slopes()
        mask = ids == own
        found += mask.sum()
        points = np.concatenate([slopes, np.ones_like(slopes[..., :1])], -1)[mask]
        points = points * depth[mask][:, None]
        if mask.any():
            _assert_on(obj, physics, transform(camera_pose(model, data, camera), points))
    assert found > 20


@pytest.mark.sample(3)
def test_images_are_of_now_even_right_after_a_reset(environment):
    camera = RayCamera(SENSORS.height, SENSORS.width)
    for seed in (1, 2):
        environment.random_state.seed(seed)
        shown = environment.reset().observation["depth/front"]
        physics = environment.physics
        fresh = camera.render(physics.model.ptr, physics.data.ptr, "front").depth
        np.testing.assert_array_equal(shown, fresh)
