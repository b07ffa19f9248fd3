"""What the baseline makes of a plan that failed: whether it led on, and whether parts stand as goals have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.baseline import _Progress
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.plan_articulated import (
    is_reached,
    leads_through,
    part_goal_plans,
    stand_wrong,
)
from manipose_mj.tasks.goals import InsideGoal, OpenGoal, ShutGoal, TakenOutGoal
from tests.few_objects import load

DRAWER = "middle_drawer"
PLAN = (Step("grasp_at", DRAWER), Step("move_to", DRAWER, opening=0.3), Step("release", DRAWER))


@pytest.fixture(scope="module")
def at():
    """The scene with a drawer open by a share of its range."""
    environment = load("articulated", "store_chips_can_middle_drawer", seed=1, obs_mode="state")
    environment.reset()
    estimate = OraclePerception(environment.task, environment.physics).observe()
    drawer = estimate.parts[DRAWER]

    def open_by(share: float):
        low, high = drawer.joint.range
        opened = replace(drawer, opening=low + share * (high - low))
        return replace(estimate, parts={**estimate.parts, DRAWER: opened})

    return open_by


def test_a_plan_that_led_on_is_tried_again_first(at):
    progress = _Progress()
    progress.led_on(at(0.0), at(0.4))
    assert not progress.failed_again(PLAN, at(0.0), counts=True)
    assert progress.failures_here == 0
    # From there it fails without leading on: the next plan, and none where that is the same again.
    progress.led_on(at(0.4), at(0.41))
    assert not progress.failed_again(PLAN, at(0.4), counts=True)
    assert progress.failures_here == 1
    assert progress.failed_again(PLAN, at(0.41), counts=True)


@pytest.mark.parametrize(("goal", "share", "wrong"), [
    (ShutGoal(DRAWER, 0.9), 0.2, True),
    (ShutGoal(DRAWER, 0.9), 0.05, False),
    (ShutGoal(DRAWER), 0.1, True),
    (ShutGoal(DRAWER), 0.01, False),
    (OpenGoal(DRAWER), 0.5, True),
    (OpenGoal(DRAWER), 0.88, False),
])  # fmt: skip
def test_parts_that_stand_otherwise_than_they_should_are_noticed(at, goal, share, wrong):
    assert stand_wrong((goal,), at(share)) is wrong


@pytest.fixture(scope="module")
def lying(at):
    """The scene with the object there, and the drawer shut."""
    estimate = at(0.0)
    drawer = estimate.parts[DRAWER]
    obj = estimate.objects["object"]
    assert drawer.cavity is not None
    inside = (drawer.base_pose @ np.append(drawer.cavity.center, 1.0))[:3]

    def at_place(place):
        pose = np.array(obj.pose)
        pose[:3, 3] += (inside if place is None else np.asarray(place)) - obj.label_pose[:3, 3]
        return replace(estimate, objects={**estimate.objects, "object": replace(obj, pose=pose)})

    return at_place


@pytest.mark.parametrize(("place", "beside"), [
    ((0.40, -0.30, 0.05), False),
    ((0.47, -0.23, 0.05), False),
    ((0.49, -0.30, 0.05), True),
    ((0.40, -0.10, 0.05), True),
    (None, True),
])  # fmt: skip
def test_what_was_taken_out_and_lies_beside_its_area_is_noticed(lying, place, beside):
    goal = TakenOutGoal("object", DRAWER, np.array([0.40, -0.30]), np.array([0.08, 0.08]))
    estimate = lying(place)
    assert stand_wrong((goal,), estimate) is beside
    assert is_reached(goal, estimate) is not beside
    # Unless it is in there still, nothing has to be opened for it.
    assert leads_through(goal, estimate) is (place is None)
    (plan,) = part_goal_plans(goal, estimate, None)
    subjects = {step.subject for step in plan}
    assert (DRAWER in subjects) is (place is None)
    assert ("object" in subjects) is beside


@pytest.mark.parametrize(("place", "outside"), [(None, False), ((0.40, -0.30, 0.05), True)])
def test_what_was_to_be_put_in_and_is_seen_outside_is_noticed(lying, place, outside):
    goal = InsideGoal("object", DRAWER)
    assert stand_wrong((goal,), lying(place)) is outside
    assert leads_through(goal, lying(place)) is outside
