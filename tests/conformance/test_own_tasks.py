"""The example in docs/guides/own_tasks.md works as it stands, at every front door."""

from __future__ import annotations

import importlib.util
import re
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from dm_control import suite as dm_suite

import manipose_mj
from manipose_mj import batch, suite
from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.gym import env_id
from manipose_mj.tasks.core.registry import task_spec
from manipose_mj.tasks.own_modules import import_own_tasks
from tests.conformance.own_tasks import diverging, forget, registered
from tests.places import ROOT

PAGE = ROOT / "docs" / "guides" / "own_tasks.md"


def _blocks():
    """Those of Python on the page."""
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def lift_mug(tmp_path):
    """The page's module, imported."""
    (tmp_path / "lift_mug_example.py").write_text(_blocks()[0], encoding="utf-8")
    spec = importlib.util.spec_from_file_location(
        "lift_mug_example", tmp_path / "lift_mug_example.py"
    )
    module = importlib.util.module_from_spec(spec)
    manipose_mj.register_suite()  # before: tasks of later show up too
    spec.loader.exec_module(module)
    yield "example", "lift_mug"
    forget("example", "lift_mug")


def test_every_front_door_knows_a_task_of_ones_own(lift_mug):
    assert lift_mug in suite.ALL_TASKS and lift_mug in dm_suite.ALL_TASKS
    assert suite.describe(*lift_mug) == "Lift a mug 20 cm off the table."
    assert task_spec(*lift_mug).description.startswith("The first line is")
    assert dm_suite.TASKS_BY_DOMAIN["example"] == ("lift_mug",)
    starts = [
        suite.load(*lift_mug, seed=3).reset().observation,
        dm_suite.load(*lift_mug, task_kwargs={"random": 3}).reset().observation,
        gymnasium.make("manipose_mj/LiftMug-v0").reset(seed=3)[0],
    ]
    for other in starts[1:]:
        assert other.keys() == starts[0].keys()
        assert all(np.array_equal(other[name], value) for name, value in starts[0].items())


def _moving(**fields):
    """A factory of the page's `Move`, with fields of its class in the place of others."""
    names: dict[str, Any] = {"__name__": __name__}
    lift, move = _blocks()
    exec(lift.partition("@register_task")[0] + move, names)
    task = type("Move", (names["Move"],), fields)

    def moved(env_config):
        """Move a mug."""
        return task((catalogue.load("mug", 0),), env_config)

    return moved


def test_a_goal_pose_of_ones_own_is_observed():
    with registered("moved", _moving()) as task:
        observation = suite.load(*task, seed=0).reset().observation
    asked = observation["pose/object"] + 0.0
    asked[1, 3] += 0.2
    np.testing.assert_allclose(observation["pose/goal"], asked, atol=5e-3)


def test_a_goal_pose_that_is_not_observed_is_told_once(caplog):
    with registered("moved", _moving(observed_goals=())) as task:
        environment = suite.load(*task, seed=0)
        for _ in range(2):
            environment.reset()
    (told,) = [r.getMessage() for r in caplog.records if "observed_goals" in r.getMessage()]
    assert "goals ask for poses of object, and observed_goals is ()" in told


@pytest.mark.parametrize("names", ["goal", ("target",), ("goal", "goal_object")])
def test_goals_observed_by_other_names_are_one_line(names):
    with (
        registered("moved", _moving(observed_goals=names)) as task,
        pytest.raises(InputError, match="observed_goals .* expected"),
    ):
        suite.load(*task, seed=0)


@pytest.mark.full
def test_batched_worlds_play_it(lift_mug):
    worlds = batch.make("/".join(lift_mug), worlds=1, seed=3, engine="c", objects=["mug_000"])
    begun = worlds.at([3])
    state = worlds.step(begun, begun.observation["panda/joint_positions"][:, [*range(7), 0]])
    assert not state.success.any() and not state.done.any()
    worlds.close()


def test_the_example_rewards_lifting(lift_mug):
    environment = suite.load(
        *lift_mug, seed=0, reward_mode="dense", control_mode="pd_ee_delta_pose"
    )
    environment.reset()
    task, physics = environment.task, environment.physics
    hold = np.append(np.zeros(6), 0.08)
    low = environment.step(hold).reward
    pose = task.object.object_pose(physics)
    pose[2, 3] += 0.1
    task.object.place(physics, pose)
    middle = environment.step(hold).reward
    pose[2, 3] += 0.1
    task.object.place(physics, pose)
    assert 0 < low < middle < environment.step(hold).reward == 1.0


def test_a_name_is_taken_once(lift_mug):
    with pytest.raises(ValueError, match="example/lift_mug is registered already"):
        manipose_mj.register_task(*lift_mug)(diverging)
    # Two tasks of one name in different families would share a Gymnasium id.
    taken = env_id("target_pose")
    with (
        pytest.raises(ValueError, match=f"{taken}.*choose another name"),
        registered("target_pose", diverging),
    ):
        pass
    assert ("example", "target_pose") not in suite.ALL_TASKS


def test_a_refused_task_is_registered_nowhere():
    manipose_mj.register_suite()
    before = suite.ALL_TASKS, dm_suite.ALL_TASKS, set(gymnasium.registry)
    for _ in range(2):
        with pytest.raises(ValueError, match="^task cartpole/swingup: dm_control has a task of"):
            manipose_mj.register_task("cartpole", "swingup")(diverging)
    assert before == (suite.ALL_TASKS, dm_suite.ALL_TASKS, set(gymnasium.registry))


def test_modules_that_the_environment_names_are_imported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = _blocks()[0]
    (tmp_path / "lift_mug_module.py").write_text(code, encoding="utf-8")
    monkeypatch.setenv("MANIPOSE_TASKS", "lift_mug_module, ")
    monkeypatch.setattr(sys, "path", list(sys.path))
    import_own_tasks()
    try:
        import_own_tasks()  # a second time changes nothing
        assert ("example", "lift_mug") in suite.ALL_TASKS
    finally:
        forget("example", "lift_mug")
    monkeypatch.setenv("MANIPOSE_TASKS", "no_such_module")
    with pytest.raises(InputError, match="MANIPOSE_TASKS=no_such_module: cannot import"):
        import_own_tasks()
