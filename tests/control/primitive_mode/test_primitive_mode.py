"""The `primitive` mode: a step is a planned motion, carried out to its end."""

from __future__ import annotations

import pickle

import dm_env
import numpy as np
import pytest

from manipose_mj.actions import control_mode
from manipose_mj.assets import catalogue
from manipose_mj.control.conversion.recording import acting
from manipose_mj.control.primitive_mode.environment import (
    STATUS,
    PrimitiveConfig,
    PrimitiveEnvironment,
)
from manipose_mj.control.primitive_mode.tcp_primitives import Status
from manipose_mj.errors import InputError
from manipose_mj.poses import invert, pose_to_vector, rotation_about, rotation_angle
from manipose_mj.tasks.core import snapshot
from tests.few_objects import load

MOVE, GRASP, RELEASE = 0.0, 1.0, 2.0
SEED = 0


@pytest.fixture(scope="module")
def built() -> PrimitiveEnvironment:
    objects = [catalogue.load("box", 0)]
    environment = load(
        "single_object", "target_pose", seed=0, obs_mode="state+pose", objects=objects
    )
    return PrimitiveEnvironment(environment, PrimitiveConfig(max_primitives=4))


@pytest.fixture
def primitives(built: PrimitiveEnvironment) -> PrimitiveEnvironment:
    built.environment.random_state.seed(SEED)
    built.reset()
    return built


def _tcp(primitives: PrimitiveEnvironment) -> np.ndarray:
    return primitives.task.robot.tcp_pose(primitives.physics)


def _take(primitives: PrimitiveEnvironment) -> dm_env.TimeStep:
    """Take the box by one of its grasps, whichever there is a way to."""
    obj = primitives.task.objects["object"]
    poses = obj.object_pose(primitives.physics) @ obj.asset.grasps.poses
    for pose in poses[np.argsort(poses[:, 2, 2], kind="stable")]:  # from above first
        timestep = primitives.step(np.append(GRASP, pose_to_vector(pose)))
        if timestep.observation[STATUS] != Status.NO_PLAN:
            return timestep
    raise AssertionError("no grasp could be planned")


def _at_goal(primitives: PrimitiveEnvironment) -> np.ndarray:
    """`T_world_tcp` that brings the held object to its goal, a little above the table."""
    obj, (goal,) = primitives.task.objects["object"], primitives.task.goals
    pose = goal.pose @ invert(obj.label_pose(primitives.physics)) @ _tcp(primitives)
    pose[2, 3] += 0.002
    return pose


def test_specs(primitives):
    spec = primitives.action_spec()
    assert spec.shape == (8,) and spec.name == "primitive"
    np.testing.assert_array_equal(spec.minimum[[0, 4]], [0, -1])
    assert spec.maximum[0] == 2
    observation = primitives.reset().observation
    for name, each in primitives.observation_spec().items():
        each.validate(observation[name])
    assert primitives.reward_spec() is not None and primitives.discount_spec() is not None


def test_a_grasp_and_a_release_are_a_success_and_repeat_bit_for_bit(primitives):
    ends = []
    for _ in range(2):
        primitives.environment.random_state.seed(SEED)
        primitives.reset()
        taken = _take(primitives)
        assert taken.observation[STATUS] == Status.DONE and taken.mid()
        placed = primitives.step(np.append(RELEASE, pose_to_vector(_at_goal(primitives))))
        assert placed.observation[STATUS] == Status.DONE
        assert placed.reward == 1.0 and primitives.task.success_now
        ends.append(primitives.physics.get_state())
    np.testing.assert_array_equal(*ends)


@pytest.mark.full
def test_an_episode_goes_on_from_a_saved_state_bit_for_bit(primitives):
    environment = primitives.environment
    assert _take(primitives).observation[STATUS] == Status.DONE
    saved = primitives.save()
    with pytest.raises(InputError, match="its own methods save and restore"):
        snapshot.save(primitives)
    action = np.append(RELEASE, pose_to_vector(_at_goal(primitives)))
    ends = []
    for _ in range(2):
        assert primitives.step(action).observation[STATUS] == Status.DONE
        ends.append(primitives.physics.get_state())
        environment.random_state.seed(SEED + 1)
        primitives.reset()
        for _ in range(4):  # so that an episode is over, as the one that is restored is not
            ended = primitives.step([0, 1.3, 1.3, 1.3, 1, 0, 0, 0])
        assert ended.last()
        observation = primitives.restore(saved)
        assert observation[STATUS] == Status.DONE
    np.testing.assert_array_equal(*ends)


def test_wrapping_and_pickling_draw_no_random_numbers(built):
    built.environment.random_state.seed(3)
    twin = pickle.loads(pickle.dumps(built))
    twin.reset()
    built.reset()
    np.testing.assert_array_equal(twin.physics.get_state(), built.physics.get_state())


def test_move_to_brings_the_tcp_there_with_and_without_a_load(primitives):
    goal = _tcp(primitives)
    goal[:3, 3] += [0.03, 0.2, 0.1]
    goal[:3, :3] = rotation_about(np.array([0.0, 0, 1]), 0.5) @ goal[:3, :3]
    for loaded in (False, True):
        if loaded:
            assert _take(primitives).observation[STATUS] == Status.DONE
        timestep = primitives.step(np.append(MOVE, pose_to_vector(goal)))
        assert timestep.observation[STATUS] == Status.DONE
        here = _tcp(primitives)
        np.testing.assert_allclose(here[:3, 3], goal[:3, 3], atol=2e-3)
        assert rotation_angle(here[:3, :3], goal[:3, :3]) < 0.02
    obj = primitives.task.objects["object"].object_pose(primitives.physics)
    assert np.linalg.norm(obj[:3, 3] - goal[:3, 3]) < 0.15  # it came along


@pytest.mark.parametrize(
    ("kind", "position"), [(MOVE, (1.2, 0, 0.3)), (MOVE, (0.5, 0, -0.2)), (GRASP, (0.5, 0, -0.2))]
)
def test_what_cannot_be_planned_moves_nothing(primitives, kind, position):
    before = primitives.physics.get_state()
    pose = _tcp(primitives)
    pose[:3, 3] = position
    timestep = primitives.step(np.append(kind, pose_to_vector(pose)))
    assert timestep.observation[STATUS] == Status.NO_PLAN
    assert timestep.mid() and timestep.reward == 0.0 and timestep.discount == 1.0
    np.testing.assert_array_equal(primitives.physics.get_state(), before)


def test_closing_on_nothing_is_told(primitives):
    pose = _tcp(primitives)
    timestep = primitives.step(np.append(GRASP, pose_to_vector(pose)))
    assert timestep.observation[STATUS] == Status.LOST


def test_an_episode_ends_after_so_many_primitives_and_the_next_begins(primitives):
    pose = _tcp(primitives)
    pose[:3, 3] = 1.2, 0.0, 0.3
    steps = [primitives.step(np.append(MOVE, pose_to_vector(pose))) for _ in range(5)]
    assert [step.last() for step in steps] == [False, False, False, True, False]
    assert steps[3].discount == 1.0 and steps[4].first()
    assert steps[4].observation[STATUS] == Status.DONE


def test_an_episode_ends_with_the_tasks_horizon(primitives, monkeypatch):
    monkeypatch.setattr(primitives.environment, "_time_limit", 0.3)
    pose = _tcp(primitives)
    pose[:3, 3] += [0.0, 0.3, 0.0]
    timestep = primitives.step(np.append(MOVE, pose_to_vector(pose)))
    assert timestep.last() and timestep.observation[STATUS] == Status.STOPPED


@pytest.mark.parametrize(
    "action",
    [
        np.zeros(7),
        np.full(8, np.nan),
        "up",
        np.array([0, 0.4, 0, 0.3, 0, 0, 0, 0]),
        np.array([0, 0.4, 0, 0.3, 0, 1, 0, 0]) + 0j,
    ],
)
def test_bad_actions_are_refused_in_one_line(primitives, action):
    with pytest.raises(InputError, match="primitive expects 8 finite numbers") as refused:
        primitives.step(action)
    assert "\n" not in str(refused.value)


def test_another_mode_underneath_is_refused(built):
    with (
        acting(built.environment, "pd_ee_pose", SEED),
        pytest.raises(InputError, match="in pd_ee_pose"),
    ):
        PrimitiveEnvironment(built.environment)
    assert control_mode("pd_joint_pos").name == built.task.control_mode.name
