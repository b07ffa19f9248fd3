"""The endpoint of a language model: every way to answer ends in a plan or in one clear line, and no key is on record."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler

import pytest

from manipose_mj.control.language.description import scene_text
from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.endpoint import KEY_VARIABLE, EndpointModel
from manipose_mj.control.language.exchanges import ReplayModel, read_exchanges
from manipose_mj.control.language.planner import MAX_REPAIRS, LanguagePlanner
from manipose_mj.control.language.reply import reply_schema
from manipose_mj.errors import InputError
from tests.control.language.local_server import Server, says, send, status
from tests.control.language.scenes import kitchen

KEY = "sk-secret-of-this-test"
GOOD = json.dumps(
    {
        "plan": [
            {"primitive": "grasp_at", "subject": "top_drawer"},
            {"primitive": "move_to", "subject": "top_drawer", "opening": 0.19},
            {"primitive": "release", "subject": "top_drawer"},
        ],
        "refusal": "",
    }
)
UNKNOWN = GOOD.replace("top_drawer", "fridge")
UNORDERED = json.dumps({"plan": [{"primitive": "release", "subject": "mug"}], "refusal": ""})


def hangs(handler: BaseHTTPRequestHandler) -> None:
    time.sleep(1.5)


def breaks_off(handler: BaseHTTPRequestHandler) -> None:
    handler.connection.close()


@pytest.fixture
def serve(monkeypatch) -> Iterator:
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    servers = []

    def start(*behaviours) -> Server:
        servers.append(Server(list(behaviours)))
        return servers[-1]

    yield start
    for server in servers:
        server.close()


def asked(server: Server, tmp_path, *, timeout: float = 20.0, retries: int = 1):
    """What comes of an instruction, and the file of exchanges."""
    estimate, path = kitchen(), tmp_path / "exchanges.jsonl"
    model = EndpointModel("m", server.url, timeout=timeout, retries=retries)
    planner = LanguagePlanner(model, "Open the top drawer.", path)
    destinations = named_destinations((), estimate)
    messages = planner.question(scene_text(estimate, destinations))
    schema = reply_schema(estimate, destinations)
    return lambda: planner.steps(messages, schema, estimate, destinations), path


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
    assert ReplayModel(path).answer(exchange.messages, exchange.schema) == GOOD


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("I would open it.", "not valid JSON"),
        (UNKNOWN, "'fridge'; expected one of"),
        (UNORDERED, "release mug: the hand holds nothing"),
        ("[]", 'expected an object with the fields "plan" and "refusal"'),
        (None, "not valid JSON"),
    ],
    ids=["prose", "unknown object", "impossible order", "other schema", "nothing"],
)
def test_a_mistake_is_told_and_mended(serve, tmp_path, wrong, words):
    server = serve(says(wrong), says(GOOD))
    ask, path = asked(server, tmp_path)
    assert len(ask()) == 3
    assert words in server.requests[1]["messages"][-1]["content"]
    assert len(read_exchanges(path)) == 2


def test_repairs_are_bounded(serve, tmp_path):
    server = serve(*[says(UNORDERED)] * (1 + MAX_REPAIRS))
    ask, _ = asked(server, tmp_path)
    with pytest.raises(
        InputError, match="still wrong after 2 repairs: plan.0.: release mug"
    ) as caught:
        ask()
    assert "\n" not in str(caught.value)


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
