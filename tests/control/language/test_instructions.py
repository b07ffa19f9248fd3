"""Sixty free instructions, some impossible, some ambiguous: each reply on record becomes the right plan or is declined.

The replies are written by hand, in the form that the endpoint's schema asks for; some are wrong at first and mended.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from manipose_mj.control.language.description import scene_text
from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.exchanges import Answer, Exchange, append_exchange
from manipose_mj.control.language.planner import LanguagePlanner
from manipose_mj.control.language.replay import ReplayModel
from manipose_mj.control.language.reply import NamedMove, reply_schema
from manipose_mj.control.planning.check import PlanState, check_plan
from manipose_mj.errors import InputError
from tests.control.language.scenes import SCENES

CASES = json.loads(Path(__file__).with_name("instructions.json").read_text(encoding="utf-8"))


def asked(case, path: Path):
    """The steps that come of an instruction when its replies are replayed."""
    estimate = SCENES[case["scene"]]()
    planner = Recorder(case["replies"])
    destinations = named_destinations((), estimate)
    live = LanguagePlanner(planner, case["instruction"], path)
    schema = reply_schema(estimate, destinations)
    messages = live.question(scene_text(estimate, destinations))
    steps = live.steps(messages, schema, estimate, destinations)
    again = LanguagePlanner(ReplayModel(path), case["instruction"]).steps(
        messages, schema, estimate, destinations
    )
    assert [str(step) for step in again] == [str(step) for step in steps]
    return estimate, tuple(step.step if isinstance(step, NamedMove) else step for step in steps)


class Recorder:
    """Gives the replies on record, one after the other."""

    name, parameters = "written by hand", {}

    def __init__(self, replies: list[str]) -> None:
        self._replies = list(replies)

    def begin(self, task, episode) -> None: ...

    def answer(self, messages, schema) -> Answer:
        return Answer(self._replies.pop(0))


def found(state: PlanState, name: str) -> str:
    """Where an object is, or how a part stands, in words."""
    if name in state.parts:
        low, high = state.parts[name].joint.range
        share = (state.openings[name] - low) / (high - low)
        return "open" if share > 0.8 else "shut" if share < 0.02 else "ajar"
    around = state.part_around(state.places[name][0])
    return "table" if around is None else f"inside {around}"


def test_there_are_sixty_of_them_in_every_scene():
    assert len(CASES) >= 60
    assert {case["scene"] for case in CASES} == set(SCENES)
    declined = [case for case in CASES if case["expected"] == "declined"]
    assert 10 <= len(declined) <= 20
    assert sum(len(case["replies"]) > 1 for case in CASES) >= 8  # mended ones


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["instruction"])
def test_an_instruction_becomes_the_plan_that_does_it(case, tmp_path):
    path = tmp_path / "exchanges.jsonl"
    if case["expected"] == "declined":
        with pytest.raises(InputError, match="the language model declines: ") as caught:
            asked(case, path)
        assert "\n" not in str(caught.value)
        return
    estimate, plan = asked(case, path)
    check_plan(plan, estimate)
    state = PlanState(estimate)
    for step in plan:
        state.carry_out(step, "")
    assert {name: found(state, name) for name in case["expected"]} == case["expected"]


def test_a_question_that_was_not_recorded_has_no_answer(tmp_path):
    append_exchange(tmp_path / "e.jsonl", Exchange("m", {}, [], {}, "{}"))
    planner = LanguagePlanner(ReplayModel(tmp_path / "e.jsonl"), "Open the top drawer.")
    estimate = SCENES["kitchen"]()
    with pytest.raises(InputError, match="not among the recorded ones"):
        planner.steps([{"role": "user", "content": "?"}], {}, estimate, {})
