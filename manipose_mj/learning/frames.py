"""The frames in which policies see and act, by name."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.learning import handle_frame, object_frame
from manipose_mj.learning.grip import Observation
from manipose_mj.poses import Array


class Frame(Protocol):
    """Attributes: SEEN, names of observations; NEEDS, the tasks that have them, in words."""

    SEEN: tuple[str, ...]
    NEEDS: str

    def features(self, observation: Observation) -> Float[Array, "*b n"]:
        """What the networks see."""
        ...

    def command(
        self, observation: Observation, action: Float[Array, "*b 7"]
    ) -> Float[Array, "*b 7"]:
        """An action of the control mode `pd_ee_pose`, of numbers from -1 to 1."""
        ...


FRAMES: dict[str, Frame] = {"handle": handle_frame, "object": object_frame}


def frame_of(task: str, posed: Collection[str]) -> str:
    """The name of the frame for a task.

    Args:
      task: Its name, for what is said.
      posed: What has a pose to be observed.

    Raises:
      InputError: Neither an object nor a handle alone is what the task is about.
    """
    if "handle" in posed and "object" not in posed:
        return "handle"
    if "object" in posed and not any(name.startswith(("handle", "joint")) for name in posed):
        return "object"
    needs = " or ".join(frame.NEEDS for frame in FRAMES.values())
    raise InputError(f"{task}: has no grip frame to learn in; choose {needs}")
