"""The client's end of a method's websocket: metadata first, then one answer to each question."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from manipose_mj.errors import InputError, ServerAbsentError, ServerLostError
from manipose_mj.wire.address import shown
from manipose_mj.wire.framing import pack, unpack

SCHEMES = ("ws://", "wss://")
_OPEN_S = 10.0
# The first answer of a server may wait minutes for a compiler.
_ANSWER_S = 900.0


# How Python begins the last part of a traceback.
_ERROR = re.compile(r"[A-Za-z_][\w.]*(Error|Exception|Exit|Interrupt|Failure): ")


class RemoteFailureError(RuntimeError):
    """The method failed on a question; its server may have hung up. The message is one line.

    Attributes:
      text: What the server sent instead of an answer; empty where it sent bytes that are no message.
    """

    def __init__(self, message: str, text: str = "") -> None:
        super().__init__(message)
        self.text = text


def is_address(reference: str) -> bool:
    """Whether a reference names a server rather than a Python object.

    Raises:
      InputError: It is an address of another scheme.
    """
    if "://" in reference and not reference.startswith(SCHEMES):
        raise InputError(
            f"{shown(reference)}: servers of methods have addresses with {' or '.join(SCHEMES)}, such as ws://localhost:8000"
        )
    return reference.startswith(SCHEMES)


class Client:
    """Talks to one server; connects when it is first asked, and again after it was closed.

    Attributes:
      address: Such as `ws://localhost:8000`.
      kind: Of server, for messages.
      metadata: What the server said of itself; empty before the first connection.
    """

    def __init__(self, address: str, kind: str = "server", *, answer_s: float = _ANSWER_S) -> None:
        """Does not connect yet.

        Args:
          address: Of the server.
          kind: Such as `"policy server"`.
          answer_s: How long to wait for an answer [s].
        """
        self.address, self.kind, self._answer_s = address, kind, answer_s
        self.metadata: dict[str, Any] = {}
        self._connection: ClientConnection | None = None
        self._stack = ExitStack()
        self._reached = False

    def open(self) -> None:
        """Connect and read the metadata; nothing where that was done already.

        Raises:
          ServerAbsentError: Nobody answers, or not with a dictionary.
          ServerLostError: Somebody did before.
        """
        self._opened()

    def ask(self, question: Mapping[str, Any]) -> Any:
        """The server's answer.

        Raises:
          ServerAbsentError: Nobody answers, or not with a dictionary.
          ServerLostError: The connection broke, or nothing came in time.
          RemoteFailureError: The server reports an error by text, or what came is no message. Close after it:
            most servers hang up.
        """
        connection = self._opened()
        try:
            connection.send(pack(question))
            answer = connection.recv(timeout=self._answer_s)
        except TimeoutError:
            raise self._gone(f"no answer within {self._answer_s:g} s") from None
        except (OSError, EOFError, WebSocketException) as error:
            raise self._gone(f"connection lost: {_reason(error)}") from None
        if isinstance(answer, str):  # how openpi's servers report an exception
            raise RemoteFailureError(f"the server failed: {_last_error(answer)[:200]}", answer)
        try:
            return unpack(answer)
        except ValueError as error:
            raise RemoteFailureError(f"the server's answer is {error}") from None

    def close(self) -> None:
        """Hang up; the next question connects again."""
        self._connection = None
        self._stack.close()

    def _opened(self) -> ClientConnection:
        if self._connection is not None:
            return self._connection
        try:
            # No pings: a method may be busy for longer than they wait.
            opening = connect(
                self.address,
                compression=None,
                max_size=None,
                open_timeout=_OPEN_S,
                ping_interval=None,
            )
            connection = self._stack.enter_context(opening)
            first = connection.recv(timeout=_OPEN_S)
            metadata = unpack(first) if isinstance(first, bytes) else None
        except (OSError, EOFError, ValueError, WebSocketException) as error:
            raise self._gone(_reason(error)) from None
        if not isinstance(metadata, dict):
            raise self._gone("its first message is no dictionary of metadata")
        self.metadata = {_text(name): value for name, value in metadata.items()}
        self._connection, self._reached = connection, True
        return connection

    def _gone(self, reason: str) -> Exception:
        """The error of a server that is not there, or not any more."""
        self.close()
        where = shown(self.address)
        reason = reason.replace(self.address, where)
        if self._reached:
            return ServerLostError(f"{where}: the {self.kind} answers no more ({reason})")
        return ServerAbsentError(f"{where}: no {self.kind} answers there ({reason})")


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


def _text(name: Any) -> str:
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)


def _last_error(text: str) -> str:
    """What a traceback ends with, from the type of the error on, in one line; the last line of other texts."""
    lines = text.strip().splitlines() or ["no reason given"]
    named = [row for row, line in enumerate(lines) if _ERROR.match(line)]
    return " ".join(" ".join(lines[named[-1] if named else -1 :]).split())
