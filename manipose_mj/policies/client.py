"""A policy behind a websocket: a server of openpi's, of RoboArena's, or one that knows our `reset`.

All three send a dictionary of metadata first and answer packed observations with packed actions.

- Plain openpi servers know nothing of episodes: nothing is sent at a reset.
- RoboArena's announce what they need (`needs_session_id` and others). Every message then has an `endpoint`, `infer` or
  `reset`, and a reset is answered by text. They count DROID's exterior cameras from 0, and may want a session's number.
- Ours announce `manipose_reset`. Messages have an `endpoint` too; that of a reset holds task, instruction, seed
  and action space, and is answered by an empty dictionary.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any, Literal

import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidURI, WebSocketException
from websockets.sync.client import ClientConnection, connect

from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.failures import StageFailure
from manipose_mj.policies.protocol import ActionSpace
from manipose_mj.wire.framing import pack, unpack

RESET = "manipose_reset"
Dialect = Literal["openpi", "roboarena", "manipose"]
_EXTERIOR = "exterior_image_1", "exterior_image_0"
_OPEN_S = 10.0
# The first inference of a server may compile for minutes.
_ANSWER_S = 900.0


class RemotePolicy:
    """Talks to one server; connects when it is first asked, and again in the episode after an error.

    Attributes:
      address: Such as `"ws://localhost:8000"`.
      metadata: What the server said of itself; empty before the first connection.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.metadata: dict[str, Any] = {}
        self._connection: ClientConnection | None = None
        self._stack = ExitStack()
        self._reached = False
        self._session = np.zeros(1, np.int32)

    @property
    def dialect(self) -> Dialect:
        """Whose protocol the server speaks, by its metadata."""
        if self.metadata.get(RESET):
            return "manipose"
        return "roboarena" if "needs_session_id" in self.metadata else "openpi"

    def open(self) -> None:
        """Connect and read the metadata; nothing where that was done already.

        Raises:
          InputError: Nobody answers, or not as a policy server.
          ServerLostError: Nobody answers any more.
        """
        if self._connection is not None:
            return
        try:
            # The server may be busy longer than a keep-alive would wait.
            self._connection = self._stack.enter_context(
                connect(
                    self.address,
                    open_timeout=_OPEN_S,
                    ping_interval=None,
                    compression=None,
                    max_size=None,
                )
            )
            first = self._connection.recv(timeout=_OPEN_S)
            metadata = unpack(first) if isinstance(first, bytes) else None
        except (OSError, WebSocketException, InvalidURI, ValueError, EOFError) as error:
            self.close()
            raise self._unreachable(str(error) or type(error).__name__) from None
        if not isinstance(metadata, dict):
            self.close()
            raise self._unreachable("its first message is no dictionary of metadata")
        self.metadata = {_text(name): value for name, value in metadata.items()}
        self._reached = True

    def _unreachable(self, reason: str) -> Exception:
        reason = " ".join(reason.split())
        if self._reached:
            return ServerLostError(
                f"{self.address}: the policy server answers no more ({reason}); finished episodes are kept: start "
                "it again and repeat with --resume"
            )
        return InputError(f"{self.address}: no policy server answers there ({reason})")

    def reset(self, *, task: str, instruction: str, seed: int, action_space: ActionSpace) -> None:
        """Tell the server of an episode, if it wants to know."""
        self.open()
        self._session = np.array([seed % 2**31], np.int32)
        if self.dialect == "openpi":
            return
        message = {
            "endpoint": "reset",
            "task": task,
            "instruction": instruction,
            "prompt": instruction,
            "seed": seed,
        }
        if self.dialect == "manipose":
            message["action_space"] = {
                "low": action_space.low,
                "high": action_space.high,
                "control_mode": action_space.control_mode,
                "hz": action_space.hz,
            }
        answer = self._asked(message)
        if isinstance(answer, str) and (self.dialect == "manipose" or "Traceback" in answer):
            self._refuse(answer)

    def infer(self, obs: Mapping[str, Any]) -> Any:
        """The server's answer.

        Raises:
          StageFailure: Of the stage `policy`: the server answered with an error.
          ServerLostError: The connection broke.
        """
        message = dict(obs)
        if self.dialect == "roboarena":
            message = {name.replace(*_EXTERIOR): value for name, value in obs.items()}
            if self.metadata["needs_session_id"]:
                message["session_id"] = self._session
        if self.dialect != "openpi":
            message["endpoint"] = "infer"
        answer = self._asked(message)
        if isinstance(answer, str):
            self._refuse(answer)
        return answer

    def close(self) -> None:
        """Hang up; the next episode connects again."""
        self._connection = None
        self._stack.close()

    def _asked(self, message: dict[str, Any]) -> Any:
        assert self._connection is not None, "reset comes first"
        try:
            self._connection.send(pack(message))
            answer = self._connection.recv(timeout=_ANSWER_S)
        except (ConnectionClosed, OSError, EOFError) as error:
            self.close()
            raise self._unreachable(str(error) or type(error).__name__) from None
        if isinstance(answer, str):
            return answer
        try:
            return unpack(answer)
        except ValueError as error:
            raise StageFailure("policy", f"the server's answer is {error}") from None

    def _refuse(self, text: str) -> None:
        """Raises the StageFailure of an error, after which servers hang up."""
        self.close()
        last = text.strip().splitlines()[-1:] or ["no reason given"]
        raise StageFailure("policy", f"the server answered with an error: {last[0][:200]}")

    def __reduce__(self) -> tuple[Any, ...]:
        return RemotePolicy, (self.address,)


def _text(name: Any) -> str:
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)
