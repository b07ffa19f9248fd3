"""Every task's episodes: determinism, a start at rest, actions and their limits."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.model import SERVO_LAG
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING, VELOCITY_LIMITS
from manipose_mj.tasks.observations.sensors import SensorConfig
from tests.few_objects import load
from tests.tasks.contact import touches_robot
from tests.tasks.episode_driver import HOLD, reset, wander

SENSORS = SensorConfig(height=60, width=80, cloud_size=4096)


@pytest.mark.sample(4)
@pytest.mark.parametrize("task", suite.ALL_TASKS, ids="/".join)
def test_the_same_seed_and_actions_give_the_same_bits(task):
    first, second = (
        load(*task, seed=11, obs_mode="state+pose+segmentation", sensors=SENSORS) for _ in range(2)
    )
    pairs = [(first.reset(), second.reset())]
    pairs += [(first.step(a), second.step(a)) for a in wander(first, 30, 1)]
    for one, other in pairs:
        for name, value in one.observation.items():
            assert np.array_equal(value, other.observation[name]), name
    assert np.array_equal(first.physics.data.qpos, second.physics.data.qpos)
    assert np.array_equal(first.physics.data.qvel, second.physics.data.qvel)


@pytest.mark.sample(3)
def test_an_episode_does_not_depend_on_the_one_before(blind):
    states = []
    for before in (0, 8):
        reset(blind, 5)
        for action in wander(blind, before * 10, 3):
            blind.step(action)
        reset(blind, 21)
        for action in wander(blind, 20, 2):
            blind.step(action)
        states.append(np.concatenate([blind.physics.data.qpos, blind.physics.data.qvel]))
    assert np.array_equal(*states)


@pytest.mark.sample(3)
def test_other_seeds_give_other_episodes(blind):
    starts = []
    for seed in range(4):
        reset(blind, seed)
        # Objects move freely; furniture stands elsewhere in the model.
        starts.append([*blind.physics.data.qpos, *blind.physics.model.body_pos.ravel()])
    assert len({tuple(np.round(start, 6)) for start in starts}) == 4


@pytest.mark.sample(6)
@pytest.mark.parametrize("seed", range(8))
def test_an_episode_starts_at_rest_with_nothing_overlapping(blind, seed):
    task = reset(blind, seed)
    for obj in task.objects.values():
        linear, angular = obj.speeds(blind.physics)
        assert linear < 0.01 and angular < 0.1
    joints, opening = task.robot.configuration(blind.physics)
    np.testing.assert_allclose(joints, HOME, atol=2e-3)
    assert opening == pytest.approx(MAX_OPENING, abs=1e-3)
    assert blind.physics.data.contact.dist.min(initial=0.0) > -0.001
    assert not task.succeeded(blind.physics)
    assert not task.success_once
    for obj in task.objects.values():
        assert not touches_robot(task, blind.physics, obj)
    blind.step(HOLD)
    assert task.max_penetration < 0.001


@pytest.mark.sample(4)
@pytest.mark.usefixtures("wrong_arrays")
@pytest.mark.parametrize(
    "action",
    [np.zeros(7), np.zeros((1, 8)), np.full(8, np.nan), np.append(HOME, np.inf), [["a"] * 8]],
    ids=["short", "two-dimensional", "nan", "inf", "text"],
)
def test_wrong_actions_are_refused(blind, action):
    reset(blind, 0)
    with pytest.raises(InputError, match="8 finite numbers") as caught:
        blind.step(action)
    assert "\n" not in str(caught.value)


@pytest.mark.sample(3)
def test_actions_beyond_the_limits_are_clipped(blind, request):
    task = reset(blind, 0)
    servos = blind.physics.bind(task.robot.actuators)
    before = np.array(servos.ctrl)
    blind.step(np.full(8, 100.0))
    most = VELOCITY_LIMITS * blind.control_timestep()
    np.testing.assert_allclose(servos.ctrl - before, most, rtol=1e-9)  # as fast as a Panda may move
    for _ in range(80):
        blind.step(np.full(8, 100.0))
    limits = blind.action_spec().maximum[:7]
    targets = np.array(blind.physics.bind(task.robot.actuators).ctrl)
    assert (targets <= limits + 1e-9).all()
    if request.node.callspec.id == "single_object/target_pose":  # nothing is in the way
        np.testing.assert_allclose(targets, limits)
    # No further ahead of an arm that is stopped than drives it at its speed limit; what a joint moves back
    # in the last step comes on top.
    joints, _ = task.robot.configuration(blind.physics)
    assert (np.abs(targets - joints) < SERVO_LAG * VELOCITY_LIMITS + 0.01).all()
