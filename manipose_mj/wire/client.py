"""The client's end of a method's websocket: metadata first, then one answer to each question."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from websockets.exceptions import InvalidHandshake, InvalidURI, WebSocketException
from websockets.sync.client import ClientConnection, connect

from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.wire.framing import pack, unpack

SCHEMES = ("ws://", "wss://")
OPEN_S, ANSWER_S = 10.0, 600.0


class RemoteFailureError(RuntimeError):
    """The method failed on a question and said so; its server may have hung up."""


def is_address(reference: str) -> bool:
    """Whether a reference names a server rather than a Python object."""
    return reference.startswith(SCHEMES)


class Client:
    """One connection, held until it is closed.

    Attributes:
      address: Such as `ws://localhost:8000`.
      metadata: What the server said first.
    """

    def __init__(self, address: str, *, open_s: float = OPEN_S, answer_s: float = ANSWER_S) -> None:
        """Connects, and waits for the metadata.

        Args:
          address: Of the server.
          open_s: How long to wait for a connection and for the metadata [s].
          answer_s: How long to wait for an answer [s].

        Raises:
          InputError: Nobody answers there, or not with a dictionary.
        """
        self.address, self._answer_s = address, answer_s
        self._stack = ExitStack()
        try:
            # No pings: a method may be busy for longer than they wait.
            opening = connect(
                address, compression=None, max_size=None, open_timeout=open_s, ping_interval=None
            )
            self._socket: ClientConnection = self._stack.enter_context(opening)
        except (OSError, InvalidURI, InvalidHandshake) as error:
            raise InputError(f"{address}: no server answers ({_line(error)})") from None
        try:
            self.metadata = self._received(open_s)
        except (ServerLostError, RemoteFailureError) as error:
            self.close()
            raise InputError(str(error)) from None

    def ask(self, question: Mapping[str, Any]) -> dict[str, Any]:
        """The server's answer.

        Raises:
          ServerLostError: The connection broke, or what came is no answer.
          RemoteFailureError: The server reports an error of its own, by text.
        """
        try:
            self._socket.send(pack(question))
        except (OSError, WebSocketException) as error:
            raise ServerLostError(f"{self.address}: connection lost ({_line(error)})") from None
        return self._received(self._answer_s)

    def close(self) -> None:
        """Ends the connection."""
        self._stack.close()

    def _received(self, seconds: float) -> dict[str, Any]:
        try:
            content = self._socket.recv(timeout=seconds)
        except TimeoutError:
            raise ServerLostError(f"{self.address}: no answer within {seconds:g} s") from None
        except (OSError, WebSocketException) as error:
            raise ServerLostError(f"{self.address}: connection lost ({_line(error)})") from None
        if isinstance(content, str):  # how openpi's servers report an exception
            last = (content.strip().splitlines() or ["nothing"])[-1]
            raise RemoteFailureError(f"{self.address}: the server failed: {last[:300]}")
        try:
            message = unpack(content)
        except ValueError as error:
            raise ServerLostError(f"{self.address}: {error}") from None
        if not isinstance(message, dict):
            raise ServerLostError(
                f"{self.address}: answered a {type(message).__name__}; expected a dictionary"
            )
        return message


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
