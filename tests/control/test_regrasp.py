"""Regrasping: grasps by place, ways with placements, plans for goals that name no place."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from asset_pipeline import catalogue
from manipose_mj import suite
from manipose_mj.control import episode
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.belief import Belief
from manipose_mj.control.carrying import carry, destinations
from manipose_mj.control.grasp_table import GraspTable
from manipose_mj.control.motion_planner import MotionPlanner
from manipose_mj.control.recovery import nearest_rests
from manipose_mj.control.regrasp import routes
from manipose_mj.control.table_places import (
    DROP_HEIGHT,
    is_free,
    poses_with_rotation,
    resting_height,
    resting_rotation,
)
from manipose_mj.mjcf.sleep import static_things_moving
from manipose_mj.poses import compose, invert, rotation_about
from manipose_mj.tasks.goals import OrientationGoal, PoseGoal, UprightGoal
from manipose_mj.tasks.resting import label_ups, pose_on_table

UP = np.array([0.0, 0.0, 1.0])
ANYTHING = np.array([0.5, 0.05])


class Scene:
    """A mug on the table, as the planner sees it."""

    def __init__(self) -> None:
        mug = catalogue.load("mug", 0)
        self.environment = suite.load(
            "single_object", "reorient_mug", seed=0, observations="state", objects=[mug]
        )
        self.environment.reset()
        self.task, self.physics = self.environment.task, self.environment.physics
        self._baseline = Baseline(self.environment)
        ups = label_ups(mug)
        self.upright, self.inverted = int(ups[:, 0].argmax()), int(ups[:, 0].argmin())
        self.lying = 0

    def with_mug(self, stable: int, yaw: float = 0.3) -> tuple[MotionPlanner, Belief]:
        pose = pose_on_table(self.task.object.asset, stable, ANYTHING, yaw)
        self.task.object.place(self.physics, pose)
        with static_things_moving(self.physics):
            self.physics.forward()
        baseline = self._baseline
        rng = np.random.default_rng(0)
        planner = MotionPlanner(
            baseline.senses.begin(0), baseline._arm, self.task.control_timestep, rng
        )
        return planner, baseline.senses.look()


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene()


def test_usable_grasps_are_clear_of_the_table_and_in_reach(scene):
    planner, belief = scene.with_mug(scene.upright)
    thing = belief.objects["object"]
    table = GraspTable(planner, belief, thing)
    everything = np.ones(len(table), bool)
    before = planner.scene.data.qpos.copy()
    usable = table.usable(thing.label_pose, everything, as_it_lies=True, enough=len(table))
    np.testing.assert_array_equal(planner.scene.data.qpos, before)
    assert 10 < usable.sum() < len(table)
    assert (usable & ~table.clear[:, scene.upright]).sum() < 0.1 * usable.sum()
    away = compose(np.eye(3), np.array([0.9, 0.0, 0.0])) @ thing.label_pose
    assert not table.usable(away, everything).any()
    inside = compose(np.eye(3), np.array([0.0, 0.0, -0.06])) @ thing.label_pose
    deep = table.usable(inside, everything, enough=len(table))
    assert deep.sum() < usable.sum()
    few = table.usable(thing.label_pose, everything, enough=1)
    assert 0 < few.sum() < usable.sum()
    assert not table.usable(thing.label_pose, ~everything).any()


def test_a_place_is_free_unless_something_is_there(scene):
    planner, belief = scene.with_mug(scene.upright)
    thing = belief.objects["object"]
    own = thing.label_pose
    assert is_free(planner, thing, own)
    for shift in ([0.0, 0.0, -0.02], [-0.5, 0.0, 0.0]):  # in the table, in the robot's base
        assert not is_free(planner, thing, compose(np.eye(3), np.array(shift)) @ own)


def test_an_inverted_mug_is_set_down_on_the_way_and_a_lying_one_is_not(scene):
    planner, belief = scene.with_mug(scene.inverted)
    plan = carry(UprightGoal("object"), belief, planner)
    words = [step.primitive for step in plan]
    assert words == ["grasp_at", "move_to", "release"] * 2
    thing = belief.objects["object"]
    stop = plan[1].poses[0]
    assert is_free(planner, thing, stop) and abs(stop[2, 0]) < 0.9
    assert all(pose[2, 0] > 0.99 for pose in plan[4].poses)
    planner, belief = scene.with_mug(scene.lying)
    assert len(carry(UprightGoal("object"), belief, planner)) == 3
    without = carry(UprightGoal("object"), scene.with_mug(scene.inverted)[1])
    assert len(without) == 3  # nothing is set down where nobody can tell whether it helps


def test_further_ways_differ_from_the_first(scene):
    planner, belief = scene.with_mug(scene.inverted)
    thing = belief.objects["object"]
    goal = UprightGoal("object")
    ways = list(islice(routes(planner, belief, thing, destinations(goal, thing)), 3))
    assert len(ways) >= 2 and all(len(way) in (1, 2, 3) for way in ways)
    stops = [np.round(way[0][0], 6).tobytes() for way in ways]
    assert len(set(stops)) == len(stops)
    second = carry(goal, belief, planner, skip=1)
    np.testing.assert_allclose(second[1].poses[0], ways[1][0][0])


def test_destinations_rest_on_the_table_and_meet_the_goal(scene):
    _, belief = scene.with_mug(scene.lying)
    thing = belief.objects["object"]
    goals = [resting_rotation(thing, rest, 0.7) for rest in thing.rests]
    for rest, rotation in zip(thing.rests, goals, strict=True):
        expected = rest.height + float((rest.rotation @ thing.label.origin)[2])
        assert resting_height(thing, rotation) == pytest.approx(expected, abs=1e-9)
        for pose in destinations(OrientationGoal("object", rotation), thing):
            np.testing.assert_allclose(pose[:3, :3], rotation)
            assert pose[2, 3] == pytest.approx(expected + DROP_HEIGHT)
    tilted = rotation_about(np.array([1.0, 0.0, 0.0]), 0.5) @ goals[0]
    half = np.abs(tilted[2]) @ thing.label.extents / 2
    assert resting_height(thing, tilted) == pytest.approx(half)
    pose = goals[0] @ np.eye(3)
    assert len(destinations(PoseGoal("object", compose(pose, UP)), thing)) == 1


def test_what_is_nearest_in_hand_keeps_its_side_and_its_turn(scene):
    _, belief = scene.with_mug(scene.lying, yaw=1.2)
    thing = belief.objects["object"]
    poses = nearest_rests(thing)
    for pose in poses:
        np.testing.assert_allclose(pose[:3, :3], thing.label_pose[:3, :3], atol=0.02)
    assert len(poses) == len(poses_with_rotation(thing, poses[0][:3, :3]))
    relative = invert(thing.label_pose) @ poses[0]
    np.testing.assert_allclose(relative[:3, :3], np.eye(3), atol=0.02)


# The first seeds that ask for something special: a stop on the way, a stop at the shelf.
@pytest.mark.parametrize(
    ("task", "seed", "releases"),
    [
        ("orientation", 8, 2),
        ("reorient_mug", 4, 1),
        ("position", 1, 1),
        ("target_pose_shelf", 3, 1),
    ],
)
def test_the_baseline_succeeds_with_as_many_placements_as_it_needs(task, seed, releases):
    result, trajectory = episode.run_episode(f"single_object/{task}", episode=0, seed=seed)
    assert result.success_at_end, (result.failure, result.reason)
    notes = trajectory.annotations
    begun = [b for a, b in zip(notes, notes[1:], strict=False) if a != b]
    assert begun.count("release object") >= releases
    assert result.max_penetration < 0.003
