"""The clutter tasks: what their starts and goals promise, on every seed tried."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.poses import invert
from manipose_mj.tasks.clutter.object_draw import Mixture, pile_of
from manipose_mj.tasks.clutter.occluded import CAMERAS
from manipose_mj.tasks.clutter.task import Clutter
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.goals import OnTableGoal, PoseGoal
from manipose_mj.tasks.observations.visibility import visible_share
from tests.few_objects import load

TASKS = ("pick", "multi", "stacked", "occluded")
# Few, and the same for all: each may have to drop its pile first.
SEEDS = (0, 3, 4)
HOLD = np.append(HOME, MAX_OPENING)


@pytest.fixture(scope="module")
def environments():
    made = {}

    def get(name: str):
        if name not in made:
            made[name] = load("clutter", name, seed=0, obs_mode="state")
        return made[name]

    return get


def _reset(environments, name: str, seed: int):
    environment = environments(name)
    environment.random_state.seed(seed)
    environment.reset()
    assert isinstance(environment.task, Clutter)
    return environment, environment.task


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", TASKS)
def test_a_pile_lies_still_on_the_table_and_within_reach(environments, name, seed):
    environment, task = _reset(environments, name, seed)
    physics, objects = environment.physics, task.objects
    assert 5 <= len(objects) <= 15
    before = {name: obj.object_pose(physics) for name, obj in objects.items()}
    for _ in range(100):
        environment.step(HOLD)
    for obj, pose in before.items():
        now = objects[obj].object_pose(physics)
        assert np.linalg.norm(now[:3, 3] - pose[:3, 3]) < 1e-3, obj
        assert now[2, 3] > 0 and np.linalg.norm(now[:2, 3]) < 0.85
    assert task.max_penetration < 0.002


@pytest.mark.sample(2)
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
        for other in task.objects.values():
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
            obj = task.objects[goal.object]
            obj.place(physics, goal.pose @ invert(obj.asset.label.pose))
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
        free = ~pile.obstacles[target].any(axis=1)
        assert free.sum() >= task.task_config.min_free


def test_the_targets_of_multi_are_two_or_three_and_nothing_else_lies_on_them(environments):
    counts = set()
    for seed in SEEDS:
        _, task = _reset(environments, "multi", seed)
        names = [goal.object for goal in task.goals if isinstance(goal, PoseGoal)]
        counts.add(len(names))
        assert names == list(("object", "object_second", "object_third")[: len(names)])
        pile, _ = _pile_of(task)
        own = {int(np.flatnonzero(pile.objects == i)[0]) for i in _used(task)[: len(names)]}
        for target in own:
            assert set(np.flatnonzero(pile.supports[:, target])) <= own
    assert counts <= {2, 3}


@pytest.mark.full
def test_the_target_of_stacked_lies_under_others_that_must_stay_on_the_table(environments):
    for seed in SEEDS:
        environment, task = _reset(environments, "stacked", seed)
        pile, target = _pile_of(task)
        assert pile.supports[:, target].any()
        kept = {goal.object for goal in task.goals if isinstance(goal, OnTableGoal)}
        assert kept == set(task.neighbours) == set(task.objects) - {"object"}
    fallen = task.objects[task.neighbours[0]]
    goal = next(goal for goal in task.goals if isinstance(goal, PoseGoal))
    obj, physics = task.objects["object"], environment.physics
    obj.place(physics, goal.pose @ invert(obj.asset.label.pose))
    pose = fallen.object_pose(physics)
    pose[:3, 3] = [0.5, 1.3, -0.4]
    fallen.place(physics, pose)
    for _ in range(100):
        step = environment.step(HOLD)
    assert step.reward == 0.0


def _used(task: Clutter) -> list[int]:
    """The objects of the episode by their indices in the pool, targets first."""
    return [placed.index for placed in task.start.objects.values()]


def _pile_of(task: Clutter):
    """The pile of the episode, and the first target's index in it."""
    for pile in task._cache._piles.values():
        if set(pile.objects.tolist()) == set(_used(task)):
            return pile, int(np.flatnonzero(pile.objects == _used(task)[0])[0])
    raise AssertionError("no pile holds the objects of this episode")


@pytest.mark.parametrize("seed", SEEDS)
def test_no_camera_sees_more_than_two_fifths_of_the_occluded_target(environments, seed):
    environment, task = _reset(environments, "occluded", seed)
    physics = environment.physics
    mask = np.zeros(physics.model.ngeom, bool)
    geoms = task.objects["object"].mjcf_model.find_all("geom")
    mask[physics.bind(geoms).element_id] = True
    model, data = physics.model.ptr, physics.data.ptr
    assert {model.camera(i).name for i in range(model.ncam)} == set(CAMERAS)
    assert visible_share(model, data, mask, CAMERAS) <= 0.4
    # Alone it is seen.
    task.pool.use(physics, (task.start.objects["object"].index,))
    alone = np.eye(4)
    alone[:3, 3] = [0.5, 0.2, 0.25]
    task.objects["object"].place(physics, alone)
    physics.forward()
    assert visible_share(model, data, mask, CAMERAS[:3]) > 0.95


def test_the_names_observed_are_the_same_in_every_episode(environments):
    environment = load("clutter", "multi", seed=0, obs_mode="pose")
    keys = []
    for seed in SEEDS[:2]:
        environment.random_state.seed(seed)
        observation = environment.reset().observation
        keys.append(set(observation))
        task = environment.task
        for name, obj in task.objects.items():
            np.testing.assert_allclose(
                observation[f"pose/{name}"], obj.label_pose(environment.physics), atol=1e-6
            )
    assert keys[0] == keys[1]
    assert {"pose/object", "pose/goal_object_second", "pose/clutter_1"} <= keys[0]


def test_too_few_or_ungraspable_objects_are_refused():
    box = catalogue.load("box", 10)
    with pytest.raises(InputError, match="at least 5 objects; got 2"):
        suite.load("clutter", "pick", objects=[box, catalogue.load("box", 16)])
    with pytest.raises(InputError, match="articulated"):
        suite.load("clutter", "pick", objects=[catalogue.load("cabinet", 0)] * 5)


def test_of_a_folder_only_what_a_pile_can_have_is_drawn():
    boxes = [catalogue.load("box", index) for index in (0, 1, 2, 10, 16)]
    others = [catalogue.load("cabinet", 0), catalogue.load("microwave", 0)]
    draw = pile_of(Mixture(flat=0))(
        EnvConfig("clutter/pick", split="test", objects=[*others, *boxes])
    )
    alone = pile_of(Mixture(flat=0))(EnvConfig("clutter/pick", split="test", objects=boxes))
    for seed in range(3):
        drawn = draw(np.random.RandomState(seed), EpisodeSpec()).assets
        assert sorted(asset.name for asset in drawn) == [asset.name for asset in boxes]
        assert drawn == alone(np.random.RandomState(seed), EpisodeSpec()).assets
