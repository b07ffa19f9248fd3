"""Which planner makes the baseline's plans, as data that processes can be sent."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from manipose_mj.control.language.address import URL_VARIABLE, check_address
from manipose_mj.errors import InputError
from manipose_mj.wire.address import without_secrets

if TYPE_CHECKING:
    from manipose_mj.control.language.exchanges import ChatModel
    from manipose_mj.control.planning.planner import TaskPlanner

EXCHANGES = "exchanges"  # folder of them in an evaluation's
PlannerKind = Literal["rules", "llm", "replay"]


@dataclass(frozen=True)
class PlannerSettings:
    """A planner.

    Attributes:
      kind: `"rules"`: the symbolic planner; `"llm"`: a language model; `"replay"`: one's recorded answers.
      model: Name of the language model.
      base_url: Of its endpoint; by default that of the variable `OPENAI_BASE_URL`, or OpenAI's.
      replay: File or folder of recorded exchanges.
      instruction: What a language model shall do instead of the task's goals; of a replay, by default what was
        recorded.
      record: Folder for exchanges; a file a process.

    Raises:
      InputError: Something is missing, or does not belong to this kind.
    """

    kind: PlannerKind = "rules"
    model: str | None = None
    base_url: str | None = None
    replay: Path | None = None
    instruction: str | None = None
    record: Path | None = None

    def __post_init__(self) -> None:
        if self.kind == "rules" and self.instruction is not None:
            raise InputError("instruction: the planner by rules reads none; choose --planner llm")
        if (self.kind == "llm") != (self.model is not None):
            raise InputError("model: --planner llm needs one, and no other planner takes one")
        if (self.kind == "replay") != (self.replay is not None):
            raise InputError(
                "replay: --planner replay needs a file, and no other planner takes one"
            )
        if self.kind != "llm" and self.base_url is not None:
            raise InputError("base url: only --planner llm has an endpoint")
        if self.base_url is not None:
            check_address(self.base_url)
        elif self.kind == "llm" and (address := os.environ.get(URL_VARIABLE)):
            # Results of two endpoints are results of two methods, wherever the address stood.
            check_address(address, URL_VARIABLE)
            object.__setattr__(self, "base_url", address)
        for name, text in (("model", self.model), ("instruction", self.instruction)):
            if text is not None and not (text.strip() and _writable(text)):
                raise InputError(f"{name}: {text!r}; expected words")
        if self.replay is not None and not self.replay.exists():
            raise InputError(f"{self.replay}: no such file or folder of recorded exchanges")
        if self.replay is not None and (self.replay / EXCHANGES).is_dir():  # an evaluation's folder
            object.__setattr__(self, "replay", self.replay / EXCHANGES)

    def make(self) -> TaskPlanner:
        """The planner.

        Raises:
          InputError: The endpoint's client or key is missing, or the recorded answers cannot be read.
        """
        # Loads the simulator: workers only.
        from manipose_mj.control.language.planner import LanguagePlanner
        from manipose_mj.control.language.replay import ReplayModel
        from manipose_mj.control.planning.planner import RulePlanner

        model = self.language_model()
        if model is None:
            return RulePlanner()
        record = None if self.record is None else self.record / f"{os.getpid()}.jsonl"
        instruction = self.instruction
        if isinstance(model, ReplayModel) and instruction is None:
            instruction = model.instruction
        return LanguagePlanner(model, instruction, record)

    def language_model(self) -> ChatModel | None:
        """What is asked for plans; None for the planner by rules. It loads no simulator.

        Raises:
          InputError: As of `make`.
        """
        from manipose_mj.control.language.endpoint import EndpointModel
        from manipose_mj.control.language.replay import ReplayModel

        if self.replay is not None:
            return ReplayModel(self.replay)
        return None if self.model is None else EndpointModel(self.model, self.base_url)

    @property
    def identity(self) -> dict[str, Any]:
        """What two runs must share for their results to belong together; JSON, without keys."""
        given: dict[str, Any] = {"kind": self.kind}
        if self.model is not None:
            given["model"] = self.model
        if self.base_url is not None:
            given["base url"] = without_secrets(self.base_url)
        if self.instruction is not None:
            given["instruction"] = self.instruction
        if self.replay is not None:
            files = sorted(self.replay.glob("*.jsonl")) if self.replay.is_dir() else [self.replay]
            text = b"".join(file.read_bytes() for file in files)
            given["replay sha256"] = hashlib.sha256(text).hexdigest()
        return given

    @property
    def words(self) -> list[str]:
        """The options of the command line that say the same, but for a user, password or query in an address."""
        if self.kind == "rules":
            return []
        words = ["--planner", self.kind]
        for name, value in (
            ("--model", self.model),
            ("--base-url", None if self.base_url is None else without_secrets(self.base_url)),
            ("--replay", self.replay),
            ("--instruction", self.instruction),
        ):
            if value is not None:
                words += [name, str(value)]
        return words


def _writable(text: str) -> bool:
    """Whether it can be written as UTF-8."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True
