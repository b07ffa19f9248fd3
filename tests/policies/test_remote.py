"""Policies over a websocket: our server, openpi's and RoboArena's dialects, errors, lost servers, speed."""

from __future__ import annotations

import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Any

import msgpack
import numpy as np
import pytest
from websockets.sync.client import connect
from websockets.sync.server import serve as websocket_server

from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.failures import StageFailure
from manipose_mj.policies.client import RemotePolicy
from manipose_mj.policies.protocol import ActionSpace
from manipose_mj.policies.server import PolicyServer
from manipose_mj.wire.framing import pack, unpack
from tests.policies.own_policies import Answering, Raising, Reaching

SPACE = ActionSpace(-np.ones(8), np.ones(8), "pd_joint_pos", 10.0)
EPISODE = {"task": "a/b", "instruction": "Do it.", "seed": 3, "action_space": SPACE}
OBSERVATION = {"agent_pos": np.linspace(0, 1, 17, dtype=np.float32), "instruction": "Do it."}


@contextmanager
def served(policy: Any) -> Iterator[PolicyServer]:
    server = PolicyServer(policy, metadata={"model": "a"})
    thread = Thread(target=server.run, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.close()
        thread.join(5)


@contextmanager
def stranger(converse: Callable[[Any], None]) -> Iterator[str]:
    """A server of somebody else's, with a bare msgpack."""
    server = websocket_server(converse, "localhost", 0, compression=None)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"ws://localhost:{server.socket.getsockname()[1]}"
    finally:
        server.shutdown()
        thread.join(5)


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6, dtype=np.uint8).reshape(1, 2, 3),
        np.float32(0.5),
        np.array(True),
        np.zeros((0, 8)),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.array(["a", "bc"]),
    ],
    ids=str,
)
def test_arrays_come_back_as_they_went(array):
    back = unpack(pack({"a": array, "b": [array]}))["a"]
    assert back.dtype == array.dtype and back.shape == array.shape
    np.testing.assert_array_equal(back, array)


def test_an_array_is_tagged_as_openpi_tags_it():
    message = msgpack.unpackb(pack({"a": np.zeros((2, 1), np.float32)}))
    assert message["a"] == {
        b"__ndarray__": True, b"data": bytes(8), b"dtype": "<f4", b"shape": [2, 1],
    }  # fmt: skip
    assert msgpack.unpackb(pack(np.float32(2))) == {
        b"__npgeneric__": True, b"data": 2.0, b"dtype": "<f4",
    }  # fmt: skip


@pytest.mark.parametrize("value", [np.array([{}]), np.array([1j]), object()])
def test_what_cannot_be_sent_is_refused(value):
    with pytest.raises(TypeError, match="cannot be sent"):
        pack({"a": value})


@pytest.mark.parametrize("data", [b"", b"\xc1", pack({"a": np.zeros(2)})[:-3]])
def test_broken_messages_are_refused(data):
    with pytest.raises(ValueError, match="no msgpack message"):
        unpack(data)


def test_a_served_policy_answers_as_one_in_process():
    with served(Reaching()) as server:
        remote, here = RemotePolicy(server.address), Reaching()
        remote.reset(**EPISODE)
        here.reset(**EPISODE)
        assert remote.dialect == "manipose" and remote.metadata["model"] == "a"
        for _ in range(3):
            one, two = remote.infer(OBSERVATION), here.infer(OBSERVATION)
            np.testing.assert_array_equal(one["actions"], two["actions"])
        remote.close()


def test_a_decision_takes_milliseconds_on_the_loopback():
    with served(Answering({"actions": np.zeros((10, 8))})) as server:
        remote = RemotePolicy(server.address)
        remote.reset(**EPISODE)
        pictures = {f"pixels/{n}": np.zeros((224, 224, 3), np.uint8) for n in ("front", "wrist")}
        times = []
        for _ in range(60):
            start = time.perf_counter()
            remote.infer({**OBSERVATION, **pictures})
            times.append(time.perf_counter() - start)
    assert sorted(times)[30] < 0.003


def test_health_is_answered_without_a_websocket():
    with served(Reaching()) as server:
        answer = urllib.request.urlopen(server.address.replace("ws", "http") + "/healthz")
        assert answer.status == 200 and answer.read() == b"OK\n"


def test_an_error_of_the_server_is_a_failure_and_the_next_episode_connects_anew():
    with served(Raising()) as server:
        remote = RemotePolicy(server.address)
        for _ in range(2):
            remote.reset(**EPISODE)
            with pytest.raises(StageFailure, match="KeyError: 'weights'") as caught:
                remote.infer(OBSERVATION)
            assert caught.value.stage == "policy"
            assert "Traceback" in caught.value.__cause__.text


def test_a_server_that_goes_away_is_lost():
    with served(Reaching()) as server:
        remote = RemotePolicy(server.address)
        remote.reset(**EPISODE)
        remote.infer(OBSERVATION)
    with pytest.raises(ServerLostError, match="the policy server answers no more"):
        for _ in range(3):  # what is under way may still be answered
            remote.infer(OBSERVATION)
    with pytest.raises(ServerLostError):
        remote.reset(**EPISODE)


def test_openpi_servers_hear_nothing_of_a_reset():
    heard = []

    def openpi(connection: Any) -> None:
        connection.send(msgpack.packb({}))
        for message in connection:
            heard.append(unpack(message))
            connection.send(pack({"actions": np.zeros((2, 8)), "server_timing": {}}))

    with stranger(openpi) as address:
        remote = RemotePolicy(address)
        remote.reset(**EPISODE)
        assert remote.infer(OBSERVATION)["actions"].shape == (2, 8)
    assert [list(message) for message in heard] == [["agent_pos", "instruction"]]


def test_roboarena_servers_get_an_endpoint_and_answer_a_reset_by_text():
    heard = []

    def roboarena(connection: Any) -> None:
        connection.send(msgpack.packb({"needs_session_id": True, "n_external_cameras": 1}))
        for message in connection:
            heard.append(unpack(message))
            reset = heard[-1]["endpoint"] == "reset"
            connection.send("reset successful" if reset else pack(np.zeros((1, 8))))

    with stranger(roboarena) as address:
        remote = RemotePolicy(address)
        remote.reset(**EPISODE)
        seen = {"observation/exterior_image_1_left": np.zeros((2, 2, 3), np.uint8)}
        assert remote.dialect == "roboarena" and remote.infer(seen).shape == (1, 8)
    assert [message["endpoint"] for message in heard] == ["reset", "infer"]
    assert heard[1]["session_id"].tolist() == [EPISODE["seed"]]
    assert heard[1]["observation/exterior_image_0_left"].shape == (2, 2, 3)


@pytest.mark.parametrize("first", [b"\xc1", msgpack.packb([1]), "hello"])
def test_a_server_of_something_else_is_no_policy_server(first):
    def converse(connection: Any) -> None:
        connection.send(first)

    with stranger(converse) as address, pytest.raises(InputError, match="no policy server"):
        RemotePolicy(address).open()


def test_a_factory_that_fails_and_a_reset_of_other_kinds_are_told_to_the_client():
    def broken():
        raise RuntimeError("no weights")

    with served(broken) as server:
        remote = RemotePolicy(server.address)
        with pytest.raises(StageFailure, match="no weights"):
            remote.reset(**EPISODE)
    with served(Reaching) as server, connect(server.address, compression=None) as connection:
        connection.recv()
        connection.send(pack({"endpoint": "reset", "session_id": "a"}))
        assert "a reset without task, instruction, seed, action_space" in connection.recv()
