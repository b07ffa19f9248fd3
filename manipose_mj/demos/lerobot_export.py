"""Export of demonstrations to a LeRobot data set (v3.0), by LeRobot's own writer."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from manipose_mj.demos.layout import RECORDED_HZ, RECORDED_MODE, DemoSet, read_actions
from manipose_mj.demos.playback import slowed
from manipose_mj.demos.replay import SteppedPolicy
from manipose_mj.errors import InputError, how_to_install
from manipose_mj.evaluation.episode import environment_of
from manipose_mj.evaluation.rollout import Rollout, Rules
from manipose_mj.gym.features import AGENT_NAMES, CAMERAS, IMAGE_SIZE, Features, feature_sensors
from manipose_mj.storage.staging import staging
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

ACTION_NAMES = (*AGENT_NAMES[:7], "opening")
STATE, ENVIRONMENT, IMAGES = (
    "observation.state",
    "observation.environment_state",
    "observation.images",
)


class Writer(Protocol):
    """What is asked of LeRobot's data set."""

    def add_frame(self, frame: dict[str, Any]) -> None: ...

    def save_episode(self) -> None: ...

    def finalize(self) -> None: ...


@dataclass(frozen=True)
class ExportConfig:
    """What to export.

    Attributes:
      out: Folder of the data set; must not exist.
      repo_id: Its name, such as `"me/manipose"`.
      hz: Frames a second, a whole number; targets are held in between.
      obs_mode: `state` with `pose`, `rgb` or both.
    """

    out: Path
    repo_id: str = "manipose/demos"
    hz: int = 10
    obs_mode: str = "state+pose"

    def __post_init__(self) -> None:
        if not 1 <= self.hz <= RECORDED_HZ:
            raise InputError(f"hz is {self.hz}; expected 1 to {RECORDED_HZ}")
        modes = set(self.obs_mode.split("+"))
        if "state" not in modes or not modes <= {"state", "pose", "rgb"} or len(modes) < 2:
            raise InputError(
                f"observation mode {self.obs_mode!r}; expected state+pose, state+rgb or state+pose+rgb"
            )
        if self.out.exists():
            raise InputError(f"{self.out}: is there already; choose another --out")


@dataclass(frozen=True)
class Exported:
    """Attributes: episodes: that were written; lost: recorded successes that were none at this rate; frames."""

    episodes: int = 0
    lost: int = 0
    frames: int = 0


def lerobot_writer(config: ExportConfig, features: dict[str, Any]) -> Writer:
    """A new data set of LeRobot's.

    Raises:
      InputError: LeRobot is not installed.
    """
    try:
        from lerobot.datasets.lerobot_dataset import (  # pyright: ignore[reportMissingImports]
            LeRobotDataset,
        )
    except ImportError as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"the export needs LeRobot ({reason}); {how_to_install('lerobot')}, "
            "with Python 3.12 and in an environment of its own"
        ) from None
    return LeRobotDataset.create(
        repo_id=config.repo_id,
        fps=config.hz,
        features=features,
        root=config.out,
        robot_type="panda",
        use_videos=True,
    )


def export(
    sets: Sequence[DemoSet],
    config: ExportConfig,
    *,
    open_writer: Callable[[ExportConfig, dict[str, Any]], Writer] = lerobot_writer,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Exported:
    """Replay successes at the rate of the data set, and write those that succeed again.

    Args:
      sets: Recorded in `pd_joint_pos`; of one task where their objects' poses are exported.
      config: What to export.
      open_writer: Makes the data set.
      on_progress: Called with the number of episodes done and of all.

    Raises:
      InputError: The sets do not fit one data set, a file is broken, or LeRobot is not installed.
    """
    sources = [(demos, each) for demos in sets for each in demos.episodes if each.success]
    if any(each.control_mode != RECORDED_MODE for _, each in sources):
        raise InputError("these demonstrations were converted; give the file that was recorded")
    environments = [environment_of(_env_config(demos, config)) for demos in sets]
    layouts = [lerobot_features(Features(environment)) for environment in environments]
    if any(layout != layouts[0] for layout in layouts):
        raise InputError(
            "states of these tasks differ in length; export them one by one, or with --obs-mode state+rgb"
        )
    # All, before anything is written: a broken file shall leave no part of a data set behind.
    recorded = [slowed(read_actions(demos, episode), config.hz) for demos, episode in sources]
    written, frames = 0, 0
    with staging(config.out) as aside:  # an export that is interrupted leaves nothing
        built = aside / config.out.name
        writer = open_writer(replace(config, out=built), layouts[0])
        for done, ((demos, episode), actions) in enumerate(
            zip(sources, recorded, strict=True), start=1
        ):
            env_config = _env_config(demos, config)
            seen, success = _replayed(env_config, episode.episode_seed, actions, config)
            if success:
                for observation, action in zip(seen, actions, strict=False):
                    writer.add_frame(frame(observation, action))
                writer.save_episode()
                written, frames = written + 1, frames + min(len(seen), len(actions))
            on_progress(done, len(sources))
        writer.finalize()
        os.rename(built, config.out)
    return Exported(written, len(sources) - written, frames)


def _env_config(demos: DemoSet, config: ExportConfig) -> EnvConfig:
    objects = demos.env_kwargs["objects"]
    return EnvConfig(
        demos.task,
        obs_mode=config.obs_mode,
        objects=None if objects is None else tuple(objects),
        split=demos.env_kwargs["split"],
        sensors=feature_sensors(config.obs_mode),
    )


def _replayed(
    env_config: EnvConfig, seed: int, actions: np.ndarray, config: ExportConfig
) -> tuple[list[Mapping[str, Any]], bool]:
    environment = environment_of(env_config)
    step = environment.reset(EpisodeSpec(seed))
    seen: list[Mapping[str, Any]] = []
    policy = SteppedPolicy(actions, seen.append)
    features = Features(environment)
    Rollout(environment, policy, Rules(float(config.hz)), observe=features.read).run(step)
    return seen, environment.task.succeeded(environment.physics)


def lerobot_features(features: Features) -> dict[str, Any]:
    """LeRobot's description of a data set's columns.

    Args:
      features: Of the environment that is replayed in.
    """
    described = {
        STATE: _numbers(AGENT_NAMES),
        "action": _numbers(ACTION_NAMES),
    }
    if "environment_state" in features.specs:
        described[ENVIRONMENT] = _numbers(features.specs["environment_state"].names)
    for name in CAMERAS:
        if f"pixels/{name}" in features.specs:
            described[f"{IMAGES}.{name}"] = {
                "dtype": "video",
                "shape": (IMAGE_SIZE, IMAGE_SIZE, 3),
                "names": ["height", "width", "channels"],
            }
    return described


def _numbers(names: Sequence[str]) -> dict[str, Any]:
    return {"dtype": "float32", "shape": (len(names),), "names": list(names)}


def frame(observation: Mapping[str, Any], action: np.ndarray) -> dict[str, Any]:
    """One frame of a data set; LeRobot adds times and indices.

    Args:
      observation: Features, with the instruction.
      action: That was taken then.
    """
    columns: dict[str, Any] = {
        STATE: observation["agent_pos"],
        "action": np.asarray(action, np.float32),
        "task": observation["instruction"],
    }
    if "environment_state" in observation:
        columns[ENVIRONMENT] = observation["environment_state"]
    for name in CAMERAS:
        if f"pixels/{name}" in observation:
            columns[f"{IMAGES}.{name}"] = observation[f"pixels/{name}"]
    return columns
