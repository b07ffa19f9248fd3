"""Observed poses: of objects, handles, joints and goals, in every frame, with their symmetry."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from manipose_mj.assets.geometry import Joint
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_camera import camera_pose
from manipose_mj.poses import SymmetryGroup, compose, invert
from manipose_mj.tasks.goals import OrientationGoal, PoseGoal, TakenOutGoal, UprightGoal
from manipose_mj.tasks.observations.frames import goal_frames, joint_frame
from manipose_mj.tasks.observations.pose_observables import MAX_TURNS, padded_group
from tests.tasks.observed_scenes import EVERYTHING, STORE, TARGET_POSE, hold, load


@pytest.fixture(scope="module")
def store():
    return load(STORE, EVERYTHING)


def test_poses_are_those_of_the_simulator_in_every_frame(ideal):
    observation = ideal.reset().observation
    task, physics = ideal.task, ideal.physics
    obj = task.objects["object"]
    world = obj.label_pose(physics)
    np.testing.assert_allclose(observation["pose/object"], world, atol=1e-9)
    base = np.eye(4)  # the robot's base stands at the world's origin
    np.testing.assert_allclose(observation["pose/robot/object"], invert(base) @ world, atol=1e-9)
    model, data = physics.model.ptr, physics.data.ptr
    for index, camera in enumerate(("left", "above")):
        T_world_camera = camera_pose(model, data, camera)
        np.testing.assert_allclose(observation[f"camera/{camera}/pose"], T_world_camera)
        np.testing.assert_allclose(
            observation["pose/cameras/object"][index], invert(T_world_camera) @ world, atol=1e-9
        )


def test_the_symmetry_is_the_labels(ideal):
    for _ in range(3):
        observation = ideal.reset().observation
        group = ideal.task.objects["object"].asset.label.symmetry
        count = int(observation["pose/symmetry_count/object"][0])
        assert count == len(group.rotations)
        turns = observation["pose/symmetry/object"]
        np.testing.assert_allclose(turns[:count], group.rotations, atol=1e-12)
        assert not turns[count:].any()
        assert bool(observation["pose/axial/object"][0]) == group.axial


def test_the_bounds_hold_the_object_and_no_more(ideal):
    for _ in range(3):
        observation = ideal.reset().observation
        asset = ideal.task.objects["object"].asset
        meshes = [trimesh.load_mesh(f).vertices for f in asset.folder.glob("meshes/*_visual_*.obj")]
        vertices = (np.vstack(meshes) - asset.label.origin) @ asset.label.rotation
        lower, upper = observation["pose/bounds/object"]
        np.testing.assert_allclose(lower, vertices.min(axis=0), atol=2e-3)
        np.testing.assert_allclose(upper, vertices.max(axis=0), atol=2e-3)


def test_a_group_that_is_too_large_is_refused():
    turns = [np.eye(3)] * (MAX_TURNS + 1)
    with pytest.raises(InputError, match="gear: .* 25 rotations"):
        padded_group(SymmetryGroup(np.stack(turns)), "gear")


def test_the_handle_moves_as_its_joint_says(store):
    store.reset()
    physics, task = store.physics, store.task
    before = store.step(hold(store)).observation
    part = task.part
    low, high = part.joint.range
    physics.bind(task.furniture.joint(part.name)).qpos = low + 0.5 * (high - low)
    physics.forward()
    task.forget_images()
    after = {k: v(physics) for k, v in task.observables.items() if k.startswith("pose/")}
    axis = before["pose/joint"]
    np.testing.assert_allclose(after["pose/joint"], axis, atol=2e-3)
    way = float((after["pose/opening"] - before["pose/opening"])[0])
    assert part.joint.kind == "slide" and way > 0.05
    step = compose(np.eye(3), np.array([way, 0.0, 0.0]))
    expected = axis @ step @ invert(axis) @ before["pose/handle"]
    np.testing.assert_allclose(after["pose/handle"], expected, atol=1e-5)
    store.reset()


def test_frames_of_the_part_in_question_are_those_of_the_furniture(store):
    observation = store.reset().observation
    handle = store.task.part.handle
    body = store.physics.bind(store.task.furniture.mjcf_model.find("body", store.task.part.name))
    carrier = compose(np.array(body.xmat).reshape(3, 3), np.array(body.xpos))
    np.testing.assert_allclose(observation["pose/handle"], carrier @ handle.pose, atol=1e-9)
    cavity = store.task.cavity_pose(store.physics)
    np.testing.assert_allclose(observation["pose/cavity"], cavity, atol=1e-9)


def test_what_an_episode_does_not_have_is_zeros():
    environment = load(("articulated", "take_out_middle_drawer"), "pose+pointcloud+segmentation")
    seen = set()
    for _ in range(12):
        observation = environment.reset().observation
        there = "filler_0" in environment.task.objects
        seen.add(there)
        for key, value in observation.items():
            if "filler_0" in key.split("/") and "pointcloud" not in key:
                assert value.any() or not there or "axial" in key, key
            if "filler_0" in key.split("/") and not there:
                assert not value.any(), key
    assert seen == {True, False}


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (0, 1, 0), (1, 0, 0), (0.6, 0, 0.8)])
def test_joint_frames_are_right_handed_with_x_along_the_axis(axis):
    frame = joint_frame(Joint("hinge", np.ones(3), np.array(axis, float), (0.0, 1.0)))
    np.testing.assert_allclose(frame[:3, 0], axis, atol=1e-12)
    np.testing.assert_allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1)


def test_goals_say_what_counts(ideal):
    ideal.reset()
    objects = ideal.task.objects
    symmetry = objects["object"].asset.label.symmetry
    pose = compose(np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.2, 0.3]))

    def of(goal):
        return goal_frames([goal], objects)["object"]

    full = of(PoseGoal("object", pose))
    assert np.array_equal(full.pose, pose) and full.translation_counts and full.rotation_counts
    assert full.symmetry is symmetry
    turned = of(OrientationGoal("object", pose[:3, :3]))
    assert not turned.translation_counts and turned.rotation_counts
    assert not turned.pose[:3, 3].any()
    upright = of(UprightGoal("object"))
    assert np.array_equal(upright.pose[:3, 0], [0, 0, 1]) and upright.symmetry.axial
    assert np.linalg.det(upright.pose[:3, :3]) == pytest.approx(1)
    area = of(TakenOutGoal("object", "part", np.array([0.4, -0.1]), np.ones(2)))
    assert area.translation_counts and not area.rotation_counts
    np.testing.assert_allclose(area.pose[:3, 3], [0.4, -0.1, 0.0])


def test_the_goal_is_observed_where_the_task_wants_it():
    environment = load(TARGET_POSE, "pose")
    for _ in range(2):
        observation = environment.reset().observation
        goal = environment.task.goals[0]
        np.testing.assert_array_equal(observation["pose/goal"], goal.pose)
        assert observation["pose/counts/goal"].tolist() == [1, 1]
