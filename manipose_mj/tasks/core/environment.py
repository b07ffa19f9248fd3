"""The environment of a task: composer's, with other objects in every episode; it survives a diverging simulation."""

from __future__ import annotations

import copy
import logging
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

import dm_env
import mujoco
import numpy as np
from dm_control import composer
from dm_control.composer.environment import HOOK_NAMES
from dm_control.rl.control import PhysicsError

from manipose_mj.errors import InputError, brief
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.scene_objects import SceneObjects
from manipose_mj.tasks.core.scene_source import SceneSource
from manipose_mj.tasks.core.start import NoStartError
from manipose_mj.tasks.core.task import ManipulationTask

log = logging.getLogger(__name__)

_STARTS = 40  # of one episode, before a reset gives up; for a low drawer twelve were too few
_SCENES_KEPT = 7  # besides the present one


@dataclass
class _Compiled:
    """What composer's environment keeps of one scene."""

    task: ManipulationTask
    physics: Any
    physics_proxy: Any
    hooks: Any
    observation_updater: Any
    never_reset: bool


class TaskEnvironment(composer.Environment):
    """Runs a task; a diverging simulation ends the episode instead of raising.

    Such a step is the episode's last, with reward and discount 0 and the last observation that was
    one; `failure` is then `"physics"`. The next reset starts from the model's own state, so nothing
    of it remains.

    Where the objects differ from episode to episode, so do `task` and `physics`: a scene is compiled for each
    set of objects, and the last few are kept. Specifications are the same for all.

    A pickled environment is rebuilt where it is loaded, with the random state it had: its next
    episode is the one that the original would have had next.

    Attributes:
      failure: `"physics"` when the simulation of this episode diverged, else empty.
      failure_reason: One line on it.
      scene_objects: That the present scene was compiled with; None where all episodes have the same.
    """

    def __init__(
        self,
        scenes: SceneSource,
        *,
        rebuild: Callable[[], dm_env.Environment],
        random_state: int | np.random.RandomState | None = None,
        **arguments: Any,
    ) -> None:
        """Compiles the scene of the episode that comes next, if nothing is asked of it.

        Args:
          scenes: Of the task.
          rebuild: Builds an environment like this one; must survive pickling.
          random_state: Or its seed.
          **arguments: More of `composer.Environment`; the time limit is the task's by default.
        """
        self.failure = self.failure_reason = ""
        self._rebuild = rebuild
        self._last_observation: Any = None
        self._scenes = scenes
        self._kept: OrderedDict[Hashable, _Compiled] = OrderedDict()
        if not isinstance(random_state, np.random.RandomState):
            random_state = np.random.RandomState(random_state)
        looking_ahead = np.random.RandomState()
        looking_ahead.set_state(random_state.get_state())
        self.scene_objects = scenes.draw(looking_ahead, EpisodeSpec())
        task = scenes.build(self.scene_objects)
        task.add_sensors()
        arguments = {"time_limit": task.config.horizon, **arguments}
        super().__init__(task, random_state=random_state, **arguments)

    def reset(self, spec: EpisodeSpec | None = None) -> dm_env.TimeStep:
        """Start an episode.

        A start whose simulation diverges is followed by another, and so are objects with which there is no
        start; the random state goes on from there.

        Args:
          spec: What the episode shall be; None: the next one that the random state gives.

        Raises:
          InputError: What `spec` asks for cannot be.
          PhysicsError: None of a few starts came to rest.
        """
        self._require_open()
        if spec is not None and not isinstance(spec, EpisodeSpec):
            raise InputError(
                f"reset got {brief(spec)}; expected an EpisodeSpec, as EpisodeSpec(seed=0)"
            )
        spec = spec or EpisodeSpec()
        self._reset_next_step = True  # where this fails, the next step begins an episode
        if spec.seed is not None:
            self.random_state.seed(spec.seed)
        self.failure = self.failure_reason = ""
        for attempt in range(1, _STARTS + 1):
            try:
                objects = self._scenes.draw(self.random_state, spec)
                if objects is not None:
                    self.use(objects)
                self.task.spec = spec
                with self._physics.check_invalid_state():
                    return self._remembered(super().reset())
            except PhysicsError as error:
                if attempt == _STARTS:
                    raise
                log.warning("drawing another start: %s", str(error).splitlines()[0])
            except NoStartError as error:
                if attempt == _STARTS or self.scene_objects is None:
                    raise
                log.info("drawing other objects: %s", error)
        raise AssertionError

    def use(self, objects: SceneObjects) -> None:
        """Change to the scene of these objects; compiles it where it is not among the last few."""
        present = self.scene_objects
        assert present is not None, "all episodes of this environment have the same objects"
        if objects.key == present.key:
            return
        known = self._kept.pop(objects.key, None)
        task = self._scenes.build(objects) if known is None else known.task
        self._kept[present.key] = self._compiled()
        task.control_mode = self._task.control_mode  # it may have been changed
        if known is None:
            self._compile(task)
        else:
            self._take(known)
        self.scene_objects = objects
        while len(self._kept) > _SCENES_KEPT:
            _, oldest = self._kept.popitem(last=False)
            oldest.task.close()
            oldest.physics.free()

    def _compile(self, task: ManipulationTask) -> None:
        hooks = self._hooks
        task.add_sensors()
        self._task = task
        self._hooks = type(hooks)(task)
        for name in HOOK_NAMES:
            more = getattr(hooks, f"_{name}").extra_hooks
            getattr(self._hooks, f"_{name}").extra_hooks.extend(more)
        self._physics: Any = None  # that of the scene before is kept, not freed
        self._hooks.initialize_episode_mjcf(self.random_state)
        self._recompile_physics_and_update_observables()
        self._mjcf_never_compiled = False

    def _compiled(self) -> _Compiled:
        return _Compiled(
            self._task,
            self._physics,
            self._physics_proxy,
            self._hooks,
            self._observation_updater,
            self._mjcf_never_compiled,
        )

    def _take(self, scene: _Compiled) -> None:
        self._task = scene.task
        self._physics, self._physics_proxy = scene.physics, scene.physics_proxy
        self._hooks, self._observation_updater = scene.hooks, scene.observation_updater
        if scene.never_reset:  # compiled before hooks could change it
            self._hooks.initialize_episode_mjcf(self.random_state)
            self._recompile_physics_and_update_observables()
        self._mjcf_never_compiled = False

    def step(self, action: Any, *, observe: bool = True) -> dm_env.TimeStep:
        """Go on by one control step; after an episode's end, or before the first, reset.

        Args:
          action: Of the control mode; None: the servos go on as the last action said.
          observe: Whether somebody looks; else the observation is the last one that somebody looked at, and no
            picture is drawn.
        """
        self._require_open()
        if observe or self._reset_next_step:
            return self._stepped(action)
        looking = self._observation_updater
        self._observation_updater: Any = _NotLooking(self._last_observation)
        try:
            return self._stepped(action)
        finally:
            self._observation_updater = looking

    def _stepped(self, action: Any) -> dm_env.TimeStep:
        task: Any = self._task
        before = task.success_once, task.max_penetration
        try:
            # Asked once a control step: asking at every physics step takes as long as a step.
            with self._physics.check_invalid_state():
                return self._remembered(super().step(action))
        except PhysicsError as error:
            self.failure, self.failure_reason = "physics", str(error).splitlines()[0]
            self._reset_next_step = True
            # MuJoCo goes back to a model's own state, where doors are shut and goals may be met.
            task.success_now, (task.success_once, task.max_penetration) = False, before
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
            for scene in self._kept.values():
                scene.task.close()
                scene.physics.free()
            self._kept.clear()
            self.task.close()
            super().close()

    def _require_open(self) -> None:
        if self._physics is None:
            raise InputError("the environment was closed: make another one")

    def go_on(self, observation: Any, failure: str, failure_reason: str) -> None:
        """What a restored episode has been so far: last seen, and how it failed."""
        self._last_observation = observation
        self.failure, self.failure_reason = failure, failure_reason

    def _remembered(self, step: dm_env.TimeStep) -> dm_env.TimeStep:
        self._last_observation = step.observation
        return step

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self._rebuild, self._random_state.get_state())


class _NotLooking:
    """Takes an updater's place in a step that nobody observes; all schedules stand still."""

    def __init__(self, observation: Any) -> None:
        self._observation = observation

    def prepare_for_next_control_step(self) -> None: ...

    def update(self) -> None: ...

    def get_observation(self) -> Any:
        return self._observation


def _rebuilt(rebuild: Callable[[], Any], state: Any) -> Any:
    environment = rebuild()
    generator: np.random.RandomState = environment.random_state
    generator.set_state(state)
    return environment
