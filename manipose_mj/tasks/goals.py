"""What a task wants, as data that any planner can read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class PoseGoal:
    """The object's label shall rest at `pose` (`T_world_label`), up to its symmetry."""

    object: str
    pose: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class StoreGoal:
    """The object shall lie in the cavity that `part` opens, and `part` shall be shut."""

    object: str
    part: str


Goal = PoseGoal | StoreGoal
