"""dm_env's own conformance tests, over every task, every control mode and every observation mode."""

from __future__ import annotations

import pickle

import dm_env
import numpy as np
import pytest
from absl.testing import absltest
from dm_control.rl.control import PhysicsError
from dm_env.test_utils import EnvironmentTestMixin

from manipose_mj import suite
from manipose_mj.actions import CONTROL_MODES
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.environment import _STARTS
from manipose_mj.tasks.observations.sensors import MODES, SensorConfig
from tests.conformance.own_tasks import FATAL_STEP, diverging, registered
from tests.few_objects import load

TASK = ("single_object", "target_pose")
SENSORS = SensorConfig(cameras=("front",), height=24, width=32, cloud_size=256)
SHORT = {"time_limit": 0.1}


class Conformance(EnvironmentTestMixin, absltest.TestCase):
    """The mixin's tests on one environment, the one that needs a fresh one first: building takes long."""

    __test__ = False

    def __init__(self, environment: dm_env.Environment) -> None:
        super().__init__("test_reset")
        self._environment = environment

    def make_object_under_test(self) -> dm_env.Environment:
        return self._environment

    def make_action_sequence(self):
        spec, rng = self.environment.action_spec(), np.random.default_rng(0)
        for _ in range(7):  # beyond the time limit
            yield rng.uniform(spec.minimum, spec.maximum).astype(spec.dtype)

    def check(self) -> None:
        self.setUp()
        self.test_step_on_fresh_environment()
        self.test_longer_action_sequence()
        self.test_step_after_reset()
        self.test_reset()
        self.tearDown()
        self.environment.close()  # twice


@pytest.mark.sample(2)
@pytest.mark.parametrize("task", suite.ALL_TASKS, ids="/".join)
def test_tasks_conform(task):
    Conformance(load(*task, seed=0, environment_kwargs=SHORT)).check()


@pytest.mark.sample(1)
@pytest.mark.parametrize("mode", [*CONTROL_MODES, "primitive"])
def test_control_modes_conform(mode):
    environment = load(*TASK, seed=0, obs_mode="state", control_mode=mode, environment_kwargs=SHORT)
    assert environment.action_spec().name == mode
    Conformance(environment).check()


@pytest.mark.sample(2)
@pytest.mark.parametrize("mode", MODES)
def test_observation_modes_conform(mode):
    environment = load(*TASK, seed=0, obs_mode=mode, sensors=SENSORS, environment_kwargs=SHORT)
    Conformance(environment).check()


def test_a_pickled_environment_goes_on_with_the_same_episodes():
    first = load(*TASK, seed=5, control_mode="pd_ee_delta_pose", obs_mode="state+pose")
    first.reset()
    second = pickle.loads(pickle.dumps(first))
    spec = first.action_spec()
    assert second.action_spec() == spec
    rng = np.random.default_rng(0)
    pairs = [(first.reset(), second.reset())]
    for _ in range(10):
        action = rng.uniform(spec.minimum, spec.maximum)
        pairs.append((first.step(action), second.step(action)))
    for one, other in pairs:
        assert one.observation.keys() == other.observation.keys()
        assert all(np.array_equal(v, other.observation[k]) for k, v in one.observation.items())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            {"control_mode": "pd_ee_delta"},
            "control mode 'pd_ee_delta'; did you mean pd_ee_delta_pos",
        ),
        ({"control_mode": "primitives"}, "did you mean primitive"),
        ({"control_mode": ""}, "control mode ''; known: .*pd_joint_pos"),
        ({"reward_mode": "spars"}, "did you mean sparse"),
        ({"split": "tests"}, "did you mean test"),
    ],
)
def test_unknown_modes_are_one_line_with_the_nearest_names(options, said):
    with pytest.raises(InputError, match=said) as caught:
        suite.load(*TASK, **options)
    assert "\n" not in str(caught.value)


def test_a_diverging_simulation_ends_its_episode_and_leaves_nothing_to_the_next():
    with registered("diverge", diverging) as task:
        broken, sound = (load(*task, seed=seed) for seed in (3, 4))
        specs = broken.observation_spec()
        action = sound.action_spec().generate_value()
        sound.reset()  # its episode that would have diverged
        broken.reset()
        for count in range(1, FATAL_STEP + 1):
            step = broken.step(action)
            assert step.last() == (count == FATAL_STEP)
        assert (step.reward, step.discount) == (0.0, 0.0)
        assert broken.failure == "physics" and "mjWARN_BADQVEL" in broken.failure_reason
        for name, value in step.observation.items():
            specs[name].validate(value)
            assert np.isfinite(value).all()
        for environment in (broken, sound):
            environment.random_state.seed(9)
        # As after any last step, the next one resets.
        pairs = [(broken.step(action), sound.reset())]
        assert pairs[0][0].first() and broken.failure == ""
        pairs += [(broken.step(action), sound.step(action)) for _ in range(10)]
        for one, other in pairs:
            assert all(np.array_equal(v, other.observation[k]) for k, v in one.observation.items())
        assert np.array_equal(broken.physics.data.qpos, sound.physics.data.qpos)


def test_a_start_that_diverges_is_followed_by_another(monkeypatch, caplog):
    environment, sound = (load(*TASK, seed=3, objects=["mug_000"]) for _ in range(2))
    task, fatal, states = environment.task, [True, True, False], []
    draw, write = task.draw, task.scene.write

    def watched(random_state, spec):
        states.append(random_state.get_state())
        return draw(random_state, spec)

    def write_and_fling(physics, start):
        write(physics, start)
        if fatal.pop(0):
            physics.data.qvel[-6:] = 1e12

    monkeypatch.setattr(task, "draw", watched)
    monkeypatch.setattr(task.scene, "write", write_and_fling)
    step = environment.reset()
    assert step.first() and environment.failure == "" and fatal == []
    assert caplog.text.count("drawing another start") == 2
    sound.random_state.set_state(states[-1])
    expected = sound.reset()
    assert all(np.array_equal(v, step.observation[k]) for k, v in expected.observation.items())
    fatal[:] = [True] * _STARTS
    with pytest.raises(PhysicsError):
        environment.reset()
