"""What a reply may look like, and which parts of it no plan is made of."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.exchanges import (
    Exchange,
    NoReplyError,
    ReplayModel,
    append_exchange,
    read_exchanges,
)
from manipose_mj.control.language.planner import LanguagePlanner
from manipose_mj.control.language.reply import RefusedError, read_reply, reply_schema
from manipose_mj.errors import InputError
from tests.control.language.scenes import kitchen

GRASP = {"primitive": "grasp_at", "subject": "mug"}
MOVE = {"primitive": "move_to", "subject": "mug", "destination": "table"}
RELEASE = {"primitive": "release", "subject": "mug"}
POSES = {"primitive": "move_to", "subject": "mug", "poses": [[0.4, 0.2, 9.0, 1, 0, 0, 0]]}
OPEN = [
    {"primitive": "grasp_at", "subject": "top_drawer"},
    {"primitive": "move_to", "subject": "top_drawer", "opening": 0.19},
    {"primitive": "release", "subject": "top_drawer"},
]
PLAIN = json.dumps({"plan": OPEN, "refusal": ""})


def read(text: str):
    estimate = kitchen()
    return read_reply(text, estimate, named_destinations((), estimate))


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        f"```json\n{PLAIN}\n```",
        f"Here is the plan:\n{PLAIN}\nGood luck!",
        f"<think>{{maybe}} open it</think>\n{PLAIN}",
        f"The object {{top_drawer}} opens: {PLAIN}",
        "\ufeff" + PLAIN,
        json.dumps({"plan": OPEN}),
        json.dumps({"plan": OPEN, "refusal": None}),
        json.dumps({"plan": OPEN, "refusal": "  "}),
    ],
    ids=["plain", "fence", "prose", "thought", "braces", "mark", "no refusal", "null", "blank"],
)
def test_a_plan_is_found_wherever_a_model_puts_it(text):
    assert [step.primitive for step in read(text)] == ["grasp_at", "move_to", "release"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("I would open it.", "answer with the JSON object only, without fences or other text"),
        ("[" * 100_000, "not valid JSON"),
        ("9" * 5000, "not valid JSON|expected an object"),
        (json.dumps({"plan": [GRASP, POSES, RELEASE]}), r"plan\[1\]: no field 'poses'"),
        (json.dumps({"plan": [GRASP, MOVE | {"subject": ["mug"]}]}), "field 'subject' is"),
        (json.dumps({"plan": [{"primitive": "grasp_at", "subject": "x" * 9000}]}), "x\\.\\.\\.; exp"),
    ],
    ids=["prose", "deep", "long number", "poses", "list", "long name"],
)  # fmt: skip
def test_what_is_no_plan_is_told_in_one_short_line(text, words):
    with pytest.raises(InputError, match=words) as caught:
        read(text)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 800


def test_a_long_refusal_is_cut_and_can_be_written():
    with pytest.raises(RefusedError) as caught:
        read(json.dumps({"plan": [], "refusal": "no \ud83d " * 10_000}))
    assert len(str(caught.value)) <= 200
    str(caught.value).encode("utf-8")


def test_every_field_of_the_schema_says_its_type():
    """Endpoints that keep strictly to a schema take no other."""

    def check(node: dict) -> None:
        assert "type" in node or "anyOf" in node
        if node.get("type") == "object":
            assert node["additionalProperties"] is False
            assert set(node["required"]) == set(node["properties"])
        for child in [*node.get("properties", {}).values(), *node.get("anyOf", ())]:
            check(child)
        if "items" in node:
            check(node["items"])

    estimate = kitchen()
    check(reply_schema(estimate, named_destinations((), estimate)))


def test_a_question_asked_again_is_answered_in_its_order(tmp_path):
    first = Exchange("m", {}, [{"role": "user", "content": "q"}], {}, "one")
    for number, reply in ((9999, "one"), (10000, "two")):
        append_exchange(tmp_path / f"{number}.jsonl", replace(first, reply=reply))
    model = ReplayModel(tmp_path)
    assert [model.answer(first.messages, {}) for _ in range(3)] == ["one", "two", "two"]
    with pytest.raises(NoReplyError, match="not among the recorded ones"):
        model.answer([], {})


@pytest.mark.parametrize("line", ["", '{"model": "m"}', "[" * 100_000, '{"reply": null}'])
def test_records_that_are_none_are_told(tmp_path, line):
    (tmp_path / "1.jsonl").write_text(line, encoding="utf-8")
    with pytest.raises(InputError, match="no recorded exchange"):
        read_exchanges(tmp_path)


def test_an_own_instruction_is_not_planned_again_until_the_goals_are_met(tmp_path):
    append_exchange(tmp_path / "1.jsonl", Exchange("m", {}, [], {}, "one"))
    model = ReplayModel(tmp_path)
    assert LanguagePlanner(model).follows_goals
    assert not LanguagePlanner(model, "Open the top drawer.").follows_goals
