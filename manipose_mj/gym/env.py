"""One environment class for every task: Gymnasium's interface over the dm_env environment."""

from __future__ import annotations

from typing import Any, Unpack

import gymnasium
import numpy as np
from dm_env import TimeStep
from gymnasium.error import ResetNeeded

from manipose_mj import suite
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.gym.spaces import action_box, observation_space
from manipose_mj.gym.view import View
from manipose_mj.tasks.core.config import EnvConfig, EnvOptions, EpisodeSpec
from manipose_mj.tasks.core.registry import TaskSpec, named_task
from manipose_mj.tasks.goals import Goal, success
from manipose_mj.tasks.scene.state import SceneState

Observation = dict[str, np.ndarray]
_SEEDS = 2**32
RESET_OPTIONS = ("object", "furniture", "part")


class ManiPoseEnv(gymnasium.Env[Any, np.ndarray]):
    """A task of this package, or one registered with `manipose_mj.register_task`.

    Observations are a flat dictionary. An episode is truncated at the task's horizon and terminated only
    when the simulation diverges: success ends nothing, for an object may still roll away.

    `info` holds `success` (all goals are met now), `success_once` (they were, at some step of this
    episode), `failure` (`"physics"` after a divergence, else empty) and, for tasks with goal poses,
    `goal_error`: the largest translation [m] and rotation [rad] that is left, `(2,)`.

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
        **config: Unpack[EnvOptions],
    ) -> None:
        """Compiles the task.

        Args:
          task: `"domain/name"`.
          render_mode: `"rgb_array"`, `"human"` for a window, or None.
          camera: That `render` looks through.
          height: Of a rendered picture [pixels].
          width: Of a rendered picture [pixels].
          **config: Fields of `manipose_mj.tasks.EnvConfig`: `obs_mode`, `control_mode`, `reward_mode`,
            `objects`, `split`, `randomisation`, `sensors`.

        Raises:
          InputError: A mode, a name or an object cannot be used.
        """
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise unknown_name("render mode", render_mode, self.metadata["render_modes"])
        spec = task if isinstance(task, TaskSpec) else named_task(task)
        # The specification, not its name: a process that loads a pickled environment registers the task.
        rendering = {"render_mode": render_mode, "camera": camera, "height": height, "width": width}
        self._arguments: dict[str, Any] = {"task": spec, **rendering, **config}
        self.render_mode = render_mode
        self.environment = suite.make(EnvConfig(spec.full_name, **config))
        self.observation_space = observation_space(self.environment.observation_spec())
        self.action_space = action_box(self.environment.action_spec())
        self._view = View(render_mode, camera, height, width)
        self._running = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode.

        Args:
          seed: Determines this episode and those that follow without a seed, bit for bit; the same as
            `suite.load`'s.
          options: `"object"`, `"furniture"` and `"part"`: names of the rigid object, the piece of furniture and
            its drawer or door that the episode shall be about.

        Raises:
          InputError: The seed is no 32-bit number, an option is unknown, or no object has that name.
        """
        for name in options or {}:
            if name not in RESET_OPTIONS:
                raise unknown_name("reset option", name, RESET_OPTIONS)
        if seed is not None and not 0 <= seed < _SEEDS:
            raise InputError(f"seed is {seed}; expected 0 to {_SEEDS - 1}")
        super().reset(seed=seed)
        step = self.environment.reset(EpisodeSpec(seed, **(options or {})))
        self._running = True
        self._show()
        return _copied(step), self._info()

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Go on by one control step.

        Raises:
          ResetNeeded: The episode is over, or none was started.
          InputError: The action has another shape, or holds a value that is no finite number.
        """
        if not self._running:
            raise ResetNeeded("the episode is over, or none was started: call reset first")
        step = self.environment.step(action)
        terminated = step.last() and step.discount == 0.0
        self._running = not step.last()
        self._show()
        return (
            _copied(step),
            float(step.reward),
            terminated,
            step.last() and not terminated,
            self._info(),
        )

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The picture, `(height, width, 3)` bytes, in mode `"rgb_array"`; None in the others."""
        return self._view.render(self.environment.physics)

    def close(self) -> None:
        """Free the simulation and the window; closing twice is no mistake."""
        self._view.close()
        self.environment.close()

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
          goals: Instead of this episode's: for relabelling with goals that were reached.
        """
        tolerance = self.environment.task.config.tolerance
        return bool(success(goals or self.goals, state, tolerance))

    def reward_of(self, state: SceneState, goals: tuple[Goal, ...] | None = None) -> float:
        """The reward, of this environment's mode, that a state gives; arguments as for `is_success`."""
        return self.environment.task.reward_of(state, goals or self.goals)

    def _show(self) -> None:
        if self.render_mode == "human":
            self._view.render(self.environment.physics)

    def _info(self) -> dict[str, Any]:
        task = self.environment.task
        info = {
            "success": bool(task.success_now),
            "success_once": bool(task.success_once),
            "failure": self.environment.failure,
        }
        error = task.goal_error(self.environment.physics)
        if error is not None:
            info["goal_error"] = np.array(error)
        return info

    def __reduce__(self) -> tuple[Any, ...]:
        state = self.environment.random_state.get_state()
        return _rebuilt, (self._arguments, self.spec, state)


def _rebuilt(arguments: dict[str, Any], spec: Any, state: Any) -> ManiPoseEnv:
    env = ManiPoseEnv(**arguments)
    env.spec = spec
    env.environment.random_state.set_state(state)
    return env


def _copied(step: TimeStep) -> Observation:
    """The observation as arrays that no later step changes."""
    return {name: np.array(value) for name, value in step.observation.items()}
