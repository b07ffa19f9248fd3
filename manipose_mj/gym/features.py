"""What learners see: one definition of features for evaluations of policies, data sets and plug-ins.

| feature | content |
|---|---|
| `agent_pos` | `(17,)`: 7 joint angles [rad], opening [m], the TCP in the robot's frame: position [m] and the first two columns of its rotation |
| `environment_state` | poses of objects, handles, joints and goals in the robot's frame, 9 numbers each as the TCP's; which of a goal's translation and rotation count; joint positions. Of one length for a task; zeros for what an episode lacks |
| `pixels/front`, `pixels/wrist` | `(224, 224, 3)` bytes |
| `instruction` | one sentence of this episode |

All other observations of the environment stay as they are, under their names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from dm_control import composer
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from manipose_mj.tasks.instructions.sentence import instruction
from manipose_mj.tasks.observations.sensor_config import SensorConfig
from manipose_mj.tasks.observations.sensors import parse_modes

IMAGE_SIZE = 224
# Names of cameras: as features, and in a scene.
CAMERAS = {"front": "front", "wrist": "panda/wrist"}
_JOINTS, _OPENING, _TCP = "panda/joint_positions", "panda/gripper_opening", "panda/tcp_pose"
_POSE, _COUNTS, _JOINT = "pose/robot/", "pose/counts/", "pose/opening"
_IMAGES = ("rgb", "depth", "segmentation")
_COLUMNS = ("x", "y", "z", "r11", "r21", "r31", "r12", "r22", "r32")
AGENT_NAMES = (
    *(f"joint{i}" for i in range(1, 8)),
    "opening",
    *(f"tcp_{name}" for name in _COLUMNS),
)


@dataclass(frozen=True)
class Feature:
    """Attributes: shape; dtype, as NumPy names it; names: of its numbers, where they have some."""

    shape: tuple[int, ...]
    dtype: str
    names: tuple[str, ...] = ()


def feature_sensors(obs_mode: str) -> SensorConfig:
    """The sensors whose images features are made of.

    Args:
      obs_mode: Modes and keys joined by `+`.

    Raises:
      InputError: A mode is unknown.
    """
    modes = {part.split("/")[0] for part in parse_modes(obs_mode)}
    if modes.isdisjoint((*_IMAGES, "pointcloud")):
        return SensorConfig(cameras=())
    cameras = tuple(CAMERAS.values())
    if "pointcloud" in modes:
        # From three sides, as in all our environments.
        cameras = ("front", "left", "right", *(cameras[1:] if modes & {*_IMAGES} else ()))
    if modes.isdisjoint(_IMAGES):
        return SensorConfig(cameras=cameras)
    return SensorConfig(cameras=cameras, height=IMAGE_SIZE, width=IMAGE_SIZE)


class Features:
    """Makes features of the observations of one environment.

    Attributes:
      specs: Of every feature but `instruction`, by name; those that the environment's observation mode allows.
    """

    def __init__(self, environment: composer.Environment) -> None:
        """Lays out the features.

        Args:
          environment: Of one of this package's tasks; features speak of its present episode.
        """
        self._environment = environment
        spec = environment.observation_spec()
        self._renamed = {
            f"rgb/{camera}": f"pixels/{name}"
            for name, camera in CAMERAS.items()
            if f"rgb/{camera}" in spec
        }
        self._has_agent = {_JOINTS, _OPENING, _TCP} <= spec.keys()
        self._poses = [key for key in spec if key.startswith(_POSE)]
        self._counts = [key for key in spec if key.startswith(_COUNTS)] if self._poses else []
        self._openings = [key for key in spec if key.startswith(_JOINT)] if self._poses else []
        self.specs: dict[str, Feature] = {}
        if self._has_agent:
            self.specs["agent_pos"] = Feature((len(AGENT_NAMES),), "float32", AGENT_NAMES)
        if self._poses:
            names = self._state_names()
            self.specs["environment_state"] = Feature((len(names),), "float32", names)
        for key, each in spec.items():
            self.specs[self._renamed.get(key) or key] = Feature(
                tuple(each.shape), np.dtype(each.dtype).name
            )
        self._sentence: tuple[object, str] = (None, "")

    def _state_names(self) -> tuple[str, ...]:
        names = [f"{key.removeprefix(_POSE)}.{c}" for key in self._poses for c in _COLUMNS]
        for key in self._counts:
            goal = key.removeprefix(_COUNTS)
            names += [f"{goal}.translation_counts", f"{goal}.rotation_counts"]
        return (*names, *(key.removeprefix("pose/") for key in self._openings))

    @property
    def instruction(self) -> str:
        """Of the present episode."""
        task = self._environment.task
        start = task.start
        if self._sentence[0] is not start:
            self._sentence = (start, instruction(task))
        return self._sentence[1]

    def read(self, observation: Mapping[str, np.ndarray]) -> dict[str, Any]:
        """The features of an observation, arrays that no later step changes.

        Args:
          observation: Of the environment's present.
        """
        features: dict[str, Any] = {}
        if self._has_agent:
            features["agent_pos"] = _agent_pos(observation)
        if self._poses:
            features["environment_state"] = self._environment_state(observation)
        for key, value in observation.items():
            features[self._renamed.get(key, key)] = np.array(value)
        features["instruction"] = self.instruction
        return features

    def _environment_state(self, observation: Mapping[str, np.ndarray]) -> Float[np.ndarray, "n"]:
        poses = [pose_columns(observation[key]) for key in self._poses]
        rest = [np.ravel(observation[key]) for key in (*self._counts, *self._openings)]
        return np.concatenate([*poses, *rest]).astype(np.float32)


def pose_columns(pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "9"]:
    """Position, then the first two columns of the rotation (Zhou et al., On the continuity of rotation representations)."""
    return np.concatenate([pose[:3, 3], pose[:3, 0], pose[:3, 1]])


def _agent_pos(observation: Mapping[str, np.ndarray]) -> Float[np.ndarray, "17"]:
    tcp = np.asarray(observation[_TCP])  # the robot's base is the world's origin
    rotation = Rotation.from_quat(tcp[3:], scalar_first=True).as_matrix()
    arm = (observation[_JOINTS], observation[_OPENING])
    return np.concatenate([*arm, tcp[:3], rotation[:, 0], rotation[:, 1]]).astype(np.float32)
