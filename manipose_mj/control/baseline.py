"""The baseline policy: observe, plan symbolically, execute primitives."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import mujoco
import numpy as np
from dm_control import composer

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.control.execution.executor import Action, Executor
from manipose_mj.control.execution.looking import way_to_look_into
from manipose_mj.control.execution.primitives import Primitives
from manipose_mj.control.execution.recovery import let_go_safely
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception.perturbed import UNPERTURBED, PosePerturbation
from manipose_mj.control.perception.pose_sources import make_perception
from manipose_mj.control.perception.protocol import Perception
from manipose_mj.control.perception.source_names import GraspSource
from manipose_mj.control.planning.check import check_plan
from manipose_mj.control.planning.plan import CandidatePlan, Plan, Step, plan_to_json
from manipose_mj.control.planning.plan_articulated import parts_to_look_behind, stand_wrong
from manipose_mj.control.planning.plan_pieces import led_and_pushed, opened_by, until_a_look
from manipose_mj.control.planning.planner import RulePlanner, TaskPlanner
from manipose_mj.control.planning.rearrangement import is_supported
from manipose_mj.control.planning.transport import lie_wrong
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.errors import InputError, RecordError
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.failures import StageFailure
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import TakenOutGoal
from manipose_mj.tasks.instructions.sentence import instruction

# Plans an episode may try, and stages whose failure another plan may mend.
MAX_PLANS = 5
MAX_STAGED_PLANS = (
    4  # the same, once these have failed at a drawer or door, with parts moved in stages
)
MAX_LOOKS = 6  # into what was opened, where furniture is estimated
MAX_FAILED_MOVES = 30  # the same in clutter, where each move is a plan
# After the last step; for what rolls in a drawer to come to rest, where nobody is told whether the goal is met [s].
_AT_END, _TO_REST = 0.5, 3.0
_LED_ON = 0.08  # of its range, by which a part has moved that a plan has led on
_WORTH_ANOTHER_PLAN = ("grasp", "plan", "motion")


class _Progress:
    """Attributes: failures_here: plans that failed since something was last set down."""

    def __init__(self) -> None:
        self.failures_here = 0
        self._last = ""

    def made(self) -> None:
        """Something was set down."""
        self.failures_here, self._last = 0, ""

    def led_on(self, before: SceneEstimate, after: SceneEstimate) -> None:
        """A plan failed: where it has moved a part, what failed before may do now."""
        shares = [{p.name: _share_open(p) for p in each.parts.values()} for each in (before, after)]
        # What was taken for a part may have turned out to be none.
        if any(abs(shares[1].get(n, share) - share) > _LED_ON for n, share in shares[0].items()):
            self.failures_here = (
                -1
            )  # with the failure that is about to be counted: the first plan again

    def failed_again(self, plan: Plan, estimate: SceneEstimate, *, counts: bool) -> bool:
        """Count a failure, if it `counts`; whether it is of the plan that failed before, with nothing opened since.

        Args:
          plan: That failed.
          estimate: With which it was made.
          counts: Whether the failure counts.
        """
        self.failures_here += counts
        openings = {part.name: round(_share_open(part), 1) for part in estimate.parts.values()}
        text = f"{plan_to_json(plan)} {openings}"
        same, self._last = text == self._last, text
        return same


@dataclass(frozen=True)
class _Scene:
    """What the baseline compiles for one scene, whose model is `model`."""

    model: mujoco.MjModel
    perception: Perception


class Baseline:
    """Plans and acts in one environment; build it once, run it for many episodes."""

    def __init__(
        self,
        environment: composer.Environment,
        pose: str = "oracle",
        planner: TaskPlanner | None = None,
        estimator: EstimatorSettings | None = None,
        errors: PosePerturbation = UNPERTURBED,
        grasps: GraspSource | None = None,
    ) -> None:
        """Compiles the planner's models; those of another scene when an episode has one.

        Args:
          environment: Of one of this package's tasks, after its first reset.
          pose: Where object poses come from, one of `POSE_SOURCES`.
          planner: Makes the plans; by default by rules.
          estimator: Whose estimates `"estimated"` are; None: those of the package's weights.
          errors: Made to the poses of objects on purpose.
          grasps: Where those of objects come from; by default what suits `pose`.

        Raises:
          InputError: There is no such source or estimator.
        """
        self._environment, self._pose = environment, pose
        self._estimator, self._errors = estimator, errors
        self._grasps: GraspSource | None = grasps
        self._planner = planner or RulePlanner()
        self._compiled = self._compile()
        self.status = ""
        self._subject = ""  # of the last step begun

    @property
    def perception(self) -> Perception:
        """Where the baseline's knowledge of the present scene comes from."""
        return self._scene().perception

    @property
    def arm(self) -> ArmModel:
        """The arm in the present scene; of an estimated one, after an episode's reset."""
        return self.perception.arm

    def _scene(self) -> _Scene:
        """What is compiled for the environment's present scene."""
        if self._compiled.model is not self._environment.physics.model.ptr:
            self._compiled = self._compile()
        return self._compiled

    def _compile(self) -> _Scene:
        task, physics = self._environment.task, self._environment.physics
        assert isinstance(task, ManipulationTask)
        perception = make_perception(
            self._pose, task, physics, self._estimator, self._errors, self._grasps
        )
        return _Scene(physics.model.ptr, perception)

    def actions(self, seed: int, plans: int = MAX_PLANS) -> Iterator[Action]:
        """The actions of one episode, from the start state to the goal.

        Args:
          seed: Of the motion planner's samples.
          plans: How many it may try; in clutter, where each move has a plan, `MAX_FAILED_MOVES` times as many as
            `MAX_PLANS` go into it.

        Raises:
          StageFailure: The baseline gives up; the stage says where.
        """
        self.status = ""
        scene, task = self._scene(), self._environment.task
        follows = self._planner.follows_goals
        scene.perception.reset(seed, for_goals=follows)
        self._planner.reset(instruction(task))
        timestep = task.control_timestep
        executor = Executor(scene.perception, timestep)
        primitives = Primitives(executor)
        rng = np.random.default_rng(seed)
        progress, failures, budget, allowance = _Progress(), 0, plans, 0.0
        looks = MAX_LOOKS if scene.perception.feels_joints or scene.perception.unseen else 0
        candidates: Iterator[CandidatePlan] | None = None
        while True:
            try:
                if candidates is None:
                    scene.perception.look_around()
                    estimate = executor.observe()
                    arm = scene.perception.arm
                    planner = MotionPlanner(estimate.scene, arm, timestep, rng, allowance)
                    step_by_step = self._planner.step_by_step(task.goals, estimate)
                    candidates = self._planner.candidates(
                        task.goals, estimate, planner, task.config.tolerance
                    )
                    candidate = _after(candidates, progress.failures_here)
                else:
                    candidate = _after(candidates, 0)
                plan = candidate.steps()
                check_plan(plan, estimate)
            except RecordError:
                raise
            except InputError as error:
                raise StageFailure("plan", str(error)) from None
            # It stands until another plan is chosen.
            allowance = candidate.contact_allowance
            planner = planner.allowing(allowance)
            acted = falls_short = False
            try:
                steps = until_a_look(plan) if looks > 0 else plan
                for number, piece in enumerate(led_and_pushed(steps) if looks > 0 else (steps,)):
                    if number and not scene.perception.unseen:
                        # What the hand led is measured before it is pushed on.
                        scene.perception.look_again()
                        seen, arm = executor.observe(), scene.perception.arm
                        planner = MotionPlanner(seen.scene, arm, timestep, rng, allowance)
                    for action in self._carry_out(
                        piece, planner, primitives, progress, thorough=not step_by_step
                    ):
                        acted = True
                        yield action
                cut, unseen = len(steps) < len(plan), scene.perception.unseen
                hidden = parts_to_look_behind(task.goals, estimate) if follows else ()
                if unseen and not (follows or cut):
                    hidden = opened_by(steps, estimate)
                ends = not (step_by_step and plan)
                if cut or (looks > 0 and hidden):
                    looks -= 1
                    yield from self._look_behind(hidden, planner, executor)
                    progress.made()
                    # What was asked for besides goals may be about what shows now; else nothing is left to plan.
                    ends = not (follows or cut or scene.perception.unseen < unseen)
                if ends:
                    self.status = "done"
                    yield from executor.wait(_AT_END)
                    if step_by_step or not follows or not self._falls_short(executor):
                        yield from executor.wait(_TO_REST if scene.perception.feels_joints else 0.0)
                        return
                    falls_short = True
                    primitives.avoid_last_grasps()
                    raise StageFailure(
                        "release", "the goal is not met though the plan was carried out"
                    )
                candidates = None
            except StageFailure as failure:
                self._planner.failed(f"{self.status}: {failure.reason}")
                failures += 1
                most = MAX_FAILED_MOVES * plans // MAX_PLANS if step_by_step else budget
                # In clutter the same plan may be carried out another way.
                counts = acted or not step_by_step
                staged = primitives.in_stages
                if (scene.perception.feels_joints or staged) and counts and not falls_short:
                    progress.led_on(estimate, executor.observe())
                same = progress.failed_again(plan, estimate, counts=counts)
                exhausted = (same and not step_by_step) or failures == most
                if exhausted and not (step_by_step or staged) and self._subject in estimate.parts:
                    # All that moves this part at once has failed.
                    primitives.in_stages, exhausted = True, False
                    budget = failures + MAX_STAGED_PLANS
                    progress.made()
                mends = (*_WORTH_ANOTHER_PLAN, "release") if step_by_step else _WORTH_ANOTHER_PLAN
                if exhausted or (failure.stage not in mends and not falls_short):
                    raise
                if step_by_step and not acted:
                    continue  # all is where it was: the next candidate
                candidates = None
                yield from self._recover(executor, primitives, planner, failure, step_by_step)

    def _falls_short(self, executor: Executor) -> bool:
        """Whether goals are not met: as far as is seen, or by the task itself where poses are true.

        Objects are not looked at where errors are made on purpose: what these cost would be less.
        """
        task, physics = self._environment.task, self._environment.physics
        assert isinstance(task, ManipulationTask)
        if self._pose == "oracle" and self._errors == UNPERTURBED:
            return not task.succeeded(physics)
        estimate = executor.observe()
        if self._errors == UNPERTURBED and lie_wrong(task.goals, estimate, task.config.tolerance):
            return True
        return executor.feels_joints and stand_wrong(task.goals, estimate)

    def _carry_out(
        self,
        plan: Plan,
        planner: MotionPlanner,
        primitives: Primitives,
        progress: _Progress,
        *,
        thorough: bool,
    ) -> Iterator[Action]:
        for index, step in enumerate(plan):
            self.status, self._subject = str(step), step.subject
            if step.primitive == "grasp_at":
                destination = _destination(plan, index)
                yield from primitives.grasp_at(planner, step.subject, destination, thorough)
            elif step.primitive == "move_to":
                yield from primitives.move_to(planner, step, thorough)
            else:
                yield from primitives.release(planner, step.subject)
                progress.made()
            self._planner.carried_out(step)

    def _look_behind(
        self, parts: Sequence[str], planner: MotionPlanner, executor: Executor
    ) -> Iterator[Action]:
        """Measure what was opened, and look through the hand's camera into what hides an object that a goal is about.

        Raises:
          StageFailure: It does not show, and the plans are for goals.
        """
        perception, goals = self.perception, self._environment.task.goals
        follows = self._planner.follows_goals
        perception.look_again()
        hiding = set(parts)
        if follows:
            hiding &= {goal.part for goal in goals if isinstance(goal, TakenOutGoal)}
        for name in sorted(hiding) if perception.looks_by_hand else ():
            if not (follows or perception.unseen):
                break
            self.status = f"look into {name}"
            estimate = executor.observe()
            way = way_to_look_into(planner.within(estimate.scene), estimate, estimate.parts[name])
            if way is not None:
                yield from executor.follow(way)
                yield from executor.open_to(MAX_OPENING)
                perception.look_closely()
        for name in sorted(perception.unseen) if follows else ():
            raise StageFailure("perception", f"no camera sees enough of {name}, opened or not")

    def _recover(
        self,
        executor: Executor,
        primitives: Primitives,
        planner: MotionPlanner,
        failure: StageFailure,
        step_by_step: bool,
    ) -> Iterator[Action]:
        """Empty the hand so that another plan can be made; where that fails too, raise the failure.

        What lies on something is let go of where it is, if nothing better can be done. In clutter an empty hand will
        do, wherever it is.
        """
        self.status = "recover"
        estimate = executor.observe()
        try:
            yield from let_go_safely(
                primitives,
                planner,
                estimate,
                failure,
                supported=step_by_step and _lies(primitives.held, estimate),
                among_others=step_by_step,
            )
        except StageFailure:
            if step_by_step and primitives.held is None:
                return
            if step_by_step or not _lies(primitives.held, executor.observe()):
                raise failure from None
            yield from primitives.release(planner, primitives.held or "")


def _lies(name: str | None, estimate: SceneEstimate) -> bool:
    """Whether this object, which the hand holds, lies on something."""
    held = estimate.objects.get(name or "")
    return held is not None and is_supported(held, estimate.scene)


def _share_open(part: PartEstimate) -> float:
    low, high = part.joint.range
    return (part.opening - low) / (high - low)


def _after(candidates: Iterator[CandidatePlan], failed: int) -> CandidatePlan:
    """The candidate after those that failed; where there are no more, the last of them.

    Raises:
      InputError: There is none at all.
    """
    found = deque(islice(candidates, failed + 1), maxlen=1)
    if not found:
        raise InputError("the planner has no plan left")
    return found.pop()


def _destination(plan: Plan, index: int) -> Step | None:
    """Where the object grasped at `index` goes next."""
    following = plan[index + 1] if index + 1 < len(plan) else None
    if following is not None and following.primitive == "move_to":
        return following
    return None
