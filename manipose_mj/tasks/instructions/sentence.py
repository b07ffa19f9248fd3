"""The instruction of an episode: one sentence that names object, part and goal."""

from __future__ import annotations

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.tasks.articulated.part_choice import kind_of
from manipose_mj.tasks.core.registry import named_task
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import (
    Goal,
    InsideGoal,
    OnTableGoal,
    OpenGoal,
    OrientationGoal,
    PoseGoal,
    ShutGoal,
    TakenOutGoal,
    UprightGoal,
)
from manipose_mj.tasks.instructions.names import (
    asset_words,
    attitude_words,
    level_words,
    part_words,
    place_words,
)

_DROP_NONE = "drop no object off the table"


def instruction(task: ManipulationTask) -> str:
    """What the present episode asks for, places as seen from the robot.

    Goals of kinds that this package does not know are told by the summary of the task.

    Args:
      task: In an episode.
    """
    phrases: list[str] = []
    for goal in task.goals:
        phrase = _phrase(task, goal)
        if phrase is None:
            return named_task(task.env_config.task).summary
        if phrase not in phrases:
            phrases.append(phrase)
    text = ", then ".join(phrases)
    return f"{text[:1].upper()}{text[1:]}."


def asked_parts(task: ManipulationTask) -> dict[str, str]:
    """What an instruction calls the drawers and doors that goals are about, by the goals' names for them.

    Args:
      task: In an episode.
    """
    names = [part for goal in task.goals if (part := getattr(goal, "part", None)) is not None]
    return {
        name: part_words(asset := _owner(task, name), asset.part(name))
        for name in dict.fromkeys(names)
    }


def _phrase(task: ManipulationTask, goal: Goal) -> str | None:
    """The words of one goal; None where it has none."""
    match goal:
        case PoseGoal():
            asset = task.objects[goal.object].asset
            pose = np.asarray(goal.pose)
            place, attitude = place_words(pose[:3, 3]), attitude_words(asset, pose[:3, :3])
            return f"put {_object(task, goal.object)} down {place}, {attitude}"
        case OrientationGoal():
            asset = task.objects[goal.object].asset
            attitude = attitude_words(asset, np.asarray(goal.rotation))
            return f"turn {_object(task, goal.object)} until it rests {attitude}"
        case UprightGoal():
            return f"set {_object(task, goal.object)} upright on the table"
        case OnTableGoal():
            return _DROP_NONE
        case OpenGoal():
            return f"open {_part(task, goal.part)}"
        case ShutGoal():
            return f"shut {_part(task, goal.part)}"
        case InsideGoal():
            into, _ = _cavity(task, goal.part)
            return f"put {_object(task, goal.object)} {into}"
        case TakenOutGoal():
            _, out_of = _cavity(task, goal.part)
            out = f"take {_object(task, goal.object)} {out_of}"
            return f"{out} and set it down on the table {level_words(np.asarray(goal.center))}"
    return None


def _object(task: ManipulationTask, name: str) -> str:
    """The words of an object; with its place at the start where the scene has another of its kind."""
    words = asset_words(task.objects[name].asset)
    alike = [n for n, entity in task.objects.items() if asset_words(entity.asset) == words]
    if len(alike) == 1 or task.start is None:
        return f"the {words}"
    placed = task.start.objects[name]
    pose = placed.pose @ task.objects[name].asset.label.pose
    return f"the {words} ({level_words(pose[:2, 3])})"


def _part(task: ManipulationTask, name: str) -> str:
    """The words of a drawer or door, and of what it is of."""
    asset = _owner(task, name)
    part = next(part for part in asset.parts if part.name == name)
    return f"the {part_words(asset, part)} of the {asset_words(asset)}"


def _cavity(task: ManipulationTask, name: str) -> tuple[str, str]:
    """Into and out of what a part shuts: drawers hold things themselves, what doors shut stays where it is."""
    asset, part = _owner(task, name), _part(task, name)
    words = part_words(asset, asset.part(name))
    if kind_of(asset.part(name)) == "drawer":
        return f"into {part}", f"out of {part}"
    if words == "door":
        return f"into the {asset_words(asset)}", f"out of the {asset_words(asset)}"
    return f"behind {part}", f"from behind {part}"


def _owner(task: ManipulationTask, part: str) -> Asset:
    """The piece of furniture that has a part; no two have parts of one name."""
    return next(
        piece.asset
        for piece in task.articulated_objects
        if any(each.name == part for each in piece.asset.parts)
    )
