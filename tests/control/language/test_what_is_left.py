"""An answer is carried out once, whatever looks at the scene lie between its steps; later questions say what was done."""

from __future__ import annotations

import json
from collections.abc import Iterator
from unittest.mock import Mock, patch

import numpy as np
import pytest

from manipose_mj.control.baseline import Baseline
from manipose_mj.control.language import planner as language_planner
from manipose_mj.control.language.exchanges import INSTRUCTION, Answer
from manipose_mj.control.language.planner import LanguagePlanner
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.planning.plan import Plan
from manipose_mj.control.planning.table_places import HOME
from manipose_mj.failures import StageFailure
from manipose_mj.tasks.goals import Tolerance
from tests.control.language.scenes import kitchen
from tests.few_objects import load

DRAWER, OTHER = "middle_drawer", "top_drawer"


def led(part: str, opening: float) -> list[dict]:
    return [
        {"primitive": "grasp_at", "subject": part},
        {"primitive": "move_to", "subject": part, "opening": opening},
        {"primitive": "release", "subject": part},
    ]


def put(name: str, place: str) -> list[dict]:
    return [
        {"primitive": "grasp_at", "subject": name},
        {"primitive": "move_to", "subject": name, "destination": place},
        {"primitive": "release", "subject": name},
    ]


def shut(part: str) -> list[dict]:
    return [{"primitive": "move_to", "subject": part, "opening": 0.0}]


class Model:
    """Gives one plan after the other; remembers what it was asked."""

    name, parameters = "written by hand", {}

    def __init__(self, *plans: list[dict]) -> None:
        self._plans, self.questions = list(plans), []

    def begin(self, task, episode) -> None: ...

    def answer(self, messages, schema) -> Answer:
        self.questions.append(messages[1]["content"])
        return Answer(json.dumps({"plan": self._plans.pop(0), "refusal": ""}))


def planned(planner: LanguagePlanner) -> Plan:
    """The next plan in the kitchen, where any place on the table is free."""
    with patch.object(language_planner, "places_aside", lambda obj, *_, **__: (obj.label_pose,)):
        candidates = planner.candidates((), kitchen(), Mock(spec=MotionPlanner), Tolerance())
        return next(candidates).steps()


def words(plan: Plan) -> list[str]:
    return [str(step) for step in plan]


def test_what_comes_after_a_look_is_the_rest_of_the_answer():
    model = Model(led(DRAWER, 0.19) + shut(DRAWER) + led(OTHER, 0.19))
    planner = LanguagePlanner(model, "Open the middle drawer, shut it, then open the top one.")
    planner.reset("")
    for step in planned(planner)[:4]:
        planner.carried_out(step)
    assert words(planned(planner)) == [f"{each} {OTHER}" for each in ("grasp_at", "move_to", "release")]  # fmt: skip
    assert len(model.questions) == 1


def test_a_rest_that_is_wrong_by_now_is_asked_about_with_what_was_done():
    model = Model(led(DRAWER, 0.19) + put("mug", f"inside {DRAWER}"), put("blue_can", "table"))
    planner = LanguagePlanner(model, "Put the mug into the middle drawer.")
    planner.reset("")
    for step in planned(planner)[:3]:
        planner.carried_out(step)
    # It did not open: nothing can be put into it.
    assert words(planned(planner))[0] == "grasp_at blue_can"
    first, second = model.questions
    assert "Done so far" not in first
    done = second.partition(INSTRUCTION)[0].partition("Done so far:\n")[2].splitlines()
    assert done == [
        f"- grasp_at {DRAWER}",
        f"- move_to {DRAWER}, opening 0.190",
        f"- release {DRAWER}",
    ]


def test_a_failure_is_told_with_what_was_done_before_it():
    model = Model(put("mug", "table"), put("mug", "table"), put("mug", "table"))
    planner = LanguagePlanner(model)
    planner.reset("Put the mug elsewhere.")
    for step in planned(planner)[:2]:
        planner.carried_out(step)
    planner.failed("release mug: it slipped\nout")
    planned(planner)
    assert '- move_to mug, destination "table"\n' in model.questions[1]
    assert "- given up, with the hand emptied: release mug: it slipped out\n" in model.questions[1]
    planner.reset("Put the mug elsewhere.")
    planned(planner)
    assert "Done so far" not in model.questions[2]  # another episode


def test_places_on_the_table_are_free_though_a_drawer_stands_where_the_arm_waits():
    motions = Mock(spec=MotionPlanner)
    motions.collides.side_effect = lambda joints, query: np.array_equal(joints, HOME)
    planner = LanguagePlanner(Model(put("mug", "table")))
    planner.reset("Put the mug elsewhere.")
    plan = next(planner.candidates((), kitchen(), motions, Tolerance())).steps()
    assert words(plan) == ["grasp_at mug", "move_to mug", "release mug"]


@pytest.fixture
def played(monkeypatch) -> Iterator:
    """Plays an own instruction among estimated furniture, without a motion: steps carried out, and questions."""
    monkeypatch.setattr(OraclePerception, "feels_joints", True)
    began = []
    monkeypatch.setattr(
        OraclePerception, "reset", lambda self, seed, for_goals=True: began.append(for_goals)
    )
    environment = load("articulated", "store_chips_can_middle_drawer", seed=1, obs_mode="state")
    environment.reset()

    def play(model: Model, instruction: str | None = "As the model has it.") -> list[str]:
        planner, steps = LanguagePlanner(model, instruction), []

        def carry_out(self, plan, *_, **__):
            for step in plan:
                steps.append(str(step))
                planner.carried_out(step)
            yield from ()

        monkeypatch.setattr(Baseline, "_carry_out", carry_out)
        for _ in Baseline(environment, planner=planner).actions(0):
            pass
        assert began == [instruction is None]
        return steps

    yield play  # the environment stays alive


def test_an_own_instruction_is_carried_out_once(played):
    plan = led(DRAWER, 0.2) + shut(DRAWER) + put("object", "table")
    model = Model(plan, plan)
    assert played(model) == [f"{each['primitive']} {each['subject']}" for each in plan]
    assert len(model.questions) == 1


def test_an_own_instruction_needs_no_object_of_the_goals(played, monkeypatch):
    monkeypatch.setattr(OraclePerception, "unseen", frozenset({"object"}))
    plan = led(DRAWER, 0.2)
    assert len(played(Model(plan, plan))) == 3


def test_what_a_drawer_shows_is_asked_about(played, monkeypatch):
    hidden = {"object"}
    monkeypatch.setattr(OraclePerception, "unseen", property(lambda self: frozenset(hidden)))
    monkeypatch.setattr(OraclePerception, "look_again", lambda self: hidden.clear())
    model = Model(led(DRAWER, 0.2), put("object", "table"))
    assert played(model)[3:] == ["grasp_at object", "move_to object", "release object"]
    assert f"- release {DRAWER}\n" in model.questions[1]


def test_what_goals_are_about_has_to_show(played, monkeypatch):
    monkeypatch.setattr(OraclePerception, "unseen", frozenset({"object"}))
    with pytest.raises(StageFailure, match="no camera sees enough of object"):
        played(Model(led(DRAWER, 0.2) + shut(DRAWER) + put("object", "table")), None)
