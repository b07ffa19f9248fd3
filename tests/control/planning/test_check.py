"""The checker refuses plans whose steps do not find what they need, and lets the planner's own pass."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.planning.check import PlanState, check_plan
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.planner import make_plan
from manipose_mj.errors import InputError
from manipose_mj.poses import compose
from manipose_mj.tasks.goals import InsideGoal, OpenGoal, ShutGoal
from tests.control.language.scenes import UPRIGHT, kitchen, kitchenette

TABLE = (compose(UPRIGHT, np.array([0.4, 0.0, 0.06])),)
IN_TOP = (compose(UPRIGHT, np.array([0.71, 0.0, 0.45])),)
OPEN_TOP = (Step("grasp_at", "top_drawer"), Step("move_to", "top_drawer", opening=0.19))


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        ([Step("grasp_at", "fork")], r"plan\[0\]: there is no fork; expected one of blue_can"),
        ([Step("release", "mug")], "release mug: the hand holds nothing"),
        ([Step("grasp_at", "mug")], "it ends with mug in the hand"),
        ([Step("grasp_at", "mug"), Step("grasp_at", "pan")], r"plan\[1\].*the hand holds mug"),
        ([Step("move_to", "mug", opening=0.1)], "an object moves to 'poses'"),
        ([Step("move_to", "red_can", poses=IN_TOP)], "a push only slides it"),
        ([Step("grasp_at", "mug"), Step("move_to", "mug", poses=IN_TOP)], None),
        ([Step("move_to", "top_drawer", opening=0.1)], "only a hand on its handle can open it"),
        ([Step("move_to", "top_drawer", poses=TABLE)], "a part moves to an 'opening'"),
        ([*OPEN_TOP, Step("release", "mug")], "release mug: the hand holds top_drawer"),
        (
            [Step("grasp_at", "top_drawer"), Step("move_to", "top_drawer", opening=0.3)],
            "outside 0 to 0.2",
        ),
        (
            [*OPEN_TOP, Step("move_to", "mug", poses=TABLE)],
            "move_to mug: the hand holds top_drawer",
        ),
    ],
)
def test_a_step_that_does_not_find_what_it_needs_is_one_line(plan, message):
    if message is None:  # the drawer is shut, and then lies elsewhere: the place is free air
        message = "it ends with mug in the hand"
    with pytest.raises(InputError, match=message) as caught:
        check_plan(tuple(plan), kitchen())
    assert "\n" not in str(caught.value)


def test_what_lies_in_a_shut_part_cannot_be_taken_and_nothing_put_there():
    with pytest.raises(InputError, match="inside microwave_door, which is not open then"):
        check_plan((Step("grasp_at", "bowl"), Step("release", "bowl")), kitchenette())
    place = (compose(UPRIGHT, np.array([0.9, 0.0, 0.55])),)
    steps = (Step("grasp_at", "cup"), Step("move_to", "cup", poses=place), Step("release", "cup"))
    with pytest.raises(InputError, match="the place is inside microwave_door"):
        check_plan(steps, kitchenette())


def test_what_lies_in_a_drawer_moves_with_it():
    state = PlanState(kitchenette())
    before = state.places["spoon"][0][:3, 3].copy()
    state.carry_out(Step("move_to", "drawer", opening=0.04), "plan[0]")
    np.testing.assert_allclose(state.places["spoon"][0][:3, 3] - before, [0.15, 0, 0], atol=1e-9)
    assert state.part_around(state.places["spoon"][0]) == "drawer"
    then = state.as_estimate()
    assert then.parts["drawer"].opening == 0.04
    np.testing.assert_allclose(then.objects["spoon"].label_pose, state.places["spoon"][0])


@pytest.mark.parametrize(
    "goals",
    [
        (InsideGoal("red_can", "top_drawer"), ShutGoal("top_drawer")),
        (OpenGoal("cabinet_door"),),
        (OpenGoal("bottom_drawer"), ShutGoal("cabinet_door")),
    ],
)
def test_plans_by_rules_pass(goals):
    plan = make_plan(goals, kitchen())
    assert plan
    check_plan(plan, kitchen())
