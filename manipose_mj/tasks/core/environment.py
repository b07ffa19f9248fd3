"""The environment of a task: composer's, that survives a diverging simulation and can be pickled."""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable
from typing import Any

import dm_env
import mujoco
import numpy as np
from dm_control import composer
from dm_control.rl.control import PhysicsError

from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.task import ManipulationTask

log = logging.getLogger(__name__)

_STARTS = 5  # of one episode, before a reset gives up


class TaskEnvironment(composer.Environment):
    """Runs a task; a diverging simulation ends the episode instead of raising.

    Such a step is the episode's last, with reward and discount 0 and the last observation that was
    one; `failure` is then `"physics"`. The next reset starts from the model's own state, so nothing
    of it remains.

    A pickled environment is rebuilt where it is loaded, with the random state it had: its next
    episode is the one that the original would have had next.

    Attributes:
      failure: `"physics"` when the simulation of this episode diverged, else empty.
      failure_reason: One line on it.
    """

    def __init__(
        self,
        task: ManipulationTask,
        *,
        rebuild: Callable[[], dm_env.Environment],
        **arguments: Any,
    ) -> None:
        """Compiles the task.

        Args:
          task: What to run.
          rebuild: Builds an environment like this one; must survive pickling.
          **arguments: Of `composer.Environment`.
        """
        self.failure = self.failure_reason = ""
        self._rebuild = rebuild
        self._last_observation: Any = None
        task.add_sensors()
        super().__init__(task, **arguments)

    def reset(self, spec: EpisodeSpec | None = None) -> dm_env.TimeStep:
        """Start an episode.

        A start whose simulation diverges is followed by another; the random state goes on from there.

        Args:
          spec: What the episode shall be; None: the next one that the random state gives.

        Raises:
          InputError: What `spec` asks for cannot be.
          PhysicsError: None of a few starts came to rest.
        """
        self.task.spec = spec = spec or EpisodeSpec()
        if spec.seed is not None:
            self.random_state.seed(spec.seed)
        self.failure = self.failure_reason = ""
        for attempt in range(1, _STARTS + 1):
            try:
                with self._physics.check_invalid_state():
                    return self._kept(super().reset())
            except PhysicsError as error:
                if attempt == _STARTS:
                    raise
                log.warning("drawing another start: %s", str(error).splitlines()[0])
        raise AssertionError

    def step(self, action: Any) -> dm_env.TimeStep:
        """Go on by one control step; after an episode's end, or before the first, reset."""
        try:
            # Asked once a control step: asking at every physics step takes as long as a step.
            with self._physics.check_invalid_state():
                return self._kept(super().step(action))
        except PhysicsError as error:
            self.failure, self.failure_reason = "physics", str(error).splitlines()[0]
            self._reset_next_step = True
            observation = copy.deepcopy(self._last_observation)
            return dm_env.TimeStep(dm_env.StepType.LAST, 0.0, 0.0, observation)

    def _substep(self, action: Any) -> None:
        self._hooks.before_substep(self._physics_proxy, action, self._random_state)
        model, data = self._physics.model.ptr, self._physics.data.ptr
        # The second half of a step, then the first of the next, as dm_control's own steps.
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)
        self._hooks.after_substep(self._physics_proxy, self._random_state)

    def close(self) -> None:
        """Free the simulation; closing twice is no mistake."""
        if self._physics is not None:
            self.task.close()
            super().close()

    def _kept(self, step: dm_env.TimeStep) -> dm_env.TimeStep:
        self._last_observation = step.observation
        return step

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self._rebuild, self._random_state.get_state())


def _rebuilt(rebuild: Callable[[], Any], state: Any) -> Any:
    environment = rebuild()
    generator: np.random.RandomState = environment.random_state
    generator.set_state(state)
    return environment
