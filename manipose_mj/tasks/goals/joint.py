"""Goals about a drawer or door alone: open it, shut it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Bool, Float

from manipose_mj.poses import Array
from manipose_mj.tasks.goals import stages
from manipose_mj.tasks.goals.conditions import Tolerance
from manipose_mj.tasks.goals.goal import Goal
from manipose_mj.tasks.scene.state import SceneState


@dataclass(frozen=True)
class OpenGoal(Goal):
    """The part's joint shall be open by at least `fraction` of its range."""

    kind: ClassVar[str] = "open"
    part: str
    fraction: float | Float[Array, "*b"] = 0.9

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        return state.parts[self.part].fraction >= self.fraction

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, open."""
        part = state.parts[self.part]
        return stages.part_progress(state, part, part.fraction / self.fraction)


@dataclass(frozen=True)
class ShutGoal(Goal):
    """The part's joint shall be shut: by `fraction` of its range, or, without one, to within
    the tolerance."""

    kind: ClassVar[str] = "shut"
    part: str
    fraction: float | Float[Array, "*b"] | None = None

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        part = state.parts[self.part]
        if self.fraction is not None:
            return 1 - part.fraction >= self.fraction
        return part.opening - part.range[..., 0] < tolerance.shut

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, shut."""
        part = state.parts[self.part]
        enough = 1.0 if self.fraction is None else self.fraction
        return stages.part_progress(state, part, (1 - part.fraction) / enough)
