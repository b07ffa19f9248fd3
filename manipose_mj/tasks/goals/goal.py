"""What a goal is: data that any planner can read, and pure functions of the scene's state.

A task's goals are a tuple; success is all of them. Each is a frozen dataclass: the names of what it is
about are the same in all worlds, everything else is arrays, NumPy or JAX, that may have batch dimensions.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Bool, Float

from manipose_mj.poses import Array, SymmetryGroup
from manipose_mj.tasks.goals.conditions import Tolerance
from manipose_mj.tasks.scene.state import SceneState


@dataclass(frozen=True)
class GoalFrame:
    """A pose that a goal asks of an object, for observers.

    Attributes:
      object: Its name.
      pose: `T_world_label`; its translation is zero where any place will do, the middle of an area,
        at the table's height, where the object shall lie in one.
      symmetry: Rotations of the label after which the goal is met as well.
      translation_counts: Whether the goal asks for the place.
      rotation_counts: Whether it asks for the orientation.
    """

    object: str
    pose: Float[Array, "*b 4 4"]
    symmetry: SymmetryGroup
    translation_counts: Bool[Array, "*b"] | bool = True
    rotation_counts: Bool[Array, "*b"] | bool = True


class Goal(abc.ABC):
    """One condition of success; a frozen dataclass.

    Attributes:
      kind: What planners look it up by; those of own goals need not be known to ours.
    """

    kind: ClassVar[str] = "own"

    @abc.abstractmethod
    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""

    @abc.abstractmethod
    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """How near it is, in [0, 1], for dense rewards; from `stages.PLACED` on it is all but met."""

    def goal_frame(self, symmetries: Mapping[str, SymmetryGroup]) -> GoalFrame | None:
        """The pose that it asks of an object; None for goals that ask for none.

        Args:
          symmetries: Of the objects in play, by the names that goals use.
        """
        return None
