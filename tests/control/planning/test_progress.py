"""What the baseline makes of a plan that failed: whether it led on, and whether parts stand as goals have them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from manipose_mj.control.baseline import _Progress
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.plan_articulated import stand_wrong
from manipose_mj.tasks.goals import OpenGoal, ShutGoal
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
