"""Objects and furniture in a task: still when left alone, moved by a pull, a success where they belong."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from dm_control import composer

from manipose_mj.poses import compose, invert, rotation_about, transform
from manipose_mj.tasks.core.task import ManipulationTask
from tests.few_objects import load
from tests.tasks.episode_driver import HOLD, hold, reset


@pytest.fixture(scope="module")
def target_pose() -> composer.Environment:
    return load("single_object", "target_pose", seed=0, obs_mode="state")


@pytest.fixture(scope="module")
def store() -> composer.Environment:
    return load("articulated", "store_chips_can_middle_drawer", seed=0, obs_mode="pose")


def test_friction_is_held_by_the_cone_alone(target_pose, store):
    for environment in (target_pose, store):
        option = environment.physics.model.opt
        assert (option.noslip_iterations, option.impratio) == (0, 100.0)


def test_every_built_in_object_stays_where_it_is_put(target_pose):
    seen = set()
    for seed in range(10):
        task = reset(target_pose, seed)
        before = task.object.object_pose(target_pose.physics)
        hold(target_pose, 5.0)
        after = task.object.object_pose(target_pose.physics)
        corners = transform(task.object.asset.label.pose, _corners(task.object.asset.label.extents))
        moved = np.linalg.norm(transform(after, corners) - transform(before, corners), axis=1)
        assert moved.max() < 1e-3, (task.object_name, seed)
        seen.add(task.object_name)
    assert len(seen) >= 5


def _corners(extents: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), -1).reshape(-1, 3) * extents


def test_the_object_set_down_at_its_goal_is_a_success(target_pose):
    task = reset(target_pose, 0)
    physics = target_pose.physics
    assert task.goal_error(physics)[0] > 0.1
    task.object.place(physics, task.goals[0].pose @ invert(task.object.asset.label.pose))
    hold(target_pose, 0.3)
    step = target_pose.step(HOLD)
    assert step.reward == 1.0 and task.success_once
    translation, rotation = task.goal_error(physics)
    assert translation < 0.002 and rotation < np.radians(1)
    away = compose(np.eye(3), np.array([0.0, 0.05, 0.0]))
    task.object.place(physics, away @ task.object.object_pose(physics))
    assert target_pose.step(HOLD).reward == 0.0
    assert task.success_once and not task.succeeded(physics)


def test_the_can_lying_in_the_shut_drawer_is_a_success(store):
    task = reset(store, 3)
    physics, part = store.physics, task.part
    radius = task.object.asset.label.extents[1] / 2
    along = int(np.argmax(part.cavity.extents[:2]))
    lying = rotation_about(np.array([0.0, 0.0, 1.0]), along * np.pi / 2)
    height = radius - part.cavity.extents[2] / 2 + 0.001
    in_cavity = compose(lying, np.array([0.0, 0.0, height]))
    label = task.cavity_pose(physics) @ in_cavity
    task.object.place(physics, label @ invert(task.object.asset.label.pose))
    hold(store, 1.0)
    assert store.step(HOLD).reward == 1.0
    joint = physics.bind(task.furniture.joint(part.name))
    joint.qpos = part.joint.range[0] + 0.02
    assert store.step(HOLD).reward == 0.0


def test_furniture_stays_shut_untouched(store):
    task = reset(store, 1)
    hold(store, 5.0)
    for part in task.furniture.asset.parts:
        gap = task.furniture.opening(store.physics, part.name) - part.joint.range[0]
        assert abs(gap) < 1e-3, part.name


@pytest.mark.parametrize("name", ["top_drawer", "middle_drawer", "bottom_drawer", "door"])
def test_furniture_opens_under_15_newtons_at_its_handle_and_not_under_a_breath(store, name):
    task = reset(store, 2)
    part = task.furniture.asset.part(name)
    low, high = part.joint.range
    assert (_pulled(store, task, name, 0.5) - low) < 0.02 * (high - low)
    assert (_pulled(store, task, name, 15.0) - low) > 0.8 * (high - low)


def _pulled(store: composer.Environment, task: ManipulationTask, name: str, force: float) -> float:
    """The joint's position after 3 s of a pull [N] outwards at the handle's centre."""
    physics = store.physics
    model, data = physics.model.ptr, physics.data.ptr
    body = int(physics.bind(task.furniture.mjcf_model.find("body", name)).element_id)
    for _ in range(150):
        handle = task.furniture.handle_pose(physics, name)
        data.qfrc_applied[:] = 0
        mujoco.mj_applyFT(
            model, data, force * handle[:3, 1], np.zeros(3), handle[:3, 3], body, data.qfrc_applied
        )
        store.step(HOLD)
    data.qfrc_applied[:] = 0
    return task.furniture.opening(physics, name)
