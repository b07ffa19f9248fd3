"""The baseline policy: perceive, plan symbolically, execute primitives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from dm_control import composer

from manipose_mj.control.arm_model import ArmModel
from manipose_mj.control.belief import Senses
from manipose_mj.control.clearing import in_clutter, is_supported
from manipose_mj.control.executor import Action, Executor
from manipose_mj.control.failure import StageFailure
from manipose_mj.control.motion_planner import MotionPlanner
from manipose_mj.control.plan import Plan, Step, plan_to_json
from manipose_mj.control.planner import make_plan
from manipose_mj.control.pose_sources import make_senses
from manipose_mj.control.primitives import Primitives
from manipose_mj.control.recovery import let_go_safely
from manipose_mj.errors import InputError
from manipose_mj.tasks.base import ManipulationTask

# Plans an episode may try, and stages whose failure another plan may mend.
MAX_PLANS = 5
MAX_FAILED_MOVES = 30  # the same in clutter, where each move is a plan
_WORTH_ANOTHER_PLAN = ("grasp", "plan", "motion")


class _Progress:
    """Attributes: failures_here: plans that failed since something was last set down."""

    def __init__(self) -> None:
        self.failures_here = 0
        self._last = ""

    def made(self) -> None:
        """Something was set down."""
        self.failures_here, self._last = 0, ""

    def failed_again(self, plan: Plan) -> bool:
        """Count a failure; whether it is of the plan that failed before."""
        self.failures_here += 1
        text = plan_to_json(plan)
        same, self._last = text == self._last, text
        return same


class Baseline:
    """Plans and acts in one environment; build it once, run it for many episodes."""

    def __init__(self, environment: composer.Environment, pose: str = "oracle") -> None:
        """Compiles the planner's models.

        Args:
          environment: Of one of this package's tasks, after its first reset.
          pose: Where object poses come from, one of `POSE_SOURCES`.

        Raises:
          InputError: There is no such source.
        """
        task = environment.task
        assert isinstance(task, ManipulationTask)
        self._task = task
        self._physics = environment.physics
        self._arm = ArmModel(task.root_entity.mjcf_model, task.robot.mjcf_model.model)
        self._senses = make_senses(pose, task, self._physics)
        self.status = ""

    @property
    def senses(self) -> Senses:
        """Where the baseline's knowledge comes from."""
        return self._senses

    def actions(self, seed: int) -> Iterator[Action]:
        """The actions of one episode, from the start state to the goal.

        Args:
          seed: Of the motion planner's samples.

        Raises:
          StageFailure: The baseline gives up; the stage says where.
        """
        self.status = ""
        timestep = self._task.control_timestep
        scene = self._senses.begin(seed)
        planner = MotionPlanner(scene, self._arm, timestep, np.random.default_rng(seed))
        executor = Executor(self._senses, timestep)
        primitives = Primitives(executor, planner)
        progress = _Progress()
        failures = 0
        while True:
            belief = executor.perceive()
            step_by_step = in_clutter(self._task.goals, belief)
            try:
                plan = make_plan(self._task.goals, belief, planner, progress.failures_here)
            except InputError as error:
                raise StageFailure("plan", str(error)) from None
            try:
                yield from self._carry_out(plan, primitives, progress)
                if not (step_by_step and plan):
                    break
            except StageFailure as failure:
                failures += 1
                most = MAX_FAILED_MOVES if step_by_step else MAX_PLANS
                # In clutter the same plan may be carried out another way.
                same = progress.failed_again(plan) and not step_by_step
                exhausted = same or failures == most
                if exhausted or failure.stage not in _WORTH_ANOTHER_PLAN:
                    raise
                self.status = "recover"
                try:
                    belief = executor.perceive()
                    held = belief.objects.get(primitives.held or "")
                    lies = step_by_step and held is not None and is_supported(held, planner)
                    yield from let_go_safely(primitives, belief, failure, supported=lies)
                except StageFailure:
                    raise failure from None
        self.status = "done"
        yield from executor.wait(0.5)

    def _carry_out(
        self, plan: Plan, primitives: Primitives, progress: _Progress
    ) -> Iterator[Action]:
        for index, step in enumerate(plan):
            self.status = str(step)
            if step.primitive == "grasp_at":
                yield from primitives.grasp_at(step.subject, _destination(plan, index))
            elif step.primitive == "move_to":
                yield from primitives.move_to(step)
            else:
                yield from primitives.release(step.subject)
                progress.made()


def _destination(plan: Plan, index: int) -> Step | None:
    """Where the thing grasped at `index` goes next."""
    following = plan[index + 1] if index + 1 < len(plan) else None
    if following is not None and following.primitive == "move_to":
        return following
    return None
