"""The environment of the LeRobot plug-in, without LeRobot: keys, rates, ends, frozen episodes."""

from __future__ import annotations

import importlib.util
import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from manipose_mj.demos.replay import SteppedPolicy
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.episode import Naming, environment_of, play
from manipose_mj.evaluation.rollout import Rules
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from tests.few_objects import few
from tests.places import ROOT

TASK = "single_object/target_pose"
NEW = {"lerobot_new_rollout": True}


def plugin_module(file: str):
    """One of the plug-in's, which need not be installed."""
    path = ROOT / "plugins/lerobot_env_manipose" / file
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def environment_class():
    return plugin_module("lerobot_env_manipose/environment.py").LeRobotEnv


@pytest.fixture(scope="module")
def env(environment_class):
    return environment_class(TASK, objects=few(TASK))


def test_an_environment_speaks_lerobots_keys(env):
    observation, info = env.reset(seed=3, options=NEW)
    assert observation in env.observation_space
    assert list(observation) == ["agent_pos", "environment_state"]
    assert info["is_success"] is False and env.task == TASK
    assert env.task_description.startswith("Put the ")
    assert env._max_episode_steps == 400 and env.metadata["render_fps"] == 10
    start = env._environment.physics.data.time
    target = np.append(observation["agent_pos"][:7], 0.08).astype(np.float32)
    *_, terminated, truncated, info = env.step(target)
    assert env._environment.physics.data.time - start == pytest.approx(0.1)
    assert not terminated and not truncated and info["is_success"] is False
    picture = env.render()
    assert picture.shape == (96, 128, 3) and picture.std() > 5


def test_gymnasiums_checker_is_content(environment_class):
    options = {"task": TASK, "objects": few(TASK)}
    spec = EnvSpec("LeRobotManiPose-v0", entry_point=environment_class, kwargs=options)
    made = gymnasium.make(spec).unwrapped
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(made)
    made.close()
    # LeRobot scales actions by its data set: the environment takes joint angles, as they are recorded.
    (advice,) = [str(w.message) for w in caught]
    assert "we recommend using a symmetric and normalized space" in advice


def test_an_episode_ends_when_the_goal_has_held(env, monkeypatch):
    observation, _ = env.reset(seed=3, options=NEW)
    target = np.append(observation["agent_pos"][:7], 0.08)
    monkeypatch.setattr("manipose_mj.tasks.core.task.success", lambda *goals: True)
    ends = [env.step(target)[2:] for _ in range(5)]
    assert [terminated for terminated, _, _ in ends] == [False] * 4 + [True]
    assert [info["is_success"] for *_, info in ends] == [False] * 4 + [True]


def test_a_protocols_episodes_are_shared_out_and_only_new_rollouts_count(environment_class):
    frozen = list(protocol.load("v1").task(TASK).episodes.values())
    second = environment_class(TASK, protocol="v1", first=1, stride=2)
    names = []
    for options in (NEW, None, NEW):
        second.reset(seed=0, options=options)
        names.append(second._environment.task.object_name)
        names[-1] += f" {second._environment.task.start.noise_seed}"
    assert names[0].split()[0] == frozen[1].object
    assert names[1] == names[2] and names[2].split()[0] == frozen[3].object


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"hz": 15}, "divisor of 50"),
        ({"protocol": "v2"}, "protocol"),
        ({"obs_mode": "poses"}, "did you mean pose"),
        ({"protocol": "v1"}, "objects are .*; protocol v1 has its own"),
        (
            {"protocol": "v1-real", "objects": None},
            "evaluate --protocol v1-real --assets DIR` plays",
        ),
        ({"protocol": "v1", "objects": None, "task": "a/b"}, "task"),
    ],
)
def test_bad_input_is_one_line(environment_class, options, said):
    with pytest.raises(InputError, match=said) as caught:
        environment_class(**{"task": TASK, "objects": few(TASK), **options})
    assert "\n" not in str(caught.value)


def test_a_task_that_is_not_as_the_protocol_fixes_it_is_refused(environment_class, monkeypatch):
    longer = replace(protocol.load("v1").task(TASK), horizon=99.0)
    changed = replace(protocol.load("v1"), tasks={TASK: longer})
    monkeypatch.setattr(protocol, "load", lambda version: changed)
    with pytest.raises(InputError, match="protocol v1 fixes horizon 99.0, here it is 40"):
        environment_class(TASK, protocol="v1")


@pytest.mark.full
def test_its_success_is_that_of_our_evaluation(environment_class):
    """The same targets, at 10 Hz, in the first frozen episodes of both."""
    frozen = list(protocol.load("v1").task(TASK).episodes.values())[:3]
    plain = EnvConfig(TASK, obs_mode="state", split="test")
    recorded = plugin_module("frozen_targets.py").record_targets(TASK, "v1", 3, 10)
    assert list(recorded) == [episode.seed for episode in frozen]
    ours, theirs = [], []
    there = environment_class(TASK, protocol="v1", obs_mode="state+pose")
    for number, episode in enumerate(frozen):
        spec, here = EpisodeSpec(**episode.asked), environment_of(plain)
        targets, rules = recorded[episode.seed], Rules(10.0, stop="success")
        result, _ = play(
            here, SteppedPolicy(targets), spec, rules, Naming(TASK, number, "none", "none")
        )
        ours.append(result.success_at_end)
        there.reset(seed=number, options=NEW)
        ended, step = False, 0
        while not ended:
            target = targets[min(step, len(targets) - 1)]
            *_, terminated, truncated, info = there.step(target)
            ended, step = terminated or truncated, step + 1
        theirs.append(info["is_success"])
    assert ours == theirs and any(ours)


def test_frozen_targets_are_played_one_by_one_and_the_last_is_held(tmp_path):
    module = plugin_module("frozen_targets.py")
    targets = {7: np.arange(16, dtype=np.float32).reshape(2, 8), 3: np.ones((1, 8), np.float32)}
    module.write_targets(tmp_path / "new" / "targets.npz", targets)
    policy = module.FrozenTargets(str(tmp_path / "new" / "targets.npz"))
    for seed in (7, 3, 7):
        policy.reset(seed=seed, task=TASK, instruction="", action_space=None)
        played = [policy.infer({})["actions"] for _ in range(3)]
        expected = [targets[seed][min(step, len(targets[seed]) - 1)][None] for step in range(3)]
        np.testing.assert_array_equal(played, expected)
