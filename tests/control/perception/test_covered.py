"""A target that no camera sees: what may hide it goes first, and it is looked for after each move."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception import estimated
from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.objects.known_shapes import shape_of
from manipose_mj.control.perception.objects.object_views import ObjectViews
from manipose_mj.control.perception.objects.shape_fits import OneShape
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.control.planning.rearrangement import candidate_moves, in_clutter
from manipose_mj.failures import StageFailure
from manipose_mj.ppf_jax.estimator import PoseEstimate
from manipose_mj.tasks.goals import OrientationGoal
from tests.few_objects import load


class AtItsMiddle:
    """An estimator that says an object is where its cloud's middle is."""

    def estimate(self, cloud: Any, *, key: Any) -> PoseEstimate:
        pose = np.eye(4)
        pose[:3, 3] = cloud.points.mean(axis=0)
        return PoseEstimate(pose, np.ptp(cloud.points, axis=0), 1.0)


@pytest.fixture
def pile(monkeypatch):
    """A task of a pile, its perception, and the names of what no camera sees."""
    environment = load(
        "clutter", "occluded", seed=0, obs_mode="state", sensors=sensors_for("estimated")
    )
    environment.reset()
    task, covered = environment.task, {"object"}
    shape = OneShape(shape_of(task.objects["object"].asset))
    monkeypatch.setattr(estimated, "shapes_of", lambda kind: shape)
    of = ObjectViews.of
    monkeypatch.setattr(
        ObjectViews, "of", lambda self, p, name: () if name in covered else of(self, p, name)
    )
    perception = EstimatedPerception(
        task, environment.physics, estimators=lambda kind: AtItsMiddle()
    )
    yield task, perception, covered  # the environment stays alive


def test_what_hides_a_target_goes_first_and_the_target_is_found_then(pile):
    task, perception, covered = pile
    perception.reset(0)
    assert perception.unseen == {"object"}
    estimate = perception.observe()
    assert estimate.unseen == {"object": task.objects["object"].asset.category}
    assert in_clutter(task.goals, estimate)
    planner = MotionPlanner(estimate.scene, perception.arm, 0.02, np.random.default_rng(0))
    first = next(candidate_moves(task.goals, estimate, planner)).steps()
    assert [step.primitive for step in first] == ["grasp_at", "move_to", "release"]
    assert first[0].subject in estimate.objects.keys() - {"object"}
    perception.look_around()
    assert perception.unseen == {"object"}
    covered.clear()
    perception.look_around()
    estimate = perception.observe()
    assert not perception.unseen and not estimate.unseen and "object" in estimate.objects


def test_where_nothing_is_seen_nothing_can_hide_a_target(pile):
    task, perception, covered = pile
    covered.update(task.objects)
    with pytest.raises(StageFailure, match="no camera sees enough of object"):
        perception.reset(0)


def test_only_in_clutter_is_anything_moved_off_a_target(pile, monkeypatch):
    task, perception, _ = pile
    goals = (OrientationGoal("object", np.eye(3)),)
    monkeypatch.setattr(type(task), "goals", property(lambda self: goals))
    with pytest.raises(StageFailure, match="no camera sees enough of object"):
        perception.reset(0)


def test_an_episode_that_is_not_for_its_goals_begins_without_them(pile):
    task, perception, covered = pile
    covered.update(task.objects)
    perception.reset(0, for_goals=False)
    assert perception.unseen == {"object"} and not perception.observe().objects
