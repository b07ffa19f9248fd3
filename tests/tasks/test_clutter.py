"""The clutter tasks: what their starts and goals promise, on every seed tried."""

from __future__ import annotations

import numpy as np
import pytest

from asset_pipeline import catalogue
from manipose_mj import suite
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda import HOME, MAX_OPENING
from manipose_mj.poses import invert
from manipose_mj.tasks.clutter import Clutter
from manipose_mj.tasks.clutter_occluded import CAMERAS
from manipose_mj.tasks.goals import OnTableGoal, PoseGoal
from manipose_mj.tasks.visibility import visible_share

TASKS = ("pick", "multi", "stacked", "occluded")
# Few, and the same for all: each may have to drop its pile first.
SEEDS = (0, 3, 4)
HOLD = np.append(HOME, MAX_OPENING)


@pytest.fixture(scope="module")
def environments():
    made = {}

    def get(name: str):
        if name not in made:
            made[name] = suite.load("clutter", name, seed=0, observations="state")
        return made[name]

    return get


def _reset(environments, name: str, seed: int):
    environment = environments(name)
    environment.random_state.seed(seed)
    environment.reset()
    assert isinstance(environment.task, Clutter)
    return environment, environment.task


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", TASKS)
def test_a_pile_lies_still_on_the_table_and_within_reach(environments, name, seed):
    environment, task = _reset(environments, name, seed)
    physics, things = environment.physics, task.movable
    assert 5 <= len(things) <= 15
    before = {name: thing.object_pose(physics) for name, thing in things.items()}
    for _ in range(100):
        environment.step(HOLD)
    for thing, pose in before.items():
        now = things[thing].object_pose(physics)
        assert np.linalg.norm(now[:3, 3] - pose[:3, 3]) < 1e-3, thing
        assert now[2, 3] > 0 and np.linalg.norm(now[:2, 3]) < 0.85
    assert task.max_penetration < 0.002


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", TASKS)
def test_goals_are_free_on_the_table_and_not_met_at_the_start(environments, name, seed):
    environment, task = _reset(environments, name, seed)
    physics = environment.physics
    goals = [goal for goal in task.goals if isinstance(goal, PoseGoal)]
    assert not task.succeeded(physics)
    for goal in goals:
        place = goal.pose[:2, 3]
        assert 0.3 < np.linalg.norm(place) < 0.75
        for other in task.movable.values():
            assert np.linalg.norm(other.label_pose(physics)[:2, 3] - place) > 0.05
    places = np.array([goal.pose[:2, 3] for goal in goals])
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    assert (apart[np.triu_indices(len(goals), 1)] > 0.08).all()


@pytest.mark.parametrize("name", TASKS)
def test_targets_set_down_at_their_goals_stay_there_and_are_a_success(environments, name):
    environment, task = _reset(environments, name, SEEDS[1])
    physics = environment.physics
    for goal in task.goals:
        if isinstance(goal, PoseGoal):
            thing = task.movable[goal.object]
            thing.place(physics, goal.pose @ invert(thing.asset.label.pose))
    for _ in range(100):
        step = environment.step(HOLD)
    assert step.reward == 1.0
    error = task.goal_error(physics)
    assert error is not None and error[0] < 0.005


def test_the_target_of_pick_has_nothing_on_it_and_a_free_grasp(environments):
    for seed in SEEDS:
        _, task = _reset(environments, "pick", seed)
        pile, target = _pile_of(task)
        assert pile.uncovered[target]
        assert pile.free[target].sum() >= task.task_config.min_free


def test_the_targets_of_multi_are_two_or_three_and_nothing_else_lies_on_them(environments):
    counts = set()
    for seed in SEEDS:
        _, task = _reset(environments, "multi", seed)
        names = [goal.object for goal in task.goals if isinstance(goal, PoseGoal)]
        counts.add(len(names))
        assert names == list(("object", "object_second", "object_third")[: len(names)])
        pile, _ = _pile_of(task)
        own = {int(np.flatnonzero(pile.objects == i)[0]) for i in task._used[: len(names)]}
        for target in own:
            assert set(np.flatnonzero(pile.supports[:, target])) <= own
    assert counts <= {2, 3}


def test_the_target_of_stacked_lies_under_others_that_must_stay_on_the_table(environments):
    for seed in SEEDS:
        environment, task = _reset(environments, "stacked", seed)
        pile, target = _pile_of(task)
        assert pile.supports[:, target].any()
        kept = {goal.object for goal in task.goals if isinstance(goal, OnTableGoal)}
        assert kept == set(task.neighbours) == set(task.movable) - {"object"}
    fallen = task.movable[task.neighbours[0]]
    goal = next(goal for goal in task.goals if isinstance(goal, PoseGoal))
    thing, physics = task.movable["object"], environment.physics
    thing.place(physics, goal.pose @ invert(thing.asset.label.pose))
    pose = fallen.object_pose(physics)
    pose[:3, 3] = [0.5, 1.3, -0.4]
    fallen.place(physics, pose)
    for _ in range(100):
        step = environment.step(HOLD)
    assert step.reward == 0.0


def _pile_of(task: Clutter):
    """The pile of the episode, and the first target's index in it."""
    for pile in task._cache._piles.values():
        if set(pile.objects.tolist()) == set(task._used):
            return pile, int(np.flatnonzero(pile.objects == task._used[0])[0])
    raise AssertionError("no pile holds the objects of this episode")


@pytest.mark.parametrize("seed", SEEDS)
def test_no_camera_sees_more_than_two_fifths_of_the_occluded_target(environments, seed):
    environment, task = _reset(environments, "occluded", seed)
    physics = environment.physics
    mask = np.zeros(physics.model.ngeom, bool)
    geoms = task.movable["object"].mjcf_model.find_all("geom")
    mask[physics.bind(geoms).element_id] = True
    model, data = physics.model.ptr, physics.data.ptr
    assert {model.camera(i).name for i in range(model.ncam)} == set(CAMERAS)
    assert visible_share(model, data, mask, CAMERAS) <= 0.4
    # Alone it is seen.
    task._pool.use(physics, (task._used[0],))
    alone = np.eye(4)
    alone[:3, 3] = [0.5, 0.2, 0.25]
    task.movable["object"].place(physics, alone)
    physics.forward()
    assert visible_share(model, data, mask, CAMERAS[:3]) > 0.95


def test_the_names_observed_are_the_same_in_every_episode(environments):
    environment = suite.load("clutter", "multi", seed=0, observations="pose")
    keys = []
    for seed in SEEDS[:2]:
        environment.random_state.seed(seed)
        observation = environment.reset().observation
        keys.append(set(observation))
        task = environment.task
        for name, thing in task.movable.items():
            np.testing.assert_allclose(
                observation[f"pose/{name}"], thing.label_pose(environment.physics), atol=1e-6
            )
    assert keys[0] == keys[1]
    assert {"pose/object", "pose/goal_object_second", "pose/clutter_1"} <= keys[0]


def test_too_few_or_ungraspable_objects_are_refused():
    box = catalogue.load("box", 10)
    with pytest.raises(InputError, match="at least 5 objects; got 2"):
        suite.load("clutter", "pick", objects=[box, box])
    with pytest.raises(InputError, match="articulated"):
        suite.load("clutter", "pick", objects=[catalogue.load("cabinet", 0)] * 5)
