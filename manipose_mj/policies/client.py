"""A policy behind a websocket: a server of openpi's, of RoboArena's, or one that knows our `reset`.

All three send a dictionary of metadata first and answer packed observations with packed actions.

- Plain openpi servers know nothing of episodes: nothing is sent at a reset.
- RoboArena's announce what they need (`needs_session_id` and others). Every message then has an `endpoint`, `infer` or
  `reset`, and a reset is answered by text. They count DROID's exterior cameras from 0, and may want a session's number.
- Ours announce `manipose_reset`. Messages have an `endpoint` too; that of a reset holds task, instruction, seed
  and action space, and is answered by an empty dictionary.
"""

from __future__ import annotations

import atexit
from collections.abc import Mapping
from typing import Any, Literal, NoReturn

import numpy as np

from manipose_mj.failures import StageFailure
from manipose_mj.policies.protocol import ActionSpace
from manipose_mj.wire.client import Client, RemoteFailureError

RESET = "manipose_reset"
Dialect = Literal["openpi", "roboarena", "manipose"]
_EXTERIOR = "exterior_image_1", "exterior_image_0"


class RemotePolicy:
    """Talks to one server; connects when it is first asked, and again in the episode after an error.

    Attributes:
      address: Such as `"ws://localhost:8000"`.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self._client = Client(address, "policy server")
        atexit.register(self.close)
        self._session = np.zeros(1, np.int32)

    @property
    def metadata(self) -> dict[str, Any]:
        """What the server said of itself; empty before the first connection."""
        return self._client.metadata

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
        self._client.open()

    def reset(self, *, task: str, instruction: str, seed: int, action_space: ActionSpace) -> None:
        """Tell the server of an episode, if it wants to know.

        Raises:
          StageFailure: Of the stage `policy`: the server answered with an error.
          ServerLostError: The connection broke.
        """
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
        try:
            self._client.ask(message)
        except RemoteFailureError as error:
            # RoboArena's servers say by text that all went well.
            if self.dialect == "manipose" or "Traceback" in error.text:
                self._refuse(error)

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
        try:
            return self._client.ask(message)
        except RemoteFailureError as error:
            self._refuse(error)

    def close(self) -> None:
        """Hang up; the next episode connects again."""
        self._client.close()

    def _refuse(self, error: RemoteFailureError) -> NoReturn:
        """Fail the episode; servers hang up after an error."""
        self.close()
        raise StageFailure("policy", str(error)) from error

    def __reduce__(self) -> tuple[Any, ...]:
        return RemotePolicy, (self.address,)
