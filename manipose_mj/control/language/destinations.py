"""Places that a plan can name: words for a language model, label poses for the planner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from manipose_mj.control.planning.cavity_places import poses_in_cavity
from manipose_mj.control.planning.check import PlanState
from manipose_mj.control.planning.plan_articulated import poses_in_area
from manipose_mj.control.planning.regrasp import Poses
from manipose_mj.control.planning.table_places import poses_with_rotation
from manipose_mj.control.planning.transport import destinations as rest_destinations
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.tasks.goals import Goal, OrientationGoal, PoseGoal, TakenOutGoal, UprightGoal

TABLE = "table"
OnTable = Callable[[ObjectEstimate], Poses]


@dataclass(frozen=True)
class Destination:
    """A place with a name.

    Attributes:
      text: What the model is told about it.
      poses: `T_world_label` for an object, when the plan has come so far; empty where it does not fit.
      only_for: Name of the one object it is for; None: any.
    """

    text: str
    poses: Callable[[ObjectEstimate, PlanState], Poses]
    only_for: str | None = None


def named_destinations(
    goals: tuple[Goal, ...], estimate: SceneEstimate, on_table: OnTable | None = None
) -> dict[str, Destination]:
    """Every place of the scene that has a name.

    Args:
      goals: What the task shows as goals: poses, turns and areas.
      estimate: What is where.
      on_table: Finds free places for an object on the table; by default any place on it.
    """
    free = on_table or _anywhere_on_table
    found = {
        TABLE: Destination(
            "a free place on the table, the same side down", lambda obj, _: free(obj)
        )
    }
    for name, part in estimate.parts.items():
        if part.cavity is not None:
            found[f"inside {name}"] = Destination(
                f"on the floor of what {name} closes",
                lambda obj, state, part=part: poses_in_cavity(
                    obj, part, state.openings[part.name], state.as_estimate()
                ),
            )
    for goal in goals:
        if getattr(goal, "object", None) not in estimate.objects:
            continue  # nobody can bring it there yet
        if isinstance(goal, PoseGoal | OrientationGoal | UprightGoal):
            found[f"goal of {goal.object}"] = Destination(
                _goal_text(goal),
                lambda obj, _, goal=goal: rest_destinations(goal, obj),
                goal.object,
            )
        elif isinstance(goal, TakenOutGoal):
            found[f"area of {goal.object}"] = Destination(
                f"the marked area on the table for {goal.object}",
                lambda obj, _, goal=goal: poses_in_area(goal, obj),
                goal.object,
            )
    return found


def _goal_text(goal: PoseGoal | OrientationGoal | UprightGoal) -> str:
    if isinstance(goal, PoseGoal):
        x, y, z = (float(v) for v in goal.pose[:3, 3])
        return f"the pose at ({x:.2f}, {y:.2f}, {z:.2f}) m that {goal.object} shall have"
    if isinstance(goal, OrientationGoal):
        return f"on the table, turned as {goal.object} shall be"
    return f"on the table, {goal.object} upright"


def _anywhere_on_table(obj: ObjectEstimate) -> Poses:
    return poses_with_rotation(obj, obj.label_pose[:3, :3])
