"""One environment class for every task: Gymnasium's interface over the dm_env environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Unpack

import gymnasium
import numpy as np
from dm_env import TimeStep
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.wrappers.utils import rescale_box

from manipose_mj import suite
from manipose_mj.actions import checked_action
from manipose_mj.errors import InputError, brief, unknown_name
from manipose_mj.gym.spaces import action_box, observation_space
from manipose_mj.gym.view import View
from manipose_mj.tasks.core.config import PRIMITIVE, EnvOptions, EpisodeSpec, check_seed, env_config
from manipose_mj.tasks.core.registry import TaskSpec, named_task
from manipose_mj.tasks.goals import Goal, success
from manipose_mj.tasks.instructions.sentence import instruction
from manipose_mj.tasks.scene.state import SceneState

Observation = dict[str, np.ndarray]
RESET_OPTIONS = ("object", "furniture", "part", "goal", "start_index")
_ignored: set[str] = set()  # reset options that were warned of


class ManiPoseEnv(gymnasium.Env[Any, np.ndarray]):
    """A task of this package, or one registered with `manipose_mj.register_task`.

    Observations are a flat dictionary. An episode is truncated at the task's horizon and terminated only
    when the simulation diverges: success ends nothing, for an object may still roll away, unless asked for.

    `info` holds `success` and `is_success` (all goals are met now), `success_once` (they were, at some step of this
    episode), `failure` (`"physics"` after a divergence, else empty) and, for tasks with goal poses,
    `goal_error`: the largest translation [m] and rotation [rad] that is left, `(2,)`; NaN once the simulation has failed.

    A pickled environment is built anew from its arguments, with the random state it had.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}

    def __init__(
        self,
        task: str | TaskSpec,
        *,
        render_mode: str | None = None,
        camera: str = "overview",
        height: int = 480,
        width: int = 640,
        terminate_on_success: bool = False,
        normalise_actions: bool = False,
        **config: Unpack[EnvOptions],
    ) -> None:
        """Compiles the task.

        Args:
          task: `"domain/name"`.
          render_mode: `"rgb_array"`, `"human"` for a window, or None.
          camera: That `render` looks through.
          height: Of a rendered picture [pixels].
          width: Of a rendered picture [pixels].
          terminate_on_success: End an episode in the step in which all goals are met.
          normalise_actions: Take actions in [-1, 1], by the map of `gymnasium.wrappers.RescaleAction`.
          **config: Fields of `manipose_mj.tasks.EnvConfig`: `obs_mode`, `control_mode`, `reward_mode`,
            `objects`, `split`, `randomisation`, `sensors`, `latency`.

        Raises:
          InputError: A mode, a name or an object cannot be used.
        """
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise unknown_name("render mode", render_mode, self.metadata["render_modes"])
        if "autoreset_mode" in config:
            raise InputError(
                "autoreset_mode is no option of an environment; with a vectorization_mode it goes into vector_kwargs"
            )
        spec = task if isinstance(task, TaskSpec) else named_task(task)
        # The specification, not its name: a process that loads a pickled environment registers the task.
        own = {"render_mode": render_mode, "camera": camera, "height": height, "width": width}
        own |= {
            "terminate_on_success": terminate_on_success,
            "normalise_actions": normalise_actions,
        }
        self._arguments: dict[str, Any] = {"task": spec, **own, **config}
        self.render_mode = render_mode
        asked = env_config(spec.full_name, config, others=own)
        self.environment = suite.make(asked)
        self._primitive = (
            asked.control_mode == PRIMITIVE
        )  # the task's own mode is then that of its motions
        self.observation_space = observation_space(self.environment.observation_spec())
        self.action_space = action_box(self.environment.action_spec())
        self._unscaled: Callable[[np.ndarray], np.ndarray] | None = None
        if normalise_actions:
            low, high = np.float32(-1), np.float32(1)
            self.action_space, _, self._unscaled = rescale_box(self.action_space, low, high)
        self._terminate_on_success = terminate_on_success
        self._view = View(render_mode, camera, height, width)
        self._view.check(self.environment.physics)
        self._running = self._closed = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode.

        Args:
          seed: Determines this episode and those that follow without a seed, bit for bit; the same as
            `suite.load`'s.
          options: `"object"`, `"furniture"` and `"part"`: names of the rigid object, the piece of furniture and
            its drawer or door that the episode shall be about; `"goal"`: `T_world_label` that the object shall have
            in the end, `(4, 4)`; `"start_index"`: which of the fixed starts, the same for everybody, from 0: start i
            is that of seed i. Others are ignored, with a warning.

        Returns:
          The observation, and the info with the episode's `instruction`.

        Raises:
          ClosedEnvironmentError: It was closed.
          InputError: The seed is no 32-bit number, the task takes no such goal, or has nothing of that name.
        """
        self._require_open()
        self._running = False  # until the reset has succeeded
        spec = _episode(seed, options or {})
        super().reset(seed=None if seed is None else int(seed))  # NumPy's numbers too
        step = self.environment.reset(spec)
        self._running = True
        self._show()
        return _copied(step), {**self._info(), "instruction": self.instruction}

    @property
    def instruction(self) -> str:
        """One sentence that names object, part and goal of this episode."""
        return instruction(self.environment.task)

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Go on by one control step.

        Raises:
          ClosedEnvironmentError: The environment was closed.
          ResetNeeded: The episode is over, or none was started.
          InputError: The action has another shape, or holds a value that is no finite number.
        """
        self._require_open()
        if not self._running:
            raise ResetNeeded("the episode is over, or none was started: call reset first")
        mode = PRIMITIVE if self._primitive else self.environment.task.control_mode.name
        action = checked_action(mode, self.environment.action_spec().shape, action)
        if self._unscaled is not None:
            action = self._unscaled(action)
        step = self.environment.step(action)
        terminated = step.last() and step.discount == 0.0
        if self._terminate_on_success and self.environment.task.success_now:
            terminated = True
        truncated = step.last() and not terminated
        self._running = not (terminated or truncated)
        self._show()
        return _copied(step), float(step.reward), terminated, truncated, self._info()

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The picture, `(height, width, 3)` bytes, in mode `"rgb_array"`; None in the others.

        Raises:
          ClosedEnvironmentError: The environment was closed.
        """
        self._require_open()
        return self._view.render(self.environment.physics)

    def close(self) -> None:
        """Free the simulation and the window; closing twice is no mistake."""
        self._closed = True
        self._view.close()
        self.environment.close()

    def _require_open(self) -> None:
        if self._closed:
            raise ClosedEnvironmentError("the environment was closed: make another one")

    # Success as a function of a state, as in Gymnasium-Robotics' GoalEnv.

    @property
    def goals(self) -> tuple[Goal, ...]:
        """What this episode wants, all of it."""
        return self.environment.task.goals

    def scene_state(self) -> SceneState:
        """The state now, that success and reward are functions of; a copy."""
        return self.environment.task.scene_state(self.environment.physics)

    def is_success(self, state: SceneState, goals: tuple[Goal, ...] | None = None) -> bool:
        """Whether a state meets the goals.

        Args:
          state: Of this task's scene, of any episode.
          goals: Instead of this episode's: for relabelling with goals that were reached; at least one.

        Raises:
          InputError: `goals` is no tuple of goals, or an empty one.
        """
        tolerance = self.environment.task.config.tolerance
        return bool(success(self._goals(goals), state, tolerance))

    def reward_of(self, state: SceneState, goals: tuple[Goal, ...] | None = None) -> float:
        """The reward, of this environment's mode, that a state gives; arguments as for `is_success`."""
        return self.environment.task.reward_of(state, self._goals(goals))

    def _goals(self, goals: Any) -> tuple[Goal, ...]:
        """This episode's goals, or those that are to take their place."""
        if goals is None:
            return self.goals
        several = isinstance(goals, tuple | list) and len(goals) > 0
        if not several or not all(isinstance(goal, Goal) for goal in goals):
            raise InputError(f"goals is {brief(goals)}; expected a tuple of goals, at least one")
        return tuple(goals)

    def _show(self) -> None:
        if self.render_mode == "human":
            self._view.render(self.environment.physics)

    def _info(self) -> dict[str, Any]:
        task = self.environment.task
        info = {
            "success": bool(task.success_now),
            "is_success": bool(task.success_now),
            "success_once": bool(task.success_once),
            "failure": self.environment.failure,
        }
        error = task.goal_error(self.environment.physics)
        if error is not None:
            failed = self.environment.failure != ""
            info["goal_error"] = np.full(2, np.nan) if failed else np.array(error)
        return info

    def __reduce__(self) -> tuple[Any, ...]:
        state = self.environment.random_state.get_state()
        return _rebuilt, (self._arguments, self.spec, state)


def _episode(seed: int | None, options: dict[str, Any]) -> EpisodeSpec:
    """What a reset asks for.

    Raises:
      InputError: A seed or start index is no 32-bit number, the goal is no pose, a name is no text, or the options
        are no mapping.
    """
    if not isinstance(options, Mapping):
        raise InputError(f"reset options are {options!r}; expected a mapping of names")
    asked = {name: options[name] for name in RESET_OPTIONS if options.get(name) is not None}
    for name in options.keys() - RESET_OPTIONS - _ignored:
        _ignored.add(name)
        gymnasium.logger.warn(
            f"reset option {name!r} is unknown and ignored; known: {', '.join(RESET_OPTIONS)}"
        )
    index = asked.pop("start_index", None)
    if index is not None:
        check_seed(index, "start_index")
    return EpisodeSpec(seed if index is None else int(index), **asked)


def _rebuilt(arguments: dict[str, Any], spec: Any, state: Any) -> ManiPoseEnv:
    env = ManiPoseEnv(**arguments)
    env.spec = spec
    env.environment.random_state.set_state(state)
    return env


def _copied(step: TimeStep) -> Observation:
    """The observation as arrays that no later step changes."""
    return {name: np.array(value) for name, value in step.observation.items()}
