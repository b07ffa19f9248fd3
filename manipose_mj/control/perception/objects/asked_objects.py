"""What goals ask for of objects, as far as perception needs it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from manipose_mj.poses import SymmetryGroup
from manipose_mj.tasks.goals import Goal, OnTableGoal, PoseGoal


def in_the_open(goals: Sequence[Goal]) -> bool:
    """Whether all are about objects that others at most may hide."""
    return all(isinstance(goal, PoseGoal | OnTableGoal) for goal in goals)


def asked_rotations(
    goals: Sequence[Goal], name: str, symmetries: Mapping[str, SymmetryGroup]
) -> list[Float[np.ndarray, "3 3"]]:
    """`R_world_label` that goals ask for of an object, by the symmetries of all."""
    own = [goal for goal in goals if getattr(goal, "object", None) == name]
    frames = [goal.goal_frame(symmetries) for goal in own]
    return [
        np.asarray(frame.pose)[:3, :3]
        for frame in frames
        if frame is not None and frame.rotation_counts
    ]
