"""What `--env.type=manipose` takes, and the environments it makes."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import gymnasium
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.envs.utils import freeze_after_episode_end
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STATE

from lerobot_env_manipose.environment import LeRobotEnv


@EnvConfig.register_subclass("manipose")
@dataclass
class ManiPoseEnvConfig(EnvConfig):
    """A task of ManiPose-MJ.

    Attributes:
      task: `"domain/name"`, as `manipose list` names it.
      fps: Steps a second; divides 50.
      obs_mode: `state` with `pose`, `rgb` or both.
      control_mode: What actions mean.
      protocol: Version whose frozen episodes are played, from the first on, such as `v1`; empty: those of LeRobot's
        seeds, on training objects.
      objects: What to draw from instead of the built-in objects; not with a protocol.
      render_mode: `"rgb_array"`.
    """

    task: str | None = "single_object/target_pose"
    fps: int = 10
    obs_mode: str = "state+pose"
    control_mode: str = "pd_joint_pos"
    protocol: str = ""
    objects: tuple[str, ...] = ()
    render_mode: str = "rgb_array"
    features: dict[str, PolicyFeature] = field(default_factory=dict)
    features_map: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Reads the features off the environment."""
        made = self._one()
        try:
            self._describe(made)
        finally:
            made.close()

    def _describe(self, made: LeRobotEnv) -> None:
        def add(name: str, kind: FeatureType, shape: tuple[int, ...], key: str) -> None:
            self.features[name] = PolicyFeature(type=kind, shape=shape)
            self.features_map[name] = key

        add(ACTION, FeatureType.ACTION, made.action_space.shape or (), ACTION)
        for name, space in made.observation_space.items():
            if name == "agent_pos":
                add(name, FeatureType.STATE, space.shape or (), OBS_STATE)
            elif name == "environment_state":
                add(name, FeatureType.ENV, space.shape or (), OBS_ENV_STATE)
            else:
                for camera, picture in space.items():
                    key = f"{OBS_IMAGES}.{camera}"
                    add(f"pixels/{camera}", FeatureType.VISUAL, picture.shape, key)

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Of `LeRobotEnv`."""
        return {
            "obs_mode": self.obs_mode,
            "control_mode": self.control_mode,
            "hz": self.fps,
            "protocol": self.protocol,
            "objects": tuple(self.objects),
            "render_mode": self.render_mode,
        }

    def _one(self, first: int = 0, stride: int = 1) -> LeRobotEnv:
        assert self.task is not None
        return LeRobotEnv(self.task, first=first, stride=stride, **self.gym_kwargs)

    def create_envs(
        self, n_envs: int, use_async_envs: bool = False
    ) -> dict[str, dict[int, gymnasium.vector.VectorEnv]]:
        """`{suite: {task_id: environments}}`, with frozen episodes shared out among the environments."""
        # An environment whose episode has ended waits for the others.
        makers = [
            freeze_after_episode_end(partial(self._one, first, n_envs)) for first in range(n_envs)
        ]
        mode = gymnasium.vector.AutoresetMode.SAME_STEP
        if use_async_envs and n_envs > 1:
            many = gymnasium.vector.AsyncVectorEnv(
                makers, autoreset_mode=mode, context="forkserver"
            )
        else:
            many = gymnasium.vector.SyncVectorEnv(makers, autoreset_mode=mode)
        return {self.type: {0: many}}
