"""A symbolic planner: from goals and an estimate of the scene to plans of primitives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol, get_args

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import CandidatePlan, Plan, Step
from manipose_mj.control.planning.plan_articulated import (
    PartGoal,
    leads_through,
    opening_plans,
    part_goal_plans,
    parts_to_look_behind,
)
from manipose_mj.control.planning.rearrangement import (
    USUAL_TOLERANCE,
    candidate_moves,
    in_clutter,
)
from manipose_mj.control.planning.transport import RestGoal, transport_plans
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.tasks.goals import Goal, InsideGoal, OnTableGoal, TakenOutGoal, Tolerance


class TaskPlanner(Protocol):
    """From goals and an estimate of the scene to plans, whoever makes them."""

    @property
    def follows_goals(self) -> bool:
        """Whether plans are for the task's goals, and others are asked for until these are met."""
        ...

    def name_episode(self, task: str, episode: int) -> None:
        """This episode of an evaluation comes next."""
        ...

    def reset(self, instruction: str) -> None:
        """An episode begins, which asks for this in words."""
        ...

    def carried_out(self, step: Step) -> None:
        """This step of the present plan was carried out; the scene may be looked at before the others are."""
        ...

    def failed(self, reason: str) -> None:
        """The rest of the present plan is given up, and the hand is emptied; in one line, at what and why."""
        ...

    def step_by_step(self, goals: tuple[Goal, ...], estimate: SceneEstimate) -> bool:
        """Whether each plan is one move only, after which the scene is looked at again."""
        ...

    def candidates(
        self,
        goals: tuple[Goal, ...],
        estimate: SceneEstimate,
        planner: MotionPlanner,
        tolerance: Tolerance,
    ) -> Iterator[CandidatePlan]:
        """Plans that reach the goals, the most promising first, at least one.

        Args:
          goals: All of them.
          estimate: What is where.
          planner: Of motions in the scene of `estimate`.
          tolerance: The task's: what counts as reached.

        Raises:
          InputError: On the way through them: there is none, or there are no more.
        """
        ...


class RulePlanner:
    """Plans by the rules of this module."""

    follows_goals = True

    def name_episode(self, task: str, episode: int) -> None:
        """Rules are the same in all."""

    def reset(self, instruction: str) -> None:
        """Goals say all that rules need."""

    def carried_out(self, step: Step) -> None:
        """The scene shows what came of it."""

    def failed(self, reason: str) -> None:
        """The next candidate is another plan."""

    def step_by_step(self, goals: tuple[Goal, ...], estimate: SceneEstimate) -> bool:
        """In clutter."""
        return in_clutter(goals, estimate)

    def candidates(
        self,
        goals: tuple[Goal, ...],
        estimate: SceneEstimate,
        planner: MotionPlanner,
        tolerance: Tolerance,
    ) -> Iterator[CandidatePlan]:
        """As `candidate_plans`."""
        return candidate_plans(goals, estimate, planner, tolerance)


def candidate_plans(
    goals: tuple[Goal, ...],
    estimate: SceneEstimate,
    planner: MotionPlanner | None = None,
    tolerance: Tolerance = USUAL_TOLERANCE,
) -> Iterator[CandidatePlan]:
    """Plans that reach the goals, one after the other; the most promising first, at least one.

    In clutter each is one move only; no steps at all when the goals are reached.

    Args:
      goals: All of them.
      estimate: What is where.
      planner: Of motions in the scene of `estimate`; without one nothing is set down on the way.
      tolerance: The task's: in clutter, what counts as reached.

    Raises:
      InputError: On the way through them. A goal is of a kind that has no plan or names something that is not there,
        an object fits a cavity in no orientation, or in clutter there are no more.
    """
    if planner is not None and in_clutter(goals, estimate):
        yield from candidate_moves(goals, estimate, planner, tolerance)
        return
    for part in parts_to_look_behind(goals, estimate):
        for plan in opening_plans(part, estimate):
            yield CandidatePlan(lambda plan=plan: plan)
        return
    for plan in _joined(_plans_of_each(goals, estimate, planner)):
        yield CandidatePlan(lambda plan=plan: plan)


def make_plan(
    goals: tuple[Goal, ...],
    estimate: SceneEstimate,
    planner: MotionPlanner | None = None,
    tolerance: Tolerance = USUAL_TOLERANCE,
) -> Plan:
    """The most promising plan; arguments and errors as for `candidate_plans`."""
    for candidate in candidate_plans(goals, estimate, planner, tolerance):
        return candidate.steps()
    raise InputError("the task's goals have no plan")


def _plans_of_each(
    goals: tuple[Goal, ...], estimate: SceneEstimate, planner: MotionPlanner | None
) -> list[Iterator[Plan]]:
    """Alternative plans for each goal, which count on the plans of the goals before it."""
    plans: list[Iterator[Plan]] = []
    opened: frozenset[str] = frozenset()
    for goal in goals:
        if isinstance(goal, RestGoal):
            plans.append(transport_plans(goal, estimate, planner))
        elif isinstance(goal, PartGoal):
            plans.append(part_goal_plans(goal, estimate, planner, opened))
            if isinstance(goal, InsideGoal | TakenOutGoal) and leads_through(goal, estimate):
                opened |= {goal.part}
        elif not isinstance(goal, OnTableGoal):  # which moves keep to by themselves
            known = ", ".join(kind.__name__ for kind in (*get_args(RestGoal), *get_args(PartGoal)))
            raise InputError(
                f"the baseline has no plan for a {type(goal).__name__}; it plans for {known}"
            )
    return plans


def _joined(plans_of_each: Sequence[Iterator[Plan]]) -> Iterator[Plan]:
    """All first plans joined, then all second ones; what has no more goes on with its last."""
    plans = [next(more, None) for more in plans_of_each]
    if None in plans:
        raise InputError(f"goal {plans.index(None)} of the task has no plan")
    last = [plan or () for plan in plans]
    yield sum(last, ())
    while any(plan is not None for plan in plans):
        plans = [next(more, None) for more in plans_of_each]
        last = [old if new is None else new for old, new in zip(last, plans, strict=True)]
        if any(plan is not None for plan in plans):
            yield sum(last, ())
