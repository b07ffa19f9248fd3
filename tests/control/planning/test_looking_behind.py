"""What is hidden or not measured yet is opened first, and looked at before anything else is planned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.plan_articulated import parts_to_look_behind
from manipose_mj.control.planning.plan_pieces import led_and_pushed, opened_by, until_a_look
from manipose_mj.control.planning.planner import make_plan
from manipose_mj.tasks.goals import ShutGoal, TakenOutGoal
from tests.few_objects import load

DRAWER = "middle_drawer"
TAKEN_OUT = TakenOutGoal("object", DRAWER, np.array([0.4, -0.3]), np.array([0.05, 0.05]))


@pytest.fixture(scope="module")
def scene():
    environment = load("articulated", "store_chips_can_middle_drawer", seed=1, obs_mode="state")
    environment.reset()
    estimate = OraclePerception(environment.task, environment.physics).observe()
    return environment.task.goals, estimate


def primitives(plan) -> list[str]:
    return [str(step) for step in plan]


def test_with_true_furniture_all_is_planned_at_once(scene):
    goals, estimate = scene
    plan = make_plan(goals, estimate)
    assert parts_to_look_behind(goals, estimate) == ()
    assert {step.subject for step in plan} == {"object", DRAWER}
    # Where somebody looks again, only what opens the drawer is carried out before that.
    assert primitives(until_a_look(plan)) == primitives(plan[:3])
    assert {step.subject for step in until_a_look(plan)} == {DRAWER}


def test_a_door_is_measured_between_being_led_and_being_pushed():
    led = (Step("grasp_at", "door"), Step("move_to", "door", opening=1.5), Step("release", "door"))
    push = Step("move_to", "door", opening=1.5)
    assert led_and_pushed((*led, push)) == (led, (push,))
    assert led_and_pushed(led) == (led,)
    assert led_and_pushed((push, push)) == ((push, push),)


def test_a_cavity_that_nobody_measured_is_opened_first(scene):
    goals, estimate = scene
    guessed = replace(estimate.parts[DRAWER], cavity_seen=False)
    unknown = replace(estimate, parts={**estimate.parts, DRAWER: guessed})
    plan = make_plan(goals, unknown)
    assert primitives(plan) == [f"{verb} {DRAWER}" for verb in ("grasp_at", "move_to", "release")]
    open_now = replace(guessed, opening=guessed.joint.range[1])
    assert make_plan(goals, replace(estimate, parts={DRAWER: open_now})) == ()


def test_an_object_that_is_hidden_is_looked_for_behind_its_part(scene):
    _, estimate = scene
    goals = (TAKEN_OUT, ShutGoal(DRAWER))
    hidden = replace(estimate, objects={})
    assert parts_to_look_behind(goals, hidden) == (DRAWER,)
    plan = make_plan(goals, hidden)
    assert {step.subject for step in plan} == {DRAWER}
    assert plan[1].opening is not None and plan[1].opening > 0


def test_what_steps_leave_open_is_known(scene):
    _, estimate = scene
    low, high = estimate.parts[DRAWER].joint.range
    wide, shut = (Step("move_to", DRAWER, opening=each) for each in (high, low))
    assert opened_by((wide,), estimate) == (DRAWER,)
    assert opened_by((wide, shut), estimate) == ()
