"""Serves a policy over a websocket, for evaluators of this package and openpi's clients."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable, Mapping
from http import HTTPStatus
from threading import Lock
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection
from websockets.sync.server import serve as open_server

from manipose_mj.policies.client import RESET
from manipose_mj.policies.protocol import ActionSpace, Policy
from manipose_mj.wire.framing import pack, unpack

logger = logging.getLogger(__name__)
_TOLD = ("task", "instruction", "seed", "action_space")


class PolicyServer:
    """Listens from the start; answers one request at a time, for as many clients as come."""

    def __init__(
        self,
        policy: Policy | Callable[[], Policy],
        host: str = "localhost",
        port: int = 0,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        """Binds the port.

        Args:
          policy: To serve all clients. A policy that remembers its episode can play one at a time: for several
            processes that evaluate give a class or function that makes one, called for each client.
          host: Interface to listen at.
          port: 0: a free one.
          metadata: To send first, such as the name of a model.

        Raises:
          OSError: The port is taken.
        """
        shared = None if isinstance(policy, type) or not isinstance(policy, Policy) else policy
        self._make: Any = policy if shared is None else lambda: shared
        self._metadata = {**(metadata or {}), RESET: True}
        self._one_at_a_time = Lock()
        self._server = open_server(
            self._converse,
            host,
            port,
            compression=None,
            max_size=None,
            ping_interval=None,
            process_request=_health,
        )
        self.address = f"ws://{host}:{self._server.socket.getsockname()[1]}"

    def run(self) -> None:
        """Serve until `close` is called from another thread."""
        self._server.serve_forever()

    def close(self) -> None:
        """Stop listening."""
        self._server.shutdown()

    def _converse(self, connection: ServerConnection) -> None:
        connection.send(pack(self._metadata))
        policy: Policy | None = None
        try:
            for message in connection:
                try:
                    with self._one_at_a_time:
                        policy = self._make() if policy is None else policy
                        answer = pack(_answered(policy, unpack(message)))  # type: ignore[arg-type]
                except Exception:
                    logger.exception("the policy raised")
                    connection.send(traceback.format_exc())
                    connection.close(1011, "the policy raised; its traceback is the last message")
                    return
                connection.send(answer)
        except ConnectionClosed:
            return


def _answered(policy: Policy, message: dict[str, Any]) -> dict[str, Any]:
    endpoint = message.pop("endpoint", "infer")
    if endpoint == "infer":
        answer = policy.infer(message)
        answer = dict(answer) if isinstance(answer, Mapping) else {"actions": answer}
        # Of whichever library they are.
        return {k: np.asarray(v) if k in ("action", "actions") else v for k, v in answer.items()}
    if endpoint != "reset":
        raise ValueError(f"unknown endpoint {endpoint!r}; expected 'infer' or 'reset'")
    lacking = [name for name in _TOLD if name not in message]
    if lacking:
        raise ValueError(f"a reset without {', '.join(lacking)}; expected {', '.join(_TOLD)}")
    space = message["action_space"]
    policy.reset(
        task=message["task"],
        instruction=message["instruction"],
        seed=message["seed"],
        action_space=ActionSpace(
            np.asarray(space["low"], float),
            np.asarray(space["high"], float),
            space["control_mode"],
            space["hz"],
        ),
    )
    return {}


def serve(policy: Policy | Callable[[], Policy], host: str = "localhost", port: int = 8000) -> None:
    """Serve a policy until the process ends; arguments as of `PolicyServer`."""
    server = PolicyServer(policy, host, port)
    logger.info("serving at %s", server.address)
    server.run()


def _health(connection: ServerConnection, request: Request) -> Response | None:
    """`GET /healthz` is answered without a websocket, as openpi's servers do."""
    return connection.respond(HTTPStatus.OK, "OK\n") if request.path == "/healthz" else None
