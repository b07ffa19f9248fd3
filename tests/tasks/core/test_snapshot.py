"""Episodes go on bit for bit from wherever they were saved, here and in another process."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.snapshot import restore, save
from tests.few_objects import load

STEPS, SAVED_AT = 40, (0, 13, 39)


def _actions(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    steps = rng.normal(0, 1, (count, 8)) * ([0.08] * 7 + [0.01])
    return np.append(HOME, MAX_OPENING) + np.cumsum(steps, axis=0)


def _bits(environment, step) -> list[bytes]:
    data = environment.physics.data
    found = [data.qpos.tobytes(), data.qvel.tobytes(), data.qacc_warmstart.tobytes()]
    return found + [np.asarray(v).tobytes() for v in step.observation.values()]


def _load(task, seed):
    return load(*task, seed=seed, obs_mode="state+pose", reward_mode="dense")


@pytest.mark.sample(3)
@pytest.mark.parametrize("task", suite.ALL_TASKS, ids="/".join)
def test_what_follows_a_restored_snapshot_is_the_same(task):
    environment = _load(task, 3)
    environment.reset()
    actions, saved, bits = _actions(STEPS, 0), {}, []
    for index, action in enumerate(actions):
        if index in SAVED_AT:
            saved[index] = pickle.dumps(save(environment))
        step = environment.step(action)
        bits.append((_bits(environment, step), step.reward))
    environment.reset()  # another episode, and a fresh environment that never was in this one
    environment.step(actions[0])
    other = _load(task, 99)
    other.reset()
    for where in (environment, other):
        for index, snapshot in saved.items():
            restore(where, pickle.loads(snapshot))
            for later in range(index, min(index + 8, STEPS)):
                step = where.step(actions[later])
                assert (_bits(where, step), step.reward) == bits[later], (index, later)


@pytest.mark.full
def test_the_next_episode_after_a_restored_one_is_the_same_too():
    environment = _load(suite.ALL_TASKS[0], 5)
    environment.reset()
    snapshot = save(environment)
    first = environment.reset().observation
    restore(environment, snapshot)
    again = environment.reset().observation
    assert all(np.array_equal(first[name], again[name]) for name in first)


def test_the_observation_of_the_snapshot_comes_back():
    environment = _load(suite.ALL_TASKS[0], 5)
    environment.reset()
    step = environment.step(_actions(1, 0)[0])
    snapshot = save(environment)
    environment.reset()
    observation = restore(environment, snapshot)
    assert set(observation) == set(step.observation)
    for name, value in step.observation.items():
        np.testing.assert_allclose(observation[name], value, atol=1e-9, err_msg=name)


@pytest.mark.full
def test_two_processes_play_the_same_episode():
    script = (
        "import hashlib, numpy as np\n"
        "from manipose_mj import suite\n"
        "e = suite.load(*suite.ALL_TASKS[-1], seed=8, obs_mode='state+pose+depth', objects=['mug_000'])\n"
        "step, h = e.reset(), hashlib.sha256()\n"
        "for i in range(20):\n"
        "    for v in step.observation.values(): h.update(np.asarray(v).tobytes())\n"
        "    step = e.step(np.append(e.task.robot.configuration(e.physics)[0] + 0.02, 0.05))\n"
        "print(h.hexdigest())\n"
    )
    runs = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert runs[0].stdout == runs[1].stdout and len(runs[0].stdout.split()[-1]) == 64


def test_a_snapshot_of_another_scene_is_refused():
    first, second = (_load(task, 0) for task in suite.ALL_TASKS[:2])
    with pytest.raises(InputError, match=r"not been reset yet; call reset\(\) first"):
        save(first)
    first.reset()
    second.reset()
    if len(save(first).simulation.state) != len(save(second).simulation.state):
        with pytest.raises(InputError, match="restore it in one of "):
            restore(second, save(first))


def test_a_snapshot_of_another_task_or_other_options_is_refused():
    mug = {"seed": 0, "obs_mode": "state", "objects": ["mug_000"]}
    environment = suite.load("single_object", "target_pose", **mug)
    environment.reset()
    snapshot = save(environment)
    for name, options, said in (
        ("orientation", {}, "task 'single_object/target_pose'"),
        ("target_pose", {"control_mode": "pd_ee_delta_pose"}, "control mode 'pd_joint_pos'"),
        ("target_pose", {"latency": 0.1}, "latency 0.0"),
    ):
        other = suite.load("single_object", name, **mug, **options)
        other.reset()
        with pytest.raises(InputError, match=f"snapshot with {said}; this environment has"):
            restore(other, snapshot)
    dense = suite.load("single_object", "target_pose", **mug, reward_mode="dense")
    dense.reset()
    restore(dense, snapshot)
    assert 0 < dense.step(_actions(1, 0)[0]).reward < 1


def test_a_snapshot_is_restored_in_a_scene_that_was_compiled_and_never_reset():
    objects = ["mug_000", "box_000"]
    environment = suite.load(
        "single_object", "target_pose", seed=0, obs_mode="state", objects=objects
    )
    first = environment.scene_objects.assets[0].name
    (other,) = {*objects} - {first}
    environment.reset(EpisodeSpec(seed=1, object=other))
    twin = suite.load("single_object", "target_pose", seed=5, obs_mode="state", objects=objects)
    twin.reset(EpisodeSpec(seed=2, object=first))
    snapshot, action = save(twin), _actions(1, 0)[0]
    restore(environment, snapshot)
    assert _bits(environment, environment.step(action)) == _bits(twin, twin.step(action))


def test_restoring_changes_no_later_episode():
    options = {"obs_mode": "state", "objects": ["mug_000", "box_000"], "randomisation": "strong"}
    spec = EpisodeSpec(seed=5, object="mug_000")
    one, other = (suite.load("single_object", "target_pose", seed=0, **options) for _ in range(2))
    one.reset(EpisodeSpec(seed=4, object="mug_000"))
    snapshot = save(one)
    other.reset(EpisodeSpec(seed=1, object="box_000"))
    restore(other, snapshot)
    one.reset(spec)
    other.reset(spec)
    np.testing.assert_array_equal(
        one.physics.model.actuator_gainprm, other.physics.model.actuator_gainprm
    )
    np.testing.assert_array_equal(one.physics.model.body_mass, other.physics.model.body_mass)


def test_a_restored_episode_has_its_own_failure_and_last_observation():
    environment = _load(suite.ALL_TASKS[0], 5)
    environment.reset()
    snapshot = save(environment)
    environment.reset()
    environment.failure = environment.failure_reason = "physics"
    restored = restore(environment, snapshot)
    assert environment.failure == environment.failure_reason == ""
    step = environment.step(None, observe=False)
    for name, value in step.observation.items():
        np.testing.assert_array_equal(value, restored[name])


def test_after_a_reset_that_fails_the_next_step_begins_an_episode():
    environment = suite.load("single_object", "reorient_mug", seed=3, obs_mode="state")
    environment.reset()
    with pytest.raises(InputError, match="goal"):
        environment.reset(EpisodeSpec(goal=tuple(map(tuple, np.eye(4).tolist()))))
    assert environment.step(_actions(1, 0)[0]).first()
