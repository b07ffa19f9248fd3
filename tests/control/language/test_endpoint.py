"""The endpoint of a language model: every way to answer ends in a plan or in one clear line, and no key is on record."""

from __future__ import annotations

import json
import time
from http.server import BaseHTTPRequestHandler

import pytest

from manipose_mj.control.language.description import scene_text
from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.endpoint import KEY_VARIABLE, URL_VARIABLE, EndpointModel
from manipose_mj.control.language.exchanges import read_exchanges
from manipose_mj.control.language.planner import MAX_REPAIRS, LanguagePlanner
from manipose_mj.control.language.replay import ReplayModel
from manipose_mj.errors import InputError, RecordError
from tests.control.language.local_server import GOOD, KEY, asked, refuses, says, send, status
from tests.control.language.scenes import kitchen

UNKNOWN = GOOD.replace("top_drawer", "fridge")
UNORDERED = json.dumps({"plan": [{"primitive": "release", "subject": "mug"}], "refusal": ""})


def hangs(handler: BaseHTTPRequestHandler) -> None:
    time.sleep(1.5)


def breaks_off(handler: BaseHTTPRequestHandler) -> None:
    handler.connection.close()


def test_a_good_plan_is_taken_and_on_record_without_the_key(serve, tmp_path):
    server = serve(says(GOOD))
    ask, path = asked(server, tmp_path)
    assert [str(step) for step in ask()] == [
        "grasp_at top_drawer",
        "move_to top_drawer",
        "release top_drawer",
    ]
    (request,) = server.requests
    assert request["temperature"] == 0 and request["model"] == "m"
    assert request["response_format"]["json_schema"]["strict"] is True
    (exchange,) = read_exchanges(path)
    assert (exchange.reply, exchange.error, exchange.model) == (GOOD, "", "m")
    assert exchange.messages == request["messages"]
    assert KEY not in path.read_text(encoding="utf-8")
    assert ReplayModel(path).answer(exchange.messages, {}).text == GOOD


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("I would open it.", "not valid JSON"),
        (UNKNOWN, "'fridge'; expected one of"),
        (UNORDERED, "release mug: the hand holds nothing"),
        ("[]", 'expected an object with the fields "plan" and "refusal"'),
        (None, "reply: it has no text"),
    ],
    ids=["prose", "unknown object", "impossible order", "other schema", "nothing"],
)
def test_a_mistake_is_told_and_mended(serve, tmp_path, wrong, words):
    server = serve(says(wrong), says(GOOD))
    ask, path = asked(server, tmp_path)
    assert len(ask()) == 3
    *_, sent_back, told = server.requests[1]["messages"]
    assert words in told["content"] and sent_back["content"]
    assert len(read_exchanges(path)) == 2


def test_repairs_are_bounded(serve, tmp_path):
    server = serve(*[says(UNORDERED)] * (1 + MAX_REPAIRS))
    ask, _ = asked(server, tmp_path)
    with pytest.raises(
        InputError, match="still wrong after 2 repairs: plan.0.: release mug"
    ) as caught:
        ask()
    assert "\n" not in str(caught.value)
    begin = " ".join(UNORDERED.split())[:40]
    assert f"its last answer begins with '{begin}" in str(caught.value)


@pytest.mark.parametrize(
    ("behaviours", "words"),
    [
        (
            [says(json.dumps({"plan": [], "refusal": "I see no drawer"}))],
            "declines: I see no drawer",
        ),
        ([says(None, refusal="I cannot help with that")], "declined: I cannot help with that"),
        ([status(401)], "status 401"),
        ([status(500), status(500)], "status 500"),
        ([breaks_off, breaks_off], "cannot be reached, or broke off"),
        ([lambda handler: send(handler, 200, '{"choices": []}')], "without a choice"),
    ],
    ids=["declines", "its own refusal", "key", "server error", "disconnect", "empty"],
)
def test_what_gives_no_plan_is_one_line(serve, tmp_path, behaviours, words):
    ask, path = asked(serve(*behaviours), tmp_path)
    with pytest.raises(InputError, match=words) as caught:
        ask()
    text = str(caught.value) + path.read_text(encoding="utf-8")
    assert "\n" not in str(caught.value) and KEY not in text


def test_no_answer_in_time_is_one_line(serve, tmp_path):
    ask, _ = asked(serve(hangs), tmp_path, timeout=0.3, retries=0)
    with pytest.raises(InputError, match="no answer in time"):
        ask()


def test_too_many_requests_are_asked_again(serve, tmp_path):
    server = serve(status(429, Retry_After="0.1"), says(GOOD))
    ask, _ = asked(server, tmp_path, retries=2)
    assert len(ask()) == 3 and len(server.requests) == 2


def test_the_default_endpoint_needs_a_key(monkeypatch):
    monkeypatch.delenv(KEY_VARIABLE, raising=False)
    with pytest.raises(InputError, match=f"set {KEY_VARIABLE}, or give --base-url"):
        EndpointModel("m")


def fields_refused(name: str):
    """Answers as a server of FastAPI that does not take a field."""
    detail = [{"loc": ["body", name], "msg": "Extra inputs are not permitted"}]
    return lambda handler: send(handler, 422, json.dumps({"detail": detail}))


@pytest.mark.parametrize(
    ("refusals", "left"),
    [
        ([refuses("temperature")], {"seed": 0, "response_format": "json_schema"}),
        ([refuses("seed")], {"temperature": 0.0, "response_format": "json_schema"}),
        ([fields_refused("seed")], {"temperature": 0.0, "response_format": "json_schema"}),
        ([refuses("response_format")], {"temperature": 0.0, "seed": 0, "response_format": "json_object"}),
        (
            [refuses("", "This response_format type is unavailable now"), refuses("response_format"), refuses("seed")],
            {"temperature": 0.0},
        ),
    ],
    ids=["temperature", "seed", "field", "schema", "one after the other"],
)  # fmt: skip
def test_what_an_endpoint_does_not_take_is_left_out(serve, tmp_path, refusals, left):
    server = serve(*refusals, says(GOOD), says(GOOD))
    ask, path = asked(server, tmp_path)
    assert len(ask()) == 3 and len(ask()) == 3
    assert len(server.requests) == len(refusals) + 2  # later questions do without it at once
    last = server.requests[-1]
    assert ("temperature" in last, "seed" in last) == ("temperature" in left, "seed" in left)
    assert last.get("response_format", {}).get("type") == left.get("response_format")
    assert [each.parameters for each in read_exchanges(path)][-1] == left


def test_a_refusal_of_something_else_is_told_with_its_reason(serve, tmp_path):
    ask, _ = asked(serve(refuses("model", f"no model m for key {KEY}")), tmp_path)
    with pytest.raises(InputError, match=r"status 400: .*no model m for key \*\*\*"):
        ask()


def test_a_question_that_is_too_long_leaves_nothing_out(serve, tmp_path):
    long = (
        "This model's maximum context length is 4096 tokens; lower seed, temperature or the schema"
    )
    server = serve(refuses("messages", long), says(GOOD))
    ask, _ = asked(server, tmp_path)
    with pytest.raises(InputError, match="status 400: This model's maximum context length"):
        ask()
    assert len(ask()) == 3 and {"seed", "temperature"} <= server.requests[-1].keys()


def raw(body: str, kind: str = "application/json"):
    return lambda handler: send(handler, 200, body)


@pytest.mark.parametrize(
    "body",
    [
        "",
        '{"choices": [',
        '{"choices": {}}',
        '{"choices": [null]}',
        '{"choices": [{"message": null}]}',
        '{"choices": [{"text": "legacy"}]}',
        '{"error": {"message": "overloaded"}}',
        "[" * 100_000,
    ],
    ids=lambda body: body[:30] or "empty",
)
def test_an_answer_that_is_none_is_one_line_and_on_record(serve, tmp_path, body):
    ask, path = asked(serve(*[raw(body)] * (1 + MAX_REPAIRS)), tmp_path)
    with pytest.raises(InputError, match="the language model") as caught:
        ask()
    assert "\n" not in str(caught.value)
    assert read_exchanges(path)


def test_an_answer_in_parts_is_joined_and_holds_no_key(serve, tmp_path):
    half = len(GOOD) // 2
    parts = [{"type": "text", "text": text} for text in (GOOD[:half], GOOD[half:])]
    ask, _ = asked(serve(says(parts)), tmp_path)
    assert len(ask()) == 3
    declines = json.dumps({"plan": [], "refusal": f"bad key {KEY} \ud83d"})
    ask, path = asked(serve(says(declines)), tmp_path / "other")
    with pytest.raises(InputError, match=r"declines: bad key \*\*\* \?") as caught:
        ask()
    str(caught.value).encode("utf-8")
    assert KEY not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "address", ["localhost:8000/v1", "http://localhost:abc/v1", "http://[::1/v1", "ftp://h/v1", ""]
)
def test_an_address_that_is_none_is_told_at_once(address):
    with pytest.raises(InputError, match="expected an address such as http://localhost:8000/v1"):
        EndpointModel("m", address)


@pytest.mark.parametrize("key", ["sk-schl\u00fcssel", "sk\x07bell"])
def test_a_key_that_is_none_is_told_at_once(monkeypatch, key):
    monkeypatch.setenv(KEY_VARIABLE, key)
    with pytest.raises(InputError, match=f"{KEY_VARIABLE}: holds characters"):
        EndpointModel("m", "http://localhost:1/v1")


def test_a_keys_spaces_do_not_count(serve, tmp_path, monkeypatch):
    server = serve(says(GOOD))
    monkeypatch.setenv(KEY_VARIABLE, f" {KEY}\n")
    ask, _ = asked(server, tmp_path)
    assert len(ask()) == 3


def test_a_server_that_drips_is_not_waited_for(serve, tmp_path):
    def drips(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(200)
        handler.end_headers()
        for _ in range(30):
            handler.wfile.write(b" ")
            handler.wfile.flush()
            time.sleep(0.1)

    ask, path = asked(serve(drips), tmp_path, timeout=0.4, retries=0)
    started = time.monotonic()
    with pytest.raises(InputError, match="no answer in time"):
        ask()
    assert time.monotonic() - started < 1.5
    assert read_exchanges(path)[0].error == "no answer in time"


def test_an_answer_that_was_cut_is_asked_for_shorter(serve, tmp_path):
    choice = {"finish_reason": "length", "message": {"content": GOOD[:40]}}
    server = serve(raw(json.dumps({"choices": [choice]})), says(GOOD))
    ask, path = asked(server, tmp_path)
    assert len(ask()) == 3
    assert "it was cut off" in server.requests[1]["messages"][-1]["content"]
    again = LanguagePlanner(ReplayModel(path), "Open the top drawer.")
    estimate = kitchen()
    places = named_destinations((), estimate)
    messages = again.question(scene_text(estimate, places))
    assert len(again.steps(messages, {}, estimate, places)) == 3


@pytest.mark.parametrize(
    "choice",
    [{"text": GOOD}, {"message": {"content": json.loads(GOOD)}}, {"message": {"content": [GOOD]}}],
    ids=["text beside it", "an object", "parts"],
)
def test_a_plan_is_found_in_answers_of_other_forms(serve, tmp_path, choice):
    ask, _ = asked(serve(raw(json.dumps({"choices": [choice]}))), tmp_path)
    assert len(ask()) == 3


def test_an_error_that_came_as_an_answer_is_told(serve, tmp_path):
    ask, _ = asked(serve(raw('{"error": {"message": "overloaded"}}')), tmp_path)
    with pytest.raises(InputError, match="an answer without a choice: overloaded"):
        ask()


def test_every_exchange_is_on_record_even_if_the_model_breaks(tmp_path):
    class Broken:
        name, parameters = "m", {}

        def begin(self, task, episode) -> None: ...

        def answer(self, messages, schema):
            raise RuntimeError("broken")

    planner = LanguagePlanner(Broken(), "Open the top drawer.", tmp_path / "1.jsonl")
    with pytest.raises(RuntimeError, match="broken"):
        planner.steps(planner.question("scene"), {}, kitchen(), {})
    assert read_exchanges(tmp_path)[0].error == "the question was broken off"


def test_an_exchange_that_cannot_be_written_is_no_failure_of_the_model(serve, tmp_path):
    (tmp_path / "file").touch()
    ask, _ = asked(serve(says(GOOD)), tmp_path / "file")
    with pytest.raises(RecordError, match="exchanges cannot be written there"):
        ask()


def test_the_address_may_come_from_the_client_s_variable(serve, tmp_path, monkeypatch):
    server = serve(says(GOOD))
    monkeypatch.delenv(KEY_VARIABLE)
    monkeypatch.setenv(URL_VARIABLE, server.url)
    assert EndpointModel("m").answer([], {}).text == GOOD
    monkeypatch.setenv(URL_VARIABLE, "localhost:8000")
    with pytest.raises(InputError, match=f"{URL_VARIABLE} 'localhost:8000': expected an address"):
        EndpointModel("m")


def test_a_query_of_an_address_is_sent_behind_what_is_asked_for(serve):
    paths = []

    def remembers(handler: BaseHTTPRequestHandler) -> None:
        paths.append(handler.path)
        says(GOOD)(handler)

    server = serve(remembers)
    EndpointModel("m", f"{server.url}?api-version=3").answer([], {})
    assert paths == ["/v1/chat/completions?api-version=3"]
