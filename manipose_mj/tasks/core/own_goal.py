"""Starts with a goal of the user's in the place of the one that was drawn."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.poses import compose
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.core.start_check import check_pose
from manipose_mj.tasks.goals import OrientationGoal, PoseGoal


def with_goal(
    start: EpisodeStart, pose: Float[np.ndarray, "4 4"], of: Collection[str] = ()
) -> EpisodeStart:
    """The start with another goal pose of the object that the episode is about, and that goal's marker there.

    Args:
      start: As it was drawn.
      pose: `T_world_label`; of it, a goal that is an orientation takes the rotation.
      of: Names of objects, one of which the goal shall be of, as goals use them; by default the first with a pose.

    Raises:
      InputError: The task asks for no pose, or this is none.
    """
    check_pose(pose, "goal")
    goals, fixtures = list(start.goals), dict(start.fixtures)
    for index, goal in enumerate(goals):
        if of and getattr(goal, "object", None) not in of:
            continue
        if isinstance(goal, PoseGoal):
            goals[index] = replace(goal, pose=pose)
            _move_marker(fixtures, goal.object, pose)
            break
        if isinstance(goal, OrientationGoal):
            goals[index] = replace(goal, rotation=pose[:3, :3])
            _move_marker(fixtures, goal.object, pose, turned_only=True)
            break
    else:
        kinds = ", ".join(goal.kind for goal in goals) or "none"
        raise InputError(f"a goal pose is given, but this task's goals are of other kinds: {kinds}")
    return replace(start, goals=tuple(goals), fixtures=fixtures)


def _move_marker(
    fixtures: dict[str, np.ndarray], name: str, pose: np.ndarray, *, turned_only: bool = False
) -> None:
    """Put the marker of the goal of an object, where there is one, at a pose or only in its orientation."""
    marker = f"goal_{name}" if f"goal_{name}" in fixtures else "goal"
    if marker in fixtures:
        place = fixtures[marker] if turned_only else pose
        fixtures[marker] = compose(pose[:3, :3], place[:3, 3])
