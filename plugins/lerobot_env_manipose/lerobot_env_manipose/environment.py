"""One environment as LeRobot wants it: its keys, its rate, one sentence for the task, the frozen seeds on request."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from manipose_mj import suite
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol as protocols
from manipose_mj.evaluation.protocol.present_settings import check_settings
from manipose_mj.gym.features import CAMERAS, IMAGE_SIZE, Features, feature_sensors
from manipose_mj.gym.spaces import FAR, action_box
from manipose_mj.mjcf.cameras.pictures import make_painter
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.observations.camera_rig import SENSOR_SHADING

CONTROL_HZ = 50
PICTURE = (96, 128)  # height, width of a film's [pixels]
SUCCESS_HELD = 0.5  # [s], as in `manipose evaluate --stop success`
NEW_ROLLOUT = (
    "lerobot_new_rollout"  # the option by which LeRobot tells its resets from those of Gymnasium
)


class LeRobotEnv(gymnasium.Env[dict[str, Any], np.ndarray]):
    """A task at a policy's rate; targets are held in between.

    `info["is_success"]` is true at the end of an episode whose goal is met then: LeRobot's rate of success at any step
    is the rate of success at the end of `manipose evaluate`.

    Attributes:
      task: `"domain/name"`.
      task_description: The instruction of this episode.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        task: str,
        *,
        obs_mode: str = "state+pose",
        control_mode: str = "pd_joint_pos",
        hz: int = 10,
        protocol: str = "",
        first: int = 0,
        stride: int = 1,
        objects: tuple[str, ...] | None = None,
        render_mode: str = "rgb_array",
    ) -> None:
        """Compiles the task.

        Args:
          task: `"domain/name"`.
          obs_mode: `state` with `pose`, `rgb` or both.
          control_mode: What actions mean.
          hz: Steps a second; divides 50.
          protocol: Version whose frozen episodes are played, one after the other, whatever the seeds; empty: none.
          first: Of them that this environment plays.
          stride: To its next; the number of environments at once.
          objects: What to draw from instead of the built-in objects; not with a protocol, which has its own.
          render_mode: `"rgb_array"`.

        Raises:
          InputError: A name is unknown, the rate cannot be, or the task is not as the protocol fixes it.
        """
        if hz < 1 or CONTROL_HZ % hz:
            raise InputError(f"hz is {hz}; expected a divisor of {CONTROL_HZ}")
        self._frozen = protocols.load(protocol) if protocol else None
        if self._frozen is not None and objects:
            raise InputError(
                f"objects are {', '.join(objects)}; protocol {protocol} has its own: leave out one of both"
            )
        if self._frozen is not None and self._frozen.sources:
            raise InputError(
                f"protocol {protocol} takes assets that users build; "
                f"`manipose evaluate --protocol {protocol} --assets DIR` plays it"
            )
        split = "test" if protocol else "train"
        config = EnvConfig(
            task,
            obs_mode=obs_mode,
            control_mode=control_mode,
            objects=objects or None,
            split=split,
            sensors=feature_sensors(obs_mode),
        )
        if self._frozen is not None:
            check_settings(self._frozen, config)
        self.task, self.task_description = task, ""
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": hz}
        self._environment: Any = suite.make(config, 0)
        self._features = Features(self._environment)
        self._painter: tuple[Any, Any] = (None, None)  # the model, and what draws it
        self._hold = CONTROL_HZ // hz
        self._held_steps = round(SUCCESS_HELD * CONTROL_HZ)
        self._number, self._stride = first, stride
        self._max_episode_steps = int(np.ceil(self._environment.task.config.horizon * hz))
        self.action_space = action_box(self._environment.action_spec())
        self.observation_space = self._space()
        self._met = 0

    def _space(self) -> spaces.Dict:
        found: dict[str, spaces.Space[Any]] = {}
        for name in ("agent_pos", "environment_state"):
            if name in self._features.specs:
                shape = self._features.specs[name].shape
                found[name] = spaces.Box(-FAR, FAR, shape, np.float32)
        pictures = {
            name: spaces.Box(0, 255, (IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8)
            for name in CAMERAS
            if f"pixels/{name}" in self._features.specs
        }
        return spaces.Dict({**found, **({"pixels": spaces.Dict(pictures)} if pictures else {})})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start an episode: the seed's, or the protocol's next.

        Args:
          seed: Of the episode; not used with a protocol.
          options: With LeRobot's mark of a new rollout, the protocol goes on; Gymnasium's own resets, after an
            episode's end, play no episode that counts.
        """
        super().reset(seed=seed)
        spec = EpisodeSpec(seed)
        if self._frozen is not None:
            total = len(self._frozen.task(self.task).episodes)
            asked = self._frozen.episode(self.task, self._number % total).asked
            spec = EpisodeSpec(**asked)
            self._number += self._stride if (options or {}).get(NEW_ROLLOUT) else 0
        step = self._environment.reset(spec)
        self.task_description = self._features.instruction
        self._met = 0
        return self._observed(step), {"is_success": False}

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Hold a target for a period; the episode ends once the goal has held for half a second."""
        spec = self._environment.action_spec()
        target: Any = np.clip(np.asarray(action, float), spec.minimum, spec.maximum)
        terminated = truncated = False
        for held in range(1, self._hold + 1):
            step = self._environment.step(target, observe=held == self._hold)
            target = None
            self._met = self._met + 1 if self._environment.task.success_now else 0
            terminated = self._met >= self._held_steps or bool(self._environment.failure)
            truncated = bool(step.last()) and not terminated
            if terminated or truncated:
                break
        met = bool(self._environment.task.success_now) and not self._environment.failure
        info = {"is_success": met and (terminated or truncated)}
        return self._observed(step), float(met), terminated, truncated, info

    def _observed(self, step: Any) -> dict[str, Any]:
        features = self._features.read(step.observation)
        found = {name: features[name] for name in self.observation_space if name != "pixels"}
        pictures = {n: features[f"pixels/{n}"] for n in CAMERAS if f"pixels/{n}" in features}
        return {**found, "pixels": pictures} if pictures else found

    def render(self) -> np.ndarray | None:
        """A picture of the scene, which LeRobot asks for in every step: small, and quick by rays."""
        model, data = self._environment.physics.model.ptr, self._environment.physics.data.ptr
        if self._painter[0] is not model:
            drawing = make_painter(model, *PICTURE, engine="ray", shading=SENSOR_SHADING)
            self._painter = (model, drawing)
        return self._painter[1].paint(data, "overview")

    def close(self) -> None:
        """Free the simulation."""
        self._painter = (None, None)
        self._environment.close()
