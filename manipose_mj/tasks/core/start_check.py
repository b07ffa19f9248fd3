"""Refuses starts that cannot be written into a scene, before anything moves."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from manipose_mj.errors import InputError, brief, check_count, unknown_name
from manipose_mj.poses import compose
from manipose_mj.tasks.core.start import EpisodeStart, PlacedFurniture, PlacedObject
from manipose_mj.tasks.goals import Goal, OrientationGoal, PoseGoal

_RIGID = 1e-4  # how far a rotation may be from orthonormal, and a quaternion from length 1


def check_start(
    start: Any,
    objects: int,
    furniture: Sequence[Collection[str]] = (),
    fixtures: Collection[str] = (),
    observed: Collection[str] = ("object",),
) -> None:
    """Raise `InputError` for a start that cannot be written into a scene.

    Args:
      start: As a task drew it.
      objects: Number of the scene's rigid objects.
      furniture: Names of the parts of each of its articulated objects.
      fixtures: Names of its fixtures.
      observed: The task's `observed_objects`.
    """
    if not isinstance(start, EpisodeStart):
        raise InputError(f"the start is {brief(start)}; expected an EpisodeStart from `sample`")
    for what, value in (("objects", start.objects), ("fixtures", start.fixtures)):
        if not isinstance(value, Mapping):
            raise InputError(f"{what} of the start is {brief(value)}; expected a mapping by name")
    for what, value in (("goals", start.goals), ("furniture", start.furniture)):
        if not isinstance(value, tuple | list):
            raise InputError(f"{what} of the start is {brief(value)}; expected a tuple")
    _check_objects(start.objects, objects)
    for name in start.objects:
        if name not in observed:
            raise InputError(
                f"object {name!r} of the start is not among the task's observed_objects: {', '.join(observed)}"
            )
    parts = _check_furniture(start.furniture, furniture)
    for name, pose in start.fixtures.items():
        if name not in fixtures:
            raise unknown_name("fixture of the start", name, fixtures)
        check_pose(pose, f"the pose of fixture {name!r}")
    if not start.goals:
        raise InputError("the start has no goal; expected at least one")
    for number, goal in enumerate(start.goals):
        _check_goal(f"goal {number} of the start", goal, start.objects, parts)


def check_pose(pose: Any, what: str) -> None:
    """Raise `InputError` where something is no rigid transform; `what` names it in the message."""
    try:
        array = np.asarray(pose, float)
    except (TypeError, ValueError):
        raise InputError(f"{what} is {brief(pose)}; expected a pose, 4 x 4") from None
    if array.shape != (4, 4):
        raise InputError(f"{what} has shape {array.shape}; expected a pose, 4 x 4")
    if not np.isfinite(array).all():
        raise InputError(f"{what} has NaN or infinite entries; expected finite ones")
    rotation = array[:3, :3]
    skew = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if skew > _RIGID or np.linalg.det(rotation) < 0 or np.any(array[3] != (0, 0, 0, 1)):
        raise InputError(f"{what} is no rigid transform: expected an orthonormal rotation")


def _check_objects(placed: Mapping[str, Any], count: int) -> None:
    for name, each in placed.items():
        if not isinstance(each, PlacedObject):
            raise InputError(
                f"object {name!r} of the start is {brief(each)}; expected a PlacedObject"
            )
        _check_index(f"object {name!r}", each.index, count)
        check_pose(each.pose, f"the pose of object {name!r}")
    _check_once("object", (each.index for each in placed.values()))


def _check_furniture(placed: Sequence[Any], parts: Sequence[Collection[str]]) -> frozenset[str]:
    """The parts of the furniture in play."""
    for each in placed:
        if not isinstance(each, PlacedFurniture):
            raise InputError(f"furniture of the start is {brief(each)}; expected PlacedFurniture")
        _check_index("furniture", each.index, len(parts))
        what = f"furniture {each.index}"
        if np.shape(each.position) != (3,) or not np.isfinite(each.position).all():
            raise InputError(
                f"the position of {what} is {brief(each.position)}; expected 3 finite numbers"
            )
        quaternion = np.asarray(each.quaternion)
        if quaternion.shape != (4,) or not abs(np.linalg.norm(quaternion) - 1) < _RIGID:
            raise InputError(
                f"the quaternion of {what} is {brief(each.quaternion)}; expected 4 numbers of length 1"
            )
        for name in each.openings:
            if name not in parts[each.index]:
                raise unknown_name(f"part of {what}", name, parts[each.index])
    _check_once("furniture", (each.index for each in placed))
    return frozenset(name for each in placed for name in parts[each.index])


def _check_goal(
    what: str, goal: Any, objects: Mapping[str, PlacedObject], parts: Collection[str]
) -> None:
    if not isinstance(goal, Goal):
        raise InputError(f"{what} is {brief(goal)}; expected a Goal")
    for attribute, names in (("object", objects), ("part", parts)):
        name = getattr(goal, attribute, None)
        if isinstance(name, str) and name not in names:
            raise InputError(
                f"{what} is about the {attribute} {name!r}; those in play are {', '.join(sorted(names)) or 'none'}"
            )
    if isinstance(goal, PoseGoal):
        check_pose(goal.pose, f"the pose of {what}")
    elif isinstance(goal, OrientationGoal):
        if np.shape(goal.rotation) != (3, 3):
            raise InputError(
                f"the rotation of {what} is {brief(goal.rotation)}; expected 3 x 3 numbers"
            )
        check_pose(compose(goal.rotation, np.zeros(3)), f"the rotation of {what}")


def _check_index(what: str, index: Any, count: int) -> None:
    check_count(f"the index of {what}", index)
    if index >= count:
        raise InputError(f"{what} has index {index}; the scene has {count} of its kind")


def _check_once(kind: str, indices: Iterable[int]) -> None:
    seen: set[int] = set()
    for index in indices:
        if index in seen:
            raise InputError(f"{kind} {index} of the scene is twice in the start; expected once")
        seen.add(index)
