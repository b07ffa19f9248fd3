"""An episode of a policy: ask, clip, hold, step, and stop by a rule."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import dm_env
import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.evaluation.policy_settings import CONTROL_HZ, Stop
from manipose_mj.failures import StageFailure
from manipose_mj.policies.protocol import Decision, Policy, answered_width, checked_answer
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.task import SUCCESS_HELD

ROUNDING = 1e-6  # beyond a limit that counts as at it: policies compute in float32

Observe = Callable[[Mapping[str, np.ndarray]], Mapping[str, Any]]


@dataclass(frozen=True)
class Rules:
    """How a policy's actions are carried out; attributes as in `PolicySettings`, and one more.

    Attributes: begun: whether the policy has played before; a first answer of another width is a failure then.
    """

    hz: float = CONTROL_HZ
    execute: int | None = None
    stop: Stop = "horizon"
    begun: bool = False


@dataclass
class Outcome:
    """What an episode came to.

    Attributes:
      steps: Control steps taken.
      decisions: Times the policy was asked.
      clipped: Actions with a number beyond its limit.
      policy_s: Wall time in the policy [s].
      failure: Why it ended before it was done; None otherwise.
    """

    steps: int = 0
    decisions: int = 0
    clipped: int = 0
    policy_s: float = 0.0
    failure: StageFailure | None = None


class Rollout:
    """Runs one episode of an environment that was reset, by a policy that was told of it."""

    def __init__(
        self,
        environment: TaskEnvironment,
        policy: Policy,
        rules: Rules,
        *,
        observe: Observe,
        translate: Callable[[np.ndarray], np.ndarray] = np.asarray,
        after_decision: Callable[[], None] = lambda: None,
        after_step: Callable[[int], None] = lambda steps: None,
    ) -> None:
        """Prepares.

        Args:
          environment: After its reset.
          policy: After its reset.
          rules: Rates and when to stop.
          observe: Makes the policy's observation of the environment's.
          translate: Makes the environment's actions of the policy's, `(t, n)`.
          after_decision: Called when the policy has answered or given up.
          after_step: Called with the number of control steps.
        """
        self._environment, self._policy, self._rules = environment, policy, rules
        self._observe, self._translate = observe, translate
        self._after_decision, self._after_step = after_decision, after_step
        spec = environment.action_spec()
        self._low, self._high = np.asarray(spec.minimum), np.asarray(spec.maximum)
        self._timestep = environment.task.control_timestep
        self._actions = self._held = 0
        self._stop_after = round(SUCCESS_HELD / self._timestep)
        self.outcome = Outcome()

    def run(self, first: dm_env.TimeStep) -> Outcome:
        """From the first time step to the end.

        Raises:
          InputError: The policy's actions are those of another control mode.
          ServerLostError: Its server went away.
        """
        step = first
        try:
            while True:
                decision = self._decide(step)
                # Nobody is asked after the last answer: all of it is carried out.
                count = None if decision.done else self._rules.execute
                actions = self._translate(decision.actions)[:count]
                for number, action in enumerate(actions, start=1):
                    following = self._carry_out(action, observe=number == len(actions))
                    if following is None:
                        return self.outcome
                    step = following
                if decision.done:
                    return self.outcome
        except StageFailure as failure:
            self.outcome.failure = failure
            return self.outcome

    def _decide(self, step: dm_env.TimeStep) -> Decision:
        outcome, size = self.outcome, len(self._low)
        observation = self._observe(step.observation)
        start = time.perf_counter()
        try:
            try:
                answer = self._policy.infer(observation)
            finally:  # a policy that gives up has taken its time as well
                outcome.policy_s += time.perf_counter() - start
            outcome.decisions += 1
            width = answered_width(answer)
            first = outcome.decisions == 1 and not self._rules.begun
            if first and width is not None and width != size:
                mode = self._environment.task.control_mode.name
                raise InputError(
                    f"the policy's actions have {width} numbers; {mode} takes {size}: choose "
                    "its --control-mode"
                )
            return checked_answer(answer, size)
        finally:
            self._after_decision()

    def _carry_out(
        self, action: Float[np.ndarray, "n"], *, observe: bool
    ) -> dm_env.TimeStep | None:
        """The time step after an action was held for its time; None where the episode has ended.

        Args:
          action: Not clipped yet.
          observe: Whether the policy decides next.
        """
        bounded = np.clip(action, self._low, self._high)
        self.outcome.clipped += bool(np.abs(bounded - action).max() > ROUNDING)
        target: Any = bounded
        step = None
        hold = self._next_hold()
        for held in range(1, hold + 1):
            step = self._environment.step(target, observe=observe and held == hold)
            target = None  # the servos go on to where the action sent them
            self.outcome.steps += 1
            self._after_step(self.outcome.steps)
            if self._ended(step):
                return None
        return step

    def _next_hold(self) -> int:
        """Control steps of the next action; rates that do not divide ours take turns."""
        per_action = 1 / (self._rules.hz * self._timestep)
        first = round(self._actions * per_action)
        self._actions += 1
        return round(self._actions * per_action) - first

    def _ended(self, step: dm_env.TimeStep) -> bool:
        environment, task = self._environment, self._environment.task
        if step.last():
            failure = StageFailure("timeout", f"not done after {task.config.horizon:.0f} s")
            if environment.failure:
                failure = StageFailure("physics", environment.failure_reason)
            self.outcome.failure = failure
            return True
        self._held = self._held + 1 if task.success_now else 0
        return self._rules.stop == "success" and self._held >= self._stop_after
