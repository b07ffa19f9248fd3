"""What a reply may look like, and which parts of it no plan is made of."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.exchanges import (
    Exchange,
    NoReplyError,
    append_exchange,
    read_exchanges,
)
from manipose_mj.control.language.planner import LanguagePlanner
from manipose_mj.control.language.replay import ReplayModel
from manipose_mj.control.language.reply import RefusedError, read_reply, reply_schema
from manipose_mj.errors import InputError
from manipose_mj.evaluation.planner_settings import PlannerSettings
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
        f'Nothing, {{"plan": []}}, would not do.\n{PLAIN}',
        f'{{"answer": {PLAIN}}} is it',
        "\ufeff" + PLAIN,
        json.dumps({"plan": OPEN}),
        json.dumps({"plan": OPEN, "refusal": None}),
        json.dumps({"plan": OPEN, "refusal": "  "}),
    ],
    ids=[
        "plain",
        "fence",
        "prose",
        "thought",
        "braces",
        "draft",
        "wrapped",
        "mark",
        "no refusal",
        "null",
        "blank",
    ],
)
def test_a_plan_is_found_wherever_a_model_puts_it(text):
    steps = [str(step) for step in read(text)]
    assert steps == ["grasp_at top_drawer", "move_to top_drawer", "release top_drawer"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("I would open it.", "answer with the JSON object only, its text in straight double quotes"),
        ("[" * 100_000, "not valid JSON"),
        ("9" * 5000, "not valid JSON|expected an object"),
        (json.dumps({"plan": [GRASP, POSES, RELEASE]}), r"plan\[1\]: no field 'poses'"),
        (json.dumps({"plan": [GRASP, {"primitive": "move_to", "subject": "mug"}]}), "one of 'destination' and"),
        ('{"plan": [%s]}' % ("[" * 900 + "]" * 900), "plan|not valid JSON"),
        (json.dumps({"plan": [GRASP, MOVE | {"subject": ["mug"]}]}), "field 'subject' is"),
        (json.dumps({"plan": [{"primitive": "grasp_at", "subject": "x" * 9000}]}), "x\\.\\.\\.; exp"),
    ],
    ids=["prose", "deep", "long number", "poses", "no place", "nested", "list", "long name"],
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


def test_a_blank_refusal_is_one():
    with pytest.raises(RefusedError, match="it gives no reason"):
        read(json.dumps({"plan": [], "refusal": " "}))


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
    assert [model.answer(first.messages, {}).text for _ in range(3)] == ["one", "two", "two"]
    with pytest.raises(NoReplyError, match="not among the recorded ones"):
        model.answer([], {})


@pytest.mark.parametrize("line", ["", '{"model": "m"}', "[" * 100_000, '{"reply": null}'])
def test_records_that_are_none_are_told(tmp_path, line):
    (tmp_path / "1.jsonl").write_text(line, encoding="utf-8")
    with pytest.raises(InputError, match="no recorded exchange"):
        read_exchanges(tmp_path)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('{"a": 1}', "lacks field 'model'"),
        ('{"model": "m", "parameters": {}}', "lacks field 'messages'"),
        (
            '{"model": "m", "parameters": {}, "messages": [], "schema": {}, "reply": "", "a": 1}',
            "unknown field 'a'",
        ),
        ("[1]", "it is no JSON object"),
    ],
)
def test_records_of_other_fields_are_told_by_these(tmp_path, line, said):
    path = tmp_path / "1.jsonl"
    path.write_text(f"{line}\n", encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        read_exchanges(path)
    assert str(refusal.value) == f"{path}, line 1: no recorded exchange ({said})"


def test_files_of_records_that_cannot_be_read_are_told(tmp_path):
    with pytest.raises(InputError, match=r"cannot be read \(No such file or directory\)$"):
        read_exchanges(tmp_path / "none.jsonl")
    path = tmp_path / "1.jsonl"
    path.write_bytes(b"\xff\n")
    with pytest.raises(InputError, match=r"cannot be read \(no text in UTF-8\)$"):
        read_exchanges(path)


def test_a_line_that_a_killed_process_left_unfinished_is_dropped_by_the_next_of_its_number(
    tmp_path,
):
    path, exchanges = tmp_path / "1.jsonl", [Exchange("m", {}, [], {}, str(i)) for i in range(3)]
    append_exchange(path, exchanges[0])
    path.write_bytes(path.read_bytes() + b'{"model": "m", "par')
    for exchange in exchanges[1:]:
        append_exchange(path, exchange)
    assert read_exchanges(path) == exchanges


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("episode", "[1]", "whole number or null"),
        ("cut", '"no"', "true or false"),
        ("seconds", '"x"', "number"),
        ("at", "NaN", "finite number"),
    ],
)
def test_a_damaged_field_is_named(tmp_path, field, value, said):
    path = tmp_path / "1.jsonl"
    append_exchange(path, Exchange("m", {}, [], {}, "one"))
    document = json.loads(path.read_text()) | {field: "HERE"}
    path.write_text(json.dumps(document).replace('"HERE"', value) + "\n")
    with pytest.raises(InputError, match=f"line 1: .*field '{field}' is no {said}"):
        read_exchanges(path)


def test_an_own_instruction_is_not_planned_again_until_the_goals_are_met(tmp_path):
    append_exchange(tmp_path / "1.jsonl", Exchange("m", {}, [], {}, "one"))
    model = ReplayModel(tmp_path)
    assert LanguagePlanner(model).follows_goals
    assert not LanguagePlanner(model, "Open the top drawer.").follows_goals


ASKED = [{"role": "system", "content": "rules"}, {"role": "user", "content": "scene\n\nInstruction: a"}]  # fmt: skip


def recorded(reply: str, episode: int, number: int, at: float, **more) -> Exchange:
    return Exchange(
        "m", {}, ASKED, {}, reply, "", 0.1, False, "a/b", episode, number, at=at, **more
    )


def test_each_episode_gets_its_own_answers_again_in_whatever_order_episodes_are_played(tmp_path):
    """Two processes have played them, one of which was killed and began its episode anew."""
    for name, exchange in (
        ("10", recorded("killed", 0, 0, at=1.0)),
        ("9", recorded("other one", 1, 0, at=2.0)),
        ("9", recorded("first", 0, 0, at=4.0)),
        ("10", recorded("other two", 1, 1, at=3.0)),
        ("9", recorded("second", 0, 1, at=5.0)),
    ):
        append_exchange(tmp_path / f"{name}.jsonl", exchange)
    for order in ((0, 1), (1, 0)):
        model, given = ReplayModel(tmp_path), {}
        for episode in order:
            model.begin("a/b", episode)
            given[episode] = [model.answer(ASKED, {}).text for _ in range(3)]
        assert given == {
            0: ["first", "second", "second"],
            1: ["other one", "other two", "other two"],
        }


def test_exchanges_bear_the_name_of_their_episode(tmp_path):
    append_exchange(tmp_path / "1.jsonl", recorded(PLAIN, 4, 0, at=1.0))
    planner = LanguagePlanner(ReplayModel(tmp_path), record=tmp_path / "2.jsonl")
    for episode in (4, 5):
        planner.name_episode("a/b", episode)
        planner.reset("a")
        for _ in range(2):
            planner.steps(ASKED, {}, kitchen(), {})
    found = read_exchanges(tmp_path / "2.jsonl")
    named = [(each.task, each.episode, each.number) for each in found]
    assert named == [("a/b", 4, 0), ("a/b", 4, 1), ("a/b", 5, 0), ("a/b", 5, 1)]
    assert all(each.at > 0 for each in found)


def test_a_replay_takes_an_own_instruction_from_the_records(tmp_path):
    append_exchange(tmp_path / "1.jsonl", recorded(PLAIN, 0, 0, 1.0, instruction="Open it."))
    assert not PlannerSettings("replay", replay=tmp_path).make().follows_goals
    append_exchange(tmp_path / "1.jsonl", recorded(PLAIN, 1, 0, 1.0))
    assert PlannerSettings("replay", replay=tmp_path).make().follows_goals


def test_another_instruction_than_the_recorded_one_is_named(tmp_path):
    append_exchange(tmp_path / "1.jsonl", Exchange("m", {}, ASKED, {}, PLAIN))
    other = [ASKED[0], ASKED[1] | {"content": "scene\n\nInstruction: b"}]
    with pytest.raises(NoReplyError, match="was recorded with --instruction 'a'"):
        ReplayModel(tmp_path).answer(other, {})


def test_the_line_of_a_process_that_was_killed_is_left_out(tmp_path):
    append_exchange(tmp_path / "1.jsonl", Exchange("m", {}, ASKED, {}, PLAIN))
    with (tmp_path / "1.jsonl").open("a", encoding="utf-8") as file:
        file.write('{"model": "m", "par')
    assert len(read_exchanges(tmp_path)) == 1
