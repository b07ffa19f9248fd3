"""Messages survive the wire, openpi's bytes are understood, and a server that is not there is one clear error."""

from __future__ import annotations

import msgpack
import numpy as np
import pytest

from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.wire.client import Client, RemoteFailureError, _last_error, is_address
from manipose_mj.wire.framing import pack, unpack
from tests.wire.answering import answering


def test_messages_come_back_as_they_went():
    message = {
        "cloud": np.arange(12, dtype=np.float32).reshape(4, 3),
        "mask": np.array([[True, False]]),
        "empty": np.zeros((0, 3)),
        "strided": np.arange(10)[::2],
        "score": np.float32(0.5),
        "category": "mug",
        "more": [1, None, {"a": 2.5}],
    }
    back = unpack(pack(message))
    for name in ("cloud", "mask", "empty", "strided"):
        np.testing.assert_array_equal(back[name], message[name])
        assert back[name].dtype == message[name].dtype
    assert back["score"] == np.float32(0.5) and isinstance(back["score"], np.float32)
    assert (back["category"], back["more"]) == ("mug", [1, None, {"a": 2.5}])


def test_bytes_are_those_of_openpi():
    """The dictionary that `openpi_client.msgpack_numpy` writes for an array."""
    array = np.array([[1.0, 2.0]])
    theirs = {b"__ndarray__": True, b"data": array.tobytes(), b"dtype": "<f8", b"shape": (1, 2)}
    assert pack({"actions": array}) == msgpack.packb({"actions": theirs})


@pytest.mark.parametrize("value", [object(), np.array([object()]), np.array([1j])])
def test_what_cannot_be_sent_is_refused(value):
    with pytest.raises(TypeError, match="cannot be sent"):
        pack({"value": value})


@pytest.mark.parametrize("content", [b"", b"\xc1", b"\x81\xa1", b"\x93\x01\x02\x03\x04"])
def test_bytes_that_are_no_message(content):
    with pytest.raises(ValueError, match="no msgpack message"):
        unpack(content)


def test_a_server_answers_each_question():
    with answering(lambda q: {"sum": q["a"].sum()}, metadata={"name": "adder"}) as address:
        client = Client(address)
        assert client.metadata == {}
        client.open()
        assert client.metadata == {"name": "adder"}
        assert [client.ask({"a": np.arange(n)})["sum"] for n in (3, 4)] == [3, 6]
        client.close()
        assert client.ask({"a": np.arange(5)})["sum"] == 10  # connects again
        client.close()


def test_nobody_there_is_an_input_error():
    with answering(lambda q: q) as address:
        pass
    assert is_address(address) and not is_address("pkg.mod:Factory")
    for wrong in (address, "ws://"):
        with pytest.raises(InputError, match=f"{wrong}: no estimator answers there") as caught:
            Client(wrong, "estimator").open()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("metadata", [[1], b"\xc1", "hello"])
def test_a_server_without_metadata_is_of_something_else(metadata):
    serving = answering(lambda q: q, metadata=metadata)
    with serving as address, pytest.raises(InputError, match="no server answers there"):
        Client(address).open()


def test_a_server_that_hangs_up_is_lost():
    with answering(lambda q: {}, after=1) as address:
        client = Client(address)
        client.ask({})
        with pytest.raises(ServerLostError, match="the server answers no more .connection lost"):
            client.ask({})
    with pytest.raises(ServerLostError, match="answers no more"):
        client.open()


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (b"\xc1", "the server's answer is no msgpack message"),
        ("Traceback\nValueError: no category", "the server failed: ValueError: no category"),
        ("", "no reason given"),
    ],
)
def test_an_answer_that_is_none_is_the_methods_failure(said, message):
    with answering(lambda q: said) as address:
        client = Client(address)
        with pytest.raises(RemoteFailureError, match=message) as caught:
            client.ask({})
        assert caught.value.text == (said if isinstance(said, str) else "")
        client.close()


def test_a_server_that_says_nothing_in_time_is_lost():
    from time import sleep

    with answering(lambda q: sleep(0.5) or {}) as address:
        client = Client(address, answer_s=0.05)
        with pytest.raises(ServerLostError, match=r"no answer within 0\.05 s"):
            client.ask({})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Traceback:\n  File x\nRuntimeError: boom\nsecond line", "RuntimeError: boom second line"),
        ("Traceback:\n  a.b.OwnError: inner\nKeyError: 'x'", "KeyError: 'x'"),
        ("it broke\nbadly", "badly"),
        ("", "no reason given"),
    ],
)
def test_of_a_servers_traceback_the_whole_error_is_told(text, said):
    assert _last_error(text) == said
