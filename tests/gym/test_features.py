"""Features: what they hold, that their layout is one for a task, and instructions for every task."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.evaluation.episode import Naming, environment_of, play
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.rollout import Rules
from manipose_mj.failures import StageFailure
from manipose_mj.gym.droid import droid_observation, from_droid
from manipose_mj.gym.features import AGENT_NAMES, Features, feature_sensors, pose_columns
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.policies.protocol import ActionSpace
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.goals import InsideGoal, OpenGoal, PoseGoal, ShutGoal, TakenOutGoal
from tests.few_objects import load

TASKS = ["/".join(task) for task in suite.ALL_TASKS]


@pytest.mark.sample(4)
@pytest.mark.parametrize("task", TASKS)
def test_every_task_has_an_instruction_and_one_layout_of_its_state(task):
    environment = load(*task.split("/"), obs_mode="state+pose")
    features = Features(environment)
    layout = features.specs["environment_state"]
    assert len(set(layout.names)) == len(layout.names) == layout.shape[0]
    sentences = []
    for seed in (0, 1):
        read = features.read(environment.reset(EpisodeSpec(seed)).observation)
        assert read["environment_state"].shape == layout.shape
        assert Features(environment).specs == features.specs
        for name, spec in features.specs.items():
            assert (read[name].shape, read[name].dtype) == (spec.shape, spec.dtype), name
        sentences.append(read["instruction"])
        assert re.fullmatch(r"[A-Z][^\n]+\.", sentences[-1])
        _names_what_it_is_about(environment.task, sentences[-1])
    environment.close()


def _names_what_it_is_about(task, sentence):
    for goal in task.goals:
        if isinstance(goal, PoseGoal | InsideGoal | TakenOutGoal):
            category = task.objects[goal.object].asset.category.replace("_", " ")
            assert f"the {category}" in sentence.lower()
        if isinstance(goal, OpenGoal | ShutGoal | InsideGoal | TakenOutGoal):
            assert re.search("drawer|door", sentence)
        if isinstance(goal, PoseGoal):
            assert f"{100 * goal.pose[0, 3]:.0f} cm ahead" in sentence


def test_agent_and_state_hold_the_robot_and_the_poses():
    environment = load("single_object", "target_pose", obs_mode="state+pose")
    observation = environment.reset(EpisodeSpec(3)).observation
    features = Features(environment)
    read = features.read(observation)
    agent = read["agent_pos"]
    np.testing.assert_allclose(agent[:7], HOME, atol=1e-3)
    np.testing.assert_allclose(agent[7], MAX_OPENING, atol=1e-3)
    task, physics = environment.task, environment.physics
    tcp = task.scene_state(physics).tcp_pose
    np.testing.assert_allclose(agent[8:], pose_columns(tcp), atol=1e-4)
    assert len(agent) == len(AGENT_NAMES)
    names, state = features.specs["environment_state"].names, read["environment_state"]
    at = names.index("object.x")
    np.testing.assert_allclose(
        state[at : at + 9], pose_columns(observation["pose/object"]), atol=1e-6
    )
    at = names.index("goal.translation_counts")
    assert state[at] == state[at + 1] == 1
    observation["panda/joint_positions"][:] = 0
    np.testing.assert_array_equal(read["agent_pos"], agent)


def test_pictures_have_the_names_and_sizes_of_features():
    mode = "state+rgb"
    environment = load("single_object", "target_pose", obs_mode=mode, sensors=feature_sensors(mode))
    read = Features(environment).read(environment.reset(EpisodeSpec(0)).observation)
    for name in ("pixels/front", "pixels/wrist"):
        assert read[name].shape == (224, 224, 3) and read[name].std() > 5
    assert "rgb/front" not in read and "environment_state" not in read
    droid = droid_observation(read)
    np.testing.assert_allclose(droid["observation/gripper_position"], 0, atol=0.02)
    np.testing.assert_array_equal(droid["observation/wrist_image_left"], read["pixels/wrist"])
    assert droid["prompt"] == read["instruction"]
    environment.close()


def test_droids_gripper_is_shut_at_one():
    actions = np.zeros((2, 8))
    actions[1, 7] = 1
    np.testing.assert_allclose(from_droid(actions)[:, 7], [MAX_OPENING, 0])


@pytest.mark.parametrize(
    ("mode", "cameras", "height"),
    [
        ("state+pose", (), 120),
        ("state+rgb", ("front", "panda/wrist"), 224),
        ("state+pointcloud", ("front", "left", "right"), 120),
        ("rgb+pointcloud", ("front", "left", "right", "panda/wrist"), 224),
        ("state+depth/front", ("front", "panda/wrist"), 224),
    ],
)
def test_sensors_follow_from_the_mode(mode, cameras, height):
    sensors = feature_sensors(mode)
    assert (sensors.camera_names, sensors.height) == (cameras, height)


def test_a_droid_policy_is_told_of_droids_gripper():
    told: list[ActionSpace] = []

    class Hearing:
        def reset(self, **episode):
            told.append(episode["action_space"])
            raise StageFailure("plan", "heard")

        def infer(self, obs): ...

    settings = PolicySettings("a.b:C", obs_mode="state+rgb", obs_format="droid")
    environment = environment_of(EnvConfig(TASKS[0], obs_mode="state", objects=("mug_000",)))
    naming = Naming(TASKS[0], 0, "none", "none")
    play(
        environment,
        Hearing(),
        EpisodeSpec(1),
        Rules(),
        naming,
        replace(settings, obs_format="manipose"),
    )
    play(environment, Hearing(), EpisodeSpec(1), Rules(), naming, settings)
    assert told[0].high[-1] == pytest.approx(0.08) and told[1].high[-1] == 1
    assert told[1].low[-1] == 0 and (told[0].high[:-1] == told[1].high[:-1]).all()
