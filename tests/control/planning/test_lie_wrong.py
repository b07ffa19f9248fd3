"""What the baseline believes when a plan is done, or fingers have closed, and it looks at objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.execution.slip import closed_past
from manipose_mj.control.planning.transport import lie_wrong
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.goals import OpenGoal, PoseGoal, Tolerance, UprightGoal
from tests.control.language.scenes import rigid, scene

CAN = rigid("can", "can", (0.12, 0.066, 0.066), (0.45, 0.1, 0.06))


def goal_off(shift: float, turn: float) -> PoseGoal:
    """A goal so far from where the can stands [m], tilted by so much [rad]."""
    tilt = rotation_about(np.array([0.0, 1.0, 0.0]), turn)
    place = CAN.label_pose[:3, 3] + [shift, 0.0, 0.0]
    return PoseGoal("can", compose(tilt @ CAN.label_pose[:3, :3], place))


@pytest.mark.parametrize(
    ("shift", "degrees", "wrong"),
    [(0.015, 10, False), (0.03, 0, True), (0.0, 30, True), (0.021, 0, True), (0.0, 16, True)],
)
def test_what_toppled_or_rolled_away_lies_wrong(shift, degrees, wrong):
    goal = goal_off(shift, np.deg2rad(degrees))
    assert lie_wrong((goal,), scene([CAN], []), Tolerance()) is wrong


@pytest.mark.parametrize(
    ("tolerance", "shift", "degrees", "wrong"),
    [
        (Tolerance(translation=0.05), 0.04, 0, False),
        (Tolerance(translation=0.05), 0.0, 16, True),
        (Tolerance(translation=0.005), 0.01, 0, True),
        (Tolerance(rotation=0.5), 0.0, 25, False),
        (Tolerance(rotation=0.05), 0.0, 5, True),
    ],
)
def test_what_is_wrong_is_for_the_task_to_say(tolerance, shift, degrees, wrong):
    goal = goal_off(shift, np.deg2rad(degrees))
    assert lie_wrong((goal,), scene([CAN], []), tolerance) is wrong


def test_a_turn_about_the_axis_and_other_goals_do_not_count():
    spun = rotation_about(np.array([0.0, 0.0, 1.0]), 2.0) @ CAN.label_pose[:3, :3]
    goal = PoseGoal("can", compose(spun, CAN.label_pose[:3, 3]))
    goals = (goal, UprightGoal("can"), OpenGoal("drawer"))
    assert not lie_wrong(goals, scene([CAN], []), Tolerance())


@pytest.mark.parametrize(
    ("opening", "uncertainty", "past"),
    [(0.004, 0.0, True), (0.004, 0.005, False), (0.0005, 0.005, True), (0.018, 0.0, False)],
)
def test_walls_thinner_than_they_seem_are_held(opening, uncertainty, past):
    can = replace(CAN, uncertainty=uncertainty)
    assert closed_past(replace(scene([can], []), opening=opening), "can", 0.02) is past
