"""Gymnasium's own checker over every id; pickling, workers, failures, pictures, wrong input."""

from __future__ import annotations

import pickle
import re
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils.env_checker import check_env

from manipose_mj import suite
from manipose_mj.actions import CONTROL_MODES
from manipose_mj.errors import InputError
from manipose_mj.gym import ManiPoseEnv, env_id, register_envs
from manipose_mj.tasks.goals import PoseGoal
from manipose_mj.tasks.observations.sensors import MODES, SensorConfig
from tests.conformance.own_tasks import FATAL_STEP, diverging, forget, registered
from tests.few_objects import few

ID = "manipose_mj/TargetPose-v0"
OBJECTS = few("single_object/target_pose")
SENSORS = SensorConfig(cameras=("front",), height=24, width=32, cloud_size=256)


@pytest.fixture(scope="module")
def env() -> ManiPoseEnv:
    return gymnasium.make(ID, reward_mode="dense", objects=OBJECTS).unwrapped


@pytest.mark.sample(2)
@pytest.mark.parametrize("task", suite.ALL_TASKS, ids="/".join)
def test_the_environment_checker_is_content(task):
    made = gymnasium.make(env_id(task[1]), objects=few("/".join(task)), normalise_actions=True)
    _check(made.unwrapped)


@pytest.mark.sample(2)
@pytest.mark.parametrize("mode", [*CONTROL_MODES, "primitive"])
def test_the_checker_is_content_with_control_modes(mode):
    options = {"obs_mode": "state", "objects": OBJECTS, "normalise_actions": True}
    _check(gymnasium.make(ID, control_mode=mode, **options).unwrapped)


def test_a_wrong_action_is_told_with_the_control_mode_that_was_chosen():
    env = ManiPoseEnv(
        "single_object/target_pose", control_mode="primitive", obs_mode="state", objects=OBJECTS
    )
    env.reset(seed=0)
    with pytest.raises(InputError, match="; primitive expects 8 finite numbers"):
        env.step(np.zeros(3))
    env.close()


@pytest.mark.parametrize(
    ("task", "said"),
    [
        ("target_pose", "^unknown task 'target_pose'; did you mean .*single_object/target_pose"),
        (None, '^task is None; expected "domain/name"'),
    ],
)
def test_what_is_no_name_of_a_task_is_told_as_it_was_given(task, said):
    with pytest.raises(InputError, match=said):
        ManiPoseEnv(task)


@pytest.mark.sample(2)
@pytest.mark.parametrize("mode", MODES)
def test_the_checker_is_content_with_observation_modes(mode):
    options = {"sensors": SENSORS, "objects": OBJECTS, "normalise_actions": True}
    _check(gymnasium.make(ID, obs_mode=mode, **options).unwrapped)


def _check(checked: ManiPoseEnv, *, skip: bool = True) -> None:
    assert isinstance(checked, ManiPoseEnv)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(checked, skip_render_check=skip, skip_close_check=skip)
    assert not [str(w.message) for w in caught]
    checked.close()
    checked.close()


@pytest.mark.full
def test_the_checker_draws_and_closes_too():
    size = {"render_mode": "rgb_array", "height": 24, "width": 32}
    made = gymnasium.make(ID, objects=OBJECTS, normalise_actions=True, **size)
    made.unwrapped.metadata = {
        **ManiPoseEnv.metadata,
        "render_modes": ["rgb_array"],
    }  # no window here
    made.reset(seed=0)
    picture = made.render()
    assert picture.shape == (24, 32, 3) and picture.dtype == np.uint8 and picture.std() > 5
    _check(made.unwrapped, skip=False)


def test_ids_are_made_of_the_tasks_names():
    assert env_id("articulated/store_chips_can_middle_drawer") == (
        "manipose_mj/StoreChipsCanMiddleDrawer-v0"
    )
    register_envs()  # again
    ids = {spec.id for spec in gymnasium.registry.values() if spec.namespace == "manipose_mj"}
    assert {env_id(name) for _, name in suite.ALL_TASKS} <= ids


def test_seeds_are_those_of_the_suite_and_replays_are_bit_identical(env):
    theirs = suite.load("single_object", "target_pose", seed=17, objects=OBJECTS)
    rng = np.random.default_rng(0)
    actions = [env.action_space.low * 0.5 + 0.1 * rng.random(8) for _ in range(15)]
    observations = [
        [env.reset(seed=17)[0], *(env.step(a)[0] for a in actions), env.reset()[0]]
        for _ in range(2)
    ]
    observations.append([theirs.reset().observation])
    observations[-1] += [theirs.step(a).observation for a in actions] + [theirs.reset().observation]
    for other in observations[1:]:
        for one, two in zip(observations[0], other, strict=True):
            assert all(np.array_equal(one[name], two[name]) for name in one)


def test_a_pickled_environment_goes_on_with_the_same_episodes(env):
    env.reset(seed=3)
    copy = pickle.loads(pickle.dumps(env))
    assert copy.spec == env.spec
    one, two = env.reset()[0], copy.reset()[0]
    assert all(np.array_equal(one[name], two[name]) for name in one)
    action = env.action_space.sample()
    assert env.step(action)[1] == copy.step(action)[1] > 0  # the reward is dense in both
    copy.close()


def test_spawned_workers_run_a_task_of_another_package():
    import tests.conformance.spawned_task  # noqa: F401  (registers it)

    many = gymnasium.make_vec(env_id("spawned"), num_envs=2, obs_mode="state+pose")
    try:
        action = np.zeros((2, 8), np.float32)
        first, _ = many.reset(seed=[1, 2])
        assert first["pose/object"].shape == (2, 4, 4)
        for _ in range(FATAL_STEP):
            _, reward, terminated, _, info = many.step(action)
        assert terminated.all() and not reward.any()
        assert list(info["failure"]) == ["physics", "physics"] and not info["success"].any()
        assert info["goal_error"].shape == (2, 2)
        again, _ = many.reset(seed=[2, 1])
        for name, value in first.items():
            np.testing.assert_array_equal(value, again[name][::-1])
    finally:
        many.close()
        forget("example", "spawned")
        del sys.modules["tests.conformance.spawned_task"]


def test_one_environment_needs_no_worker():
    many = gymnasium.make_vec(ID, obs_mode="state")
    assert many.num_envs == 1
    many.reset(seed=0)
    many.step(many.action_space.sample())
    many.close()
    for options, said in (
        ({"num_envs": 0}, "num_envs is 0"),
        ({"num_envs": 1.5}, "num_envs is 1.5; expected a whole number"),
        ({"max_episode_steps": 0}, "max_episode_steps is 0"),
        ({"autoreset_mode": "later"}, "unknown autoreset mode 'later'.*SameStep"),
        ({"vectorization_mode": "sync", "autoreset_mode": "SameStep"}, "goes into vector_kwargs"),
    ):
        with pytest.raises(InputError, match=said):
            gymnasium.make_vec(ID, **options)


def test_several_environments_take_a_limit_and_a_way_to_begin_anew():
    several = gymnasium.make_vec(ID, num_envs=1, max_episode_steps=2, autoreset_mode="SameStep")
    several.reset(seed=0)
    cut = []
    for _ in range(4):
        *_, truncated, infos = several.step(several.action_space.sample())
        cut.append(truncated.tolist())
        assert ("final_obs" in infos) == truncated.any()
    assert cut == [[False], [True], [False], [True]]
    several.close()


def test_a_divergence_terminates_with_its_failure_and_the_next_episode_is_clean():
    with registered("diverge", diverging):
        broken = gymnasium.make(env_id("diverge"))
        space, action = broken.observation_space, np.zeros(8, np.float32)
        broken.reset(seed=0)
        for count in range(1, FATAL_STEP + 1):
            observation, reward, terminated, truncated, info = broken.step(action)
            assert terminated == (count == FATAL_STEP) and not truncated
            assert info["failure"] == ("physics" if terminated else "")
        assert reward == 0.0 and observation in space and not info["success"]
        with pytest.raises(ResetNeeded):
            broken.step(action)
        _, info = broken.reset()
        assert info["failure"] == ""
        for count in range(1, 21):
            observation, _, terminated, truncated, info = broken.step(action)
            assert observation in space and not terminated and info["failure"] == ""
            assert truncated == (count == 20)  # the task's horizon


def test_where_a_simulation_diverges_nothing_is_a_success():
    # MuJoCo goes back to its own state, where drawers are shut.
    broken = gymnasium.make(env_id("close_top_drawer")).unwrapped
    broken.reset(seed=0)
    broken.environment.physics.data.qvel[:] = 1e9
    _, reward, terminated, _, info = broken.step(np.zeros(8, np.float32))
    assert terminated and reward == 0.0 and info["failure"] == "physics"
    assert not info["success"] and not info["success_once"]
    assert broken.environment.task.max_penetration < 0.1
    broken.close()


def test_what_is_left_to_the_goal_of_a_simulation_that_diverged_is_unknown(env):
    env.reset(seed=0)
    env.environment.physics.data.qvel[:] = 1e11
    *_, info = env.step(np.zeros(8, np.float32))
    assert info["failure"] == "physics" and np.isnan(info["goal_error"]).all()


def test_success_and_reward_are_functions_of_a_state(env):
    env.reset(seed=1)
    state = env.scene_state()
    assert not env.is_success(state)
    assert 0 < env.reward_of(state) < 1
    obj = state.objects["object"]
    reached = (PoseGoal("object", obj.label_pose),)  # as in hindsight
    assert env.is_success(state, reached) and env.reward_of(state, reached) == 1.0
    _, reward, _, _, info = env.step(env.action_space.sample())
    assert reward == env.reward_of(env.scene_state())
    assert info["success"] == env.is_success(env.scene_state())
    np.testing.assert_allclose(
        info["goal_error"][0], env.environment.task.goal_error(env.environment.physics)[0]
    )


@pytest.mark.parametrize("goals", [(), [None], PoseGoal("object", np.eye(4))])
def test_goals_that_are_none_are_not_taken_for_the_episodes_own(env, goals):
    env.reset(seed=1)
    state = env.scene_state()
    for function in (env.is_success, env.reward_of):
        with pytest.raises(InputError, match="expected a tuple of goals, at least one"):
            function(state, goals)


def test_spaces_follow_the_specifications():
    seeing = gymnasium.make(
        ID, obs_mode="state+depth+segmentation+pointcloud", sensors=SENSORS, objects=OBJECTS
    )
    observation, _ = seeing.reset(seed=0)
    for name, spec in seeing.unwrapped.environment.observation_spec().items():
        space = seeing.observation_space[name]
        assert (space.shape, space.dtype) == (spec.shape, spec.dtype), name
        assert observation[name] in space, name
    limits = seeing.unwrapped.environment.action_spec()
    low, high = (seeing.action_space.low.astype(float), seeing.action_space.high.astype(float))
    assert (low >= limits.minimum).all() and (high <= limits.maximum).all()
    np.testing.assert_allclose(low, limits.minimum, atol=1e-6)
    seeing.close()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"obs_mode": "state+poses"}, "observation mode 'poses'; did you mean pose"),
        ({"control_mode": "pd_joint_poss"}, "did you mean .*pd_joint_pos"),
        ({"reward_mode": "shaped"}, "reward mode 'shaped'; did you mean sparse"),
        ({"render_mode": "rgb"}, "render mode 'rgb'"),
        ({"split": "validation"}, "split"),
        ({"obs_mod": "state"}, "unknown option 'obs_mod'; did you mean obs_mode"),
        ({"heigth": 64}, "unknown option 'heigth'; did you mean height"),
        ({"obs_mode": ["state", "pose"]}, r"obs_mode is \['state', 'pose'\]; expected a text"),
        ({"obs_mode": None}, "obs_mode is None"),
    ],
)
def test_unknown_modes_are_one_line_with_the_nearest_names(options, said):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Gymnasium's own on render modes
        with pytest.raises(InputError, match=said) as caught:
            gymnasium.make(ID, **options)
    assert "\n" not in str(caught.value)


def test_other_wrong_input_is_one_line(env, monkeypatch):
    with pytest.raises(InputError, match="seed is -1"):
        env.reset(seed=-1)
    for goal in (np.eye(3), 2 * np.eye(4), np.full((4, 4), np.nan), "abc", [[1], [2, 3]]):
        with pytest.raises(InputError, match="goal"):
            env.reset(options={"goal": goal})
    with pytest.raises(InputError, match="expected a mapping of names"):
        env.reset(options=["object"])
    with pytest.raises(InputError, match="start_index is -1"):
        env.reset(options={"start_index": -1})
    with pytest.raises(InputError, match="mug_00"):
        env.reset(options={"object": "mug_00"})
    with pytest.raises(InputError, match="object is 5; expected a name"):
        env.reset(options={"object": 5})
    env.reset(seed=np.int64(0))
    for options in ({"objects": 5}, {"randomisation": None}):
        with pytest.raises(InputError, match=f"{next(iter(options))}"):
            gymnasium.make(ID, **options)
    for action in (np.zeros(7), np.full(8, np.nan), None, np.full(8, 1j)):
        with pytest.raises(InputError, match="8 finite numbers"):
            env.step(action)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(InputError, match="a window needs a display") as caught:
        gymnasium.make(ID, render_mode="human")
    assert re.fullmatch("[^\n]+", str(caught.value))


@pytest.mark.parametrize("option", ["furniture", "part"])
def test_what_the_task_does_not_have_cannot_be_asked_for(env, option):
    with pytest.raises(InputError, match=f"{option} is 'top'; this task has no furniture"):
        env.reset(seed=0, options={option: "top"})
    env.reset(seed=0)


def test_no_object_can_be_asked_for_where_there_is_furniture_only():
    opening = ManiPoseEnv(
        "articulated/open_cabinet_door", objects=few("articulated/open_cabinet_door")
    )
    with pytest.raises(InputError, match="object is 'mug_000'; this task has no rigid object"):
        opening.reset(seed=0, options={"object": "mug_000"})
    opening.close()


def test_a_closed_environment_says_so():
    closed = ManiPoseEnv("single_object/target_pose", objects=OBJECTS, obs_mode="state")
    closed.reset(seed=0)
    closed.close()
    closed.close()
    action = closed.action_space.sample()
    for use in (closed.reset, closed.render, lambda: closed.step(action)):
        with pytest.raises(ClosedEnvironmentError, match="was closed: make another one"):
            use()


def test_a_reset_takes_an_object_a_goal_and_a_start(env):
    pose = env.reset(seed=2)[0]["pose/goal"].copy()
    pose[:2, 3] = (0.5, 0.1)
    observation, info = env.reset(seed=2, options={"goal": pose, "object": "bowl_001"})
    np.testing.assert_array_equal(observation["pose/goal"], pose)
    assert env.environment.task.object_name == "bowl_001"
    assert "bowl" in info["instruction"] and "50 cm ahead, 10 cm to the left" in info["instruction"]
    first = env.reset(options={"start_index": 5})[0]
    again = env.reset(options={"start_index": 5})[0]
    other = env.reset(options={"start_index": 6})[0]
    assert np.array_equal(first["pose/object"], again["pose/object"])
    assert not np.array_equal(first["pose/object"], other["pose/object"])
    opening = gymnasium.make(
        env_id("open_cabinet_door"), objects=few("articulated/open_cabinet_door")
    )
    with pytest.raises(InputError, match="goals are of other kinds: open"):
        opening.reset(seed=0, options={"goal": pose})


def test_an_unknown_reset_option_is_ignored_with_one_warning(env):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        one = env.reset(seed=4, options={"new_rollout": True})[0]
        env.reset(seed=4, options={"new_rollout": True})
    assert [str(w.message).count("'new_rollout' is unknown") for w in caught] == [1]
    two = env.reset(seed=4)[0]
    assert all(np.array_equal(one[name], two[name]) for name in one)


def test_success_terminates_where_that_is_asked_for(monkeypatch):
    ending = gymnasium.make(ID, objects=OBJECTS, terminate_on_success=True)
    _, info = ending.reset(seed=0)
    assert info["is_success"] is False
    monkeypatch.setattr("manipose_mj.tasks.core.task.success", lambda *goals: True)
    *_, terminated, truncated, info = ending.step(ending.action_space.sample())
    assert terminated and not truncated and info["is_success"] is True
    with pytest.raises(ResetNeeded):
        ending.unwrapped.step(ending.action_space.sample())


def test_normalised_actions_are_those_of_the_standard_wrapper():
    options = {"objects": OBJECTS, "obs_mode": "state", "disable_env_checker": True}
    own = gymnasium.make(ID, normalise_actions=True, **options)
    wrapped = gymnasium.wrappers.RescaleAction(gymnasium.make(ID, **options), -1.0, 1.0)
    assert own.action_space == wrapped.action_space
    own.reset(seed=0)
    wrapped.reset(seed=0)
    own.action_space.seed(0)
    for _ in range(3):
        action = own.action_space.sample()
        one, two = own.step(action)[0], wrapped.step(action)[0]
        assert all(np.array_equal(one[name], two[name]) for name in one)
    with pytest.raises(InputError, match="8 finite numbers"):
        own.step(np.zeros(7))
