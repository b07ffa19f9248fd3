"""Regrasping: grasps by place, ways with placements, plans for goals that name no place."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution.recovery import nearest_rests
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.grasp_table import GraspTable
from manipose_mj.control.planning.regrasp import routes
from manipose_mj.control.planning.table_places import (
    DROP_HEIGHT,
    is_free,
    poses_with_rotation,
    resting_height,
    resting_rotation,
)
from manipose_mj.control.planning.transport import destinations, transport_plans
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.evaluation import episode
from manipose_mj.mjcf.sleep import sleep_disabled
from manipose_mj.poses import compose, invert, rotation_about
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.goals import OrientationGoal, PoseGoal, UprightGoal
from manipose_mj.tasks.scene.resting import label_ups, pose_on_table
from tests.few_objects import config, load

UP = np.array([0.0, 0.0, 1.0])
ANYTHING = np.array([0.5, 0.05])


class Scene:
    """A mug on the table, as the planner sees it."""

    def __init__(self) -> None:
        mug = catalogue.load("mug", 0)
        self.environment = load(
            "single_object", "reorient_mug", seed=0, obs_mode="state", objects=[mug]
        )
        self.environment.reset()
        self.task, self.physics = self.environment.task, self.environment.physics
        self._baseline = Baseline(self.environment)
        ups = label_ups(mug)
        self.upright, self.inverted = int(ups[:, 0].argmax()), int(ups[:, 0].argmin())
        self.lying = 0

    def with_mug(self, stable: int, yaw: float = 0.3) -> tuple[MotionPlanner, SceneEstimate]:
        pose = pose_on_table(self.task.object.asset, stable, ANYTHING, yaw)
        self.task.object.place(self.physics, pose)
        with sleep_disabled(self.physics):
            self.physics.forward()
        baseline = self._baseline
        rng = np.random.default_rng(0)
        estimate = baseline.perception.observe()
        planner = MotionPlanner(estimate.scene, baseline.arm, self.task.control_timestep, rng)
        return planner, estimate


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene()


def test_usable_grasps_are_clear_of_the_table_and_in_reach(scene):
    planner, estimate = scene.with_mug(scene.upright)
    obj = estimate.objects["object"]
    table = GraspTable(planner, estimate, obj)
    everything = np.ones(len(table), bool)
    usable = table.usable(obj.label_pose, everything, as_it_lies=True, enough=len(table))
    assert 10 < usable.sum() < len(table)
    assert (usable & ~table.clear[:, scene.upright]).sum() < 0.1 * usable.sum()
    away = compose(np.eye(3), np.array([0.9, 0.0, 0.0])) @ obj.label_pose
    assert not table.usable(away, everything).any()
    inside = compose(np.eye(3), np.array([0.0, 0.0, -0.06])) @ obj.label_pose
    deep = table.usable(inside, everything, enough=len(table))
    assert deep.sum() < usable.sum()
    few = table.usable(obj.label_pose, everything, enough=1)
    assert 0 < few.sum() < usable.sum()
    assert not table.usable(obj.label_pose, ~everything).any()


def test_a_place_is_free_unless_something_is_there(scene):
    planner, estimate = scene.with_mug(scene.upright)
    obj = estimate.objects["object"]
    own = obj.label_pose
    assert is_free(planner, obj, own)
    for shift in ([0.0, 0.0, -0.02], [-0.5, 0.0, 0.0]):  # in the table, in the robot's base
        assert not is_free(planner, obj, compose(np.eye(3), np.array(shift)) @ own)


def test_an_inverted_mug_is_set_down_on_the_way_and_a_lying_one_is_not(scene):
    planner, estimate = scene.with_mug(scene.inverted)
    plan = next(transport_plans(UprightGoal("object"), estimate, planner))
    words = [step.primitive for step in plan]
    assert words == ["grasp_at", "move_to", "release"] * 2
    obj = estimate.objects["object"]
    stop = plan[1].poses[0]
    assert is_free(planner, obj, stop) and abs(stop[2, 0]) < 0.9
    assert all(pose[2, 0] > 0.99 for pose in plan[4].poses)
    planner, estimate = scene.with_mug(scene.lying)
    assert len(next(transport_plans(UprightGoal("object"), estimate, planner))) == 3
    without = next(transport_plans(UprightGoal("object"), scene.with_mug(scene.inverted)[1]))
    assert len(without) == 3  # nothing is set down where nobody can tell whether it helps


@pytest.mark.full
def test_further_ways_differ_from_the_first(scene):
    planner, estimate = scene.with_mug(scene.inverted)
    obj = estimate.objects["object"]
    goal = UprightGoal("object")
    ways = list(islice(routes(planner, estimate, obj, destinations(goal, obj)), 3))
    assert len(ways) >= 2 and all(len(way) in (1, 2, 3) for way in ways)
    stops = [np.round(way[0][0], 6).tobytes() for way in ways]
    assert len(set(stops)) == len(stops)
    _, second = islice(transport_plans(goal, estimate, planner), 2)
    np.testing.assert_allclose(second[1].poses[0], ways[1][0][0])


def test_destinations_rest_on_the_table_and_meet_the_goal(scene):
    _, estimate = scene.with_mug(scene.lying)
    obj = estimate.objects["object"]
    goals = [resting_rotation(obj, rest, 0.7) for rest in obj.rests]
    ups = np.stack([rest.rotation[2] for rest in obj.rests])
    alone = np.sort(ups @ ups.T)[:, -2] < np.cos(np.radians(30))
    drops = iter(np.where(alone, DROP_HEIGHT, 0.0))
    for rest, rotation in zip(obj.rests, goals, strict=True):
        expected = rest.height + float((rest.rotation @ obj.label.origin)[2])
        assert resting_height(obj, rotation) == pytest.approx(expected, abs=1e-9)
        drop = next(drops)
        for pose in destinations(OrientationGoal("object", rotation), obj):
            np.testing.assert_allclose(pose[:3, :3], rotation)
            assert pose[2, 3] == pytest.approx(expected + drop)
    tilted = rotation_about(np.array([1.0, 0.0, 0.0]), 0.5) @ goals[0]
    half = np.abs(tilted[2]) @ obj.label.extents / 2
    assert resting_height(obj, tilted) == pytest.approx(half)
    pose = goals[0] @ np.eye(3)
    assert len(destinations(PoseGoal("object", compose(pose, UP)), obj)) == 1


def test_what_tips_over_into_a_rest_nearby_is_set_down_without_a_drop(scene):
    _, estimate = scene.with_mug(scene.lying)
    obj = estimate.objects["object"]
    (rest, *_), rotation = obj.rests, resting_rotation(obj, obj.rests[0], 0.7)
    for angle, drop in ((0.4, 0.0), (0.7, DROP_HEIGHT)):
        turn = rotation_about(np.array([1.0, 0.0, 0.0]), angle)
        tipped = replace(rest, rotation=turn @ rest.rotation)
        own = replace(obj, rests=(rest, tipped))
        (pose, *_) = poses_with_rotation(own, rotation)
        assert pose[2, 3] - resting_height(own, rotation) == pytest.approx(drop, abs=1e-9)
    unsure = replace(obj, rests=(rest, rest), uncertainty=0.01)
    (pose, *_) = poses_with_rotation(unsure, rotation)
    assert pose[2, 3] - resting_height(unsure, rotation) == pytest.approx(DROP_HEIGHT)


def test_what_is_nearest_in_hand_keeps_its_side_and_its_turn(scene):
    _, estimate = scene.with_mug(scene.lying, yaw=1.2)
    obj = estimate.objects["object"]
    poses = nearest_rests(obj)
    for pose in poses:
        np.testing.assert_allclose(pose[:3, :3], obj.label_pose[:3, :3], atol=0.02)
    assert len(poses) == len(poses_with_rotation(obj, poses[0][:3, :3]))
    relative = invert(obj.label_pose) @ poses[0]
    np.testing.assert_allclose(relative[:3, :3], np.eye(3), atol=0.02)


# The first seeds that ask for something special: a stop on the way, a stop at the shelf.
@pytest.mark.full
@pytest.mark.parametrize(
    ("task", "seed", "releases"),
    [
        ("orientation", 0, 2),
        ("reorient_mug", 4, 1),
        ("position", 1, 1),
        ("target_pose_shelf", 3, 1),
    ],
)
def test_the_baseline_succeeds_with_as_many_placements_as_it_needs(task, seed, releases):
    result, trajectory = episode.run_episode(
        config(f"single_object/{task}", obs_mode="state"), EpisodeSpec(seed)
    )
    assert result.success_at_end, (result.failure, result.reason)
    notes = trajectory.annotations
    started = [b for a, b in zip(notes, notes[1:], strict=False) if a != b]
    assert started.count("release object") >= releases
    assert result.max_penetration < 0.003
