"""A symbolic planner: from a goal and a belief to a plan of primitives."""

from __future__ import annotations

from manipose_mj.control.belief import Belief
from manipose_mj.control.carrying import RestGoal, carry
from manipose_mj.control.clearing import in_clutter, next_move
from manipose_mj.control.motion_planner import MotionPlanner
from manipose_mj.control.plan import Plan
from manipose_mj.control.plan_articulated import PartGoal, plan_part_goal
from manipose_mj.tasks.goals import Goal


def make_plan(
    goals: tuple[Goal, ...], belief: Belief, planner: MotionPlanner | None = None, skip: int = 0
) -> Plan:
    """Steps that reach the goals, one after the other, from what is believed.

    In clutter it is the next move only; no steps at all when the goals are reached.

    Args:
      goals: All of them.
      belief: What is where.
      planner: Of motions in the scene of `belief`; without one nothing is set down on the way.
      skip: So many of the ways that come first; they turned out not to work.

    Raises:
      InputError: A goal names something that is not there, or an object fits a cavity in no
        orientation.
    """
    if planner is not None and in_clutter(goals, belief):
        return next_move(goals, belief, planner, skip)
    plan: Plan = ()
    opened: set[str] = set()
    for goal in goals:
        if isinstance(goal, RestGoal):
            plan += carry(goal, belief, planner, skip)
        elif isinstance(goal, PartGoal):
            plan += plan_part_goal(goal, belief, planner, skip, opened)
    return plan
