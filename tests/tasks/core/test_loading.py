"""Loading a task: its registration, its options, and what is refused."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from dm_control import suite as dm_suite
from dm_control.suite.wrappers import action_noise

import manipose_mj
from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.assets.categories import SPLITS
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, env_config
from manipose_mj.tasks.observations.sensors import CameraView, SensorConfig
from tests.few_objects import few, load
from tests.tasks.episode_driver import HOLD

TARGET_POSE = ("single_object", "target_pose")
STORE = ("articulated", "store_chips_can_middle_drawer")


def test_both_tasks_are_registered_and_described():
    assert {TARGET_POSE, STORE} <= set(suite.ALL_TASKS)
    assert all(len(suite.describe(*task)) > 20 for task in suite.ALL_TASKS)


@pytest.mark.parametrize("observations", ["state+poses", "", "state+", "rgbd", "State"])
def test_unknown_modes_are_refused_with_the_names_that_exist(observations):
    with pytest.raises(InputError, match="observation mode.*(state|pose|depth|rgb)") as caught:
        suite.load(*TARGET_POSE, obs_mode=observations)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("domain", "task", "near"),
    [
        ("single_object", "target_poses", "single_object/target_pose"),
        ("articulate", "store_chips_can_midle_drawer", "store_chips_can_middle_drawer"),
        ("", "zzz", "known: .*target_pose"),
    ],
)
def test_unknown_tasks_are_refused_with_the_nearest_names(domain, task, near):
    with pytest.raises(InputError, match=near):
        suite.load(domain, task)


@pytest.mark.parametrize(
    ("sensors", "near"),
    [
        ({"cameras": ("frnt",)}, "front"),
        ({"cameras": ("wrist",)}, "panda/wrist"),
        ({"height": 0}, "height"),
        ({"height": True}, "height is True; expected a whole number, at least 1"),
        ({"width": -4}, "width"),
        ({"cloud_size": 0}, "cloud_size"),
    ],
)
def test_wrong_sensors_are_refused(sensors, near):
    with pytest.raises(InputError, match=near):
        suite.load(*STORE, sensors=SensorConfig(**sensors))


def test_objects_of_the_wrong_kind_or_number_are_refused():
    can, cabinet = catalogue.load("chips_can", 0), catalogue.load("cabinet", 0)
    with pytest.raises(InputError, match="expected a rigid one"):
        suite.load(*TARGET_POSE, objects=[cabinet])
    with pytest.raises(InputError, match="no objects to draw from"):
        suite.load(*TARGET_POSE, objects=[])
    with pytest.raises(InputError, match="tasks that open or close take articulated ones"):
        suite.load("articulated", "open_oven", objects=[can])


def test_one_object_of_ones_own_is_the_one_in_play():
    environment = suite.load(*TARGET_POSE, seed=0, objects=[catalogue.load("box", 1)])
    environment.reset()
    assert environment.task.object_name == "box_001"


def test_the_time_limit_ends_the_episode():
    environment = load(*STORE, seed=0, environment_kwargs={"time_limit": 0.1})
    environment.reset()
    ended = [environment.step(HOLD).last() for _ in range(5)]
    assert ended == [False] * 4 + [True]
    with pytest.raises(InputError, match="unknown argument of an environment 'time_limits'; did"):
        load(*STORE, seed=0, environment_kwargs={"time_limits": 0.1})
    with pytest.raises(InputError, match=r"'environment_args'; did you mean environment_kwargs\?"):
        suite.load(*STORE, environment_args={})


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"random_state": 3}, "environment_kwargs has random_state; give it as seed"),
        ({"task": None}, "unknown argument of an environment 'task'"),
        ({"self": None}, "unknown argument of an environment 'self'"),
        ({"time_limit": float("nan")}, "time_limit is nan s; expected a number above 0"),
        ({"time_limit": -1}, "time_limit is -1 s; expected a number above 0"),
        ({"time_limit": "a"}, "time_limit is 'a' s; expected a number above 0"),
        ("time_limit", "environment_kwargs is 'time_limit'; expected a mapping of names"),
    ],
)
def test_arguments_of_an_environment_that_cannot_be_are_one_line(arguments, said):
    with pytest.raises(InputError, match=said):
        load(*TARGET_POSE, seed=0, environment_kwargs=arguments)


def test_dm_control_knows_the_tasks_once_registered(monkeypatch):
    manipose_mj.register_suite()
    manipose_mj.register_suite()
    assert len(set(dm_suite.ALL_TASKS)) == len(dm_suite.ALL_TASKS)
    asked, settings = [], {"random": 7, "time_limit": 5.0, "observations": "state"}

    def load(domain, task, seed, **options):
        asked.append((domain, task, seed, options))
        return SimpleNamespace(task=SimpleNamespace())

    monkeypatch.setattr(suite, "load", load)
    for task in suite.ALL_TASKS:
        assert task in dm_suite.ALL_TASKS
        dm_suite.load(*task, task_kwargs=settings)
    options = {"environment_kwargs": {"time_limit": 5.0}, "observations": "state"}
    assert asked == [(*task, 7, options) for task in suite.ALL_TASKS]
    assert dm_suite.load("cartpole", "balance").reset().first()
    with pytest.raises(InputError, match="task_kwargs has seed; give it as random"):
        dm_suite.load(*TARGET_POSE, task_kwargs={"seed": 1})


@pytest.mark.parametrize("task", [TARGET_POSE, STORE], ids="/".join)
def test_dm_control_loads_the_same_episodes(task):
    manipose_mj.register_suite()
    settings = {"random": 7, "time_limit": 5.0, "objects": few("/".join(task))}
    own = load(*task, seed=7).reset()
    for _ in range(2):
        theirs = dm_suite.load(*task, task_kwargs=settings)
        step = theirs.reset()
        assert step.observation.keys() == own.observation.keys()
        assert all(np.array_equal(step.observation[k], v) for k, v in own.observation.items())
        assert theirs.step(HOLD).reward in (0.0, 1.0)


def test_wrappers_of_dm_control_draw_from_a_tasks_random_state():
    environment = load(*TARGET_POSE, seed=7)
    noisy = action_noise.Wrapper(environment, 0.01)
    noisy.reset()
    assert np.isfinite(noisy.step(HOLD).reward)
    assert noisy.task.random is environment.random_state


def test_a_closed_environment_says_so():
    environment = load(*TARGET_POSE, seed=7)
    environment.reset()
    environment.close()
    environment.close()
    for use in (environment.reset, lambda: environment.step(HOLD)):
        with pytest.raises(InputError, match="was closed: make another"):
            use()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"seed": "abc"}, "seed is 'abc'"),
        ({"latency": "0.1"}, "latency is '0.1' s"),
        ({"sensors": {"height": 3}}, "sensors is a dict; expected a SensorConfig"),
        ({"latency": True}, "latency is True s"),
        ({"objects": [5]}, "objects: 5 is no name"),
        ({"objects": ""}, "objects: '' is no name"),
    ],
)
def test_options_of_other_kinds_are_one_line(options, said):
    with pytest.raises(InputError, match=said) as caught:
        suite.load("single_object", "target_pose", **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("what", ["object", "furniture", "part"])
@pytest.mark.parametrize("name", [5, ["a"], ""])
def test_what_an_episode_is_about_is_a_name(what, name):
    with pytest.raises(InputError, match=rf"{what} is .*; expected a name"):
        EpisodeSpec(**{what: name})


@pytest.mark.parametrize(
    ("use", "said"),
    [
        (lambda: suite.load(EnvConfig("a/b")), r"load got EnvConfig\(.* expected load\(.* or make"),
        (lambda: suite.load("/".join(TARGET_POSE)), r"load got 'single.* expected load\("),
        (lambda: suite.make("/".join(TARGET_POSE)), "make got 'single.* expected an EnvConfig"),
    ],
)
def test_a_front_door_says_what_it_takes(use, said):
    with pytest.raises(InputError, match=said) as caught:
        use()
    assert "\n" not in str(caught.value)


def test_a_reset_takes_an_episode_alone():
    environment = load(*TARGET_POSE, seed=0)
    for spec in (0, 5, {"seed": 5}):
        with pytest.raises(InputError, match="reset got .*; expected an EpisodeSpec"):
            environment.reset(spec)


def test_objects_may_name_a_split(tmp_path, monkeypatch):
    task = "single_object/target_pose"
    for split in SPLITS:
        assert env_config(task, {"objects": split}) == EnvConfig(task, split=split)
        assert env_config(task, {"objects": split, "split": split}) == EnvConfig(task, split=split)
    with pytest.raises(InputError, match=r"objects is 'test' and split is 'train'; expected one"):
        env_config(task, {"objects": "test", "split": "train"})
    assert EnvConfig(task, objects="test") == EnvConfig(task, split="test")
    with pytest.raises(InputError, match=r"objects is 'train' and split is 'test'; expected one"):
        EnvConfig(task, objects="train", split="test")
    (tmp_path / "test").mkdir()
    monkeypatch.chdir(tmp_path)
    assert env_config(task, {"objects": "test"}).objects == ("test",)


def test_two_assets_of_one_name_are_refused(tmp_path):
    folder = catalogue.load("box", 0).folder
    for place in ("one", "two"):
        shutil.copytree(folder, tmp_path / place / "box_000")
    with pytest.raises(InputError, match=r"two/box_000: has the name of .*one/box_000"):
        suite.load("single_object", "target_pose", objects=[tmp_path / "one", tmp_path / "two"])
    twice = [tmp_path / "one", str(tmp_path / "one" / "box_000")]
    environment = suite.load("single_object", "target_pose", objects=twice)
    environment.reset()
    assert environment.task.object_name == "box_000"


def test_an_own_camera_takes_arrays():
    camera = CameraView("above", position=np.array([0.5, 0, 1.3]), target=[0.5, 0, 0])
    with pytest.raises(InputError, match="expected two different points"):
        CameraView("above", position=(0.5, 0), target="abc")
    environment = suite.load(
        "single_object",
        "target_pose",
        seed=0,
        obs_mode="depth/above",
        objects=["box_000"],
        sensors=SensorConfig(cameras=("front", camera)),
    )
    assert {*environment.reset().observation} == {"depth/above"}
