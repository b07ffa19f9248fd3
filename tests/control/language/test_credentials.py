"""No part of a credential is in what is told of an endpoint's answers, or on record."""

from __future__ import annotations

import json
from base64 import b64decode
from http.server import BaseHTTPRequestHandler

import pytest

from manipose_mj.control.language.endpoint import KEY_VARIABLE, EndpointModel
from manipose_mj.control.language.exchanges import NoReplyError
from manipose_mj.errors import InputError
from tests.control.language.local_server import GOOD, KEY, asked, refuses, says, send


def test_reasons_are_short_and_hold_no_part_of_a_key(serve, tmp_path):
    said = "x" * 150 + f" {KEY} " + "y" * 300_000
    ask, path = asked(serve(refuses("model", said), says(None, refusal=said)), tmp_path)
    for _ in range(2):
        with pytest.raises(InputError) as caught:
            ask()
        assert len(str(caught.value)) < 300
    assert KEY[:10] not in path.read_text(encoding="utf-8")


def echoes(handler: BaseHTTPRequestHandler) -> None:
    """Refuses, and says with which credentials it was asked."""
    scheme, _, sent = handler.headers["Authorization"].partition(" ")
    decoded = b64decode(sent).decode() if scheme == "Basic" else sent
    said = f"path {handler.path} sent {scheme} {sent} alone {sent} decoded {decoded}"
    send(handler, 401, json.dumps({"error": {"message": said}}))


@pytest.mark.parametrize(
    ("key", "user", "query", "secrets"),
    [
        ("", "alice:hunter2@", "", ["alice", "hunter2", "YWxpY2U6"]),
        ("", "alice:p%40ssw0rd!longer@", "", ["alice", "ssw0rd", "longer", "YWxpY2U6"]),
        ("", "token@", "", ["token", "dG9rZW"]),
        ("", "", "?api-key=abc1234", ["abc1234"]),
        ("", "", "?api-key=abc12345%2067!8", ["abc12345", "67"]),
        ("sk-1234", "", "", ["sk-1234"]),
        ("sk", "", "", ["sk"]),
    ],
    ids=["password", "escaped password", "user", "query", "escaped query", "short", "shortest"],
)
def test_credentials_that_are_sent_back_are_not_told(serve, monkeypatch, key, user, query, secrets):
    server = serve(echoes)
    monkeypatch.setenv(KEY_VARIABLE, key)
    address = server.url.replace("http://", f"http://{user}") + query
    with pytest.raises(NoReplyError, match=r"status 401: path /v1/chat/completions") as caught:
        EndpointModel("m", address, retries=0).answer([], {})
    assert "***" in str(caught.value)
    assert not [secret for secret in secrets if secret in str(caught.value)]


@pytest.mark.parametrize(
    "said",
    [
        f"incorrect key: {KEY[:12]}",
        f"incorrect key: {KEY[-12:]}",
        f"incorrect key: {KEY[:5]}*****{KEY[-4:]}",
        f"incorrect key: {KEY[:4]}...{KEY[-4:]}",
        "incorrect key: Bearer of-another",
    ],
    ids=["start", "end", "masked", "shortened", "header"],
)
def test_parts_of_a_key_are_not_told(serve, said):
    server = serve(refuses("model", said), says(said))
    model = EndpointModel("m", server.url, retries=0)
    with pytest.raises(NoReplyError, match=r"incorrect key: (Bearer )?\*\*\*$"):
        model.answer([], {})
    reply = model.answer([], {}).text
    assert KEY[:8] not in reply and KEY[-8:] not in reply


def test_a_short_word_in_place_of_a_key_does_not_spoil_plans(serve, tmp_path, monkeypatch):
    server = serve(says(GOOD))
    monkeypatch.setenv(KEY_VARIABLE, "top")
    ask, _ = asked(server, tmp_path)
    assert len(ask()) == 3
