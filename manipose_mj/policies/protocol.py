"""What a policy is, and what it may answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from manipose_mj.failures import StageFailure

NOT_FINITE = "an action holds a value that is no finite number"


@dataclass(frozen=True)
class ActionSpace:
    """What actions an episode takes.

    Attributes:
      low: Least values; the last number is the gripper's opening [m], in DROID's format 0 (open) to 1 (shut).
      high: Greatest values; what lies beyond is clipped and counted.
      control_mode: What the numbers mean, such as `"pd_joint_pos"`.
      hz: Actions per second of simulated time.
    """

    low: Float[np.ndarray, "n"]
    high: Float[np.ndarray, "n"]
    control_mode: str
    hz: float

    @property
    def size(self) -> int:
        """Numbers in an action."""
        return len(self.low)


@runtime_checkable
class Policy(Protocol):
    """Reads observations and answers with actions; a worker process has one for all of its episodes."""

    def reset(self, *, task: str, instruction: str, seed: int, action_space: ActionSpace) -> None:
        """An episode begins.

        Args:
          task: `"domain/name"`.
          instruction: One sentence that names object, part and goal of this episode.
          seed: Of the episode; a policy that draws its randomness from it repeats itself.
          action_space: Of the episode.
        """
        ...

    def infer(self, obs: Mapping[str, Any]) -> Mapping[str, Any]:
        """Decide.

        Args:
          obs: Arrays by name, and the instruction.

        Returns:
          `"actions"`, `(t, n)`: the next actions, one for each `1 / hz` seconds. With a true `"done"` the episode
          ends after them.

        Raises:
          StageFailure: It gives up.
        """
        ...


@dataclass(frozen=True)
class Decision:
    """A checked answer.

    Attributes:
      actions: To carry out, in their order; not clipped yet.
      done: Whether the policy wants nothing after them.
    """

    actions: Float[np.ndarray, "t n"]
    done: bool = False


def checked_answer(answer: Any, size: int) -> Decision:
    """The answer of a policy as a decision.

    Args:
      answer: What `infer` returned. RoboArena's servers send the array alone, or as `"action"`.
      size: Numbers in an action.

    Raises:
      StageFailure: Of the stage `policy`: it holds no actions, of another shape, or not finite.
    """
    done = False
    values = answer
    if isinstance(answer, Mapping):
        if "actions" not in answer and "action" not in answer:
            names = ", ".join(map(repr, answer)) or "nothing"
            raise StageFailure("policy", f"the policy answered with {names}; expected 'actions'")
        values = answer["actions"] if "actions" in answer else answer["action"]
        try:
            done = answer.get("done", False)
            if isinstance(done, str | bytes):  # "no" would be true
                raise TypeError
            done = bool(done)
        except Exception:  # of whichever library the value is
            raise StageFailure("policy", "'done' is neither true nor false") from None
    try:
        if np.iscomplexobj(values):
            raise TypeError(f"complex numbers: {values!r:.60}")
        actions = np.asarray(values, float)
    except Exception as error:  # of whichever library they are
        why = " ".join(f"{type(error).__name__}: {error}".split())
        raise StageFailure("policy", f"the actions are no numbers: {why:.160}") from None
    least = 0 if done else 1
    if actions.ndim != 2 or actions.shape[1] != size or len(actions) < least:
        raise StageFailure(
            "policy", f"the actions have shape {actions.shape}; expected (t, {size}) with t > 0"
        )
    if not np.isfinite(actions).all():
        raise StageFailure("policy", NOT_FINITE)
    return Decision(actions, done)


def answered_width(answer: Any) -> int | None:
    """Numbers in an action of an answer; None where it holds no `(t, n)` array."""
    values = answer
    if isinstance(answer, Mapping):
        values = answer.get("actions", answer.get("action"))
    try:
        shape = np.shape(values)
    except Exception:  # rows of different lengths, or of whichever library they are
        return None
    return shape[1] if len(shape) == 2 else None
