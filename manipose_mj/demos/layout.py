"""The files of a set of demonstrations, laid out as ManiSkill's.

`trajectory.OBS.CONTROL.mujoco_cpu.h5` holds a group `traj_I` for each episode: `actions` `(t, n)`, `terminated`, `truncated` and
`success` `(t,)`, `env_states/qpos` and `qvel` `(t + 1, ...)`, and, where observations were added, `obs/...` `(t + 1, ...)`. The
`.json` beside it tells how each episode starts (https://maniskill.readthedocs.io, "Trajectory datasets").
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from jaxtyping import Float

from manipose_mj.assets.categories import category_row, find
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.protocol import VERSIONS
from manipose_mj.evaluation.protocol.own_assets import (
    built_assets,
    digest_of_objects,
    version_with,
)
from manipose_mj.evaluation.records import write_atomically
from manipose_mj.evaluation.statistics import versions
from manipose_mj.gym.registration import env_id

BACKEND = "mujoco_cpu"
RECORDED_MODE = "pd_joint_pos"
RECORDED_HZ = 50
COMPRESSION: dict[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True}


@dataclass(frozen=True)
class DemoEpisode:
    """What the JSON says of an episode.

    Attributes:
      episode_id: Of its group, `traj_I`.
      episode_seed: From which its start follows.
      control_mode: Of its actions.
      elapsed_steps: Number of its actions.
      success: Whether the goal was met at the end.
      failure: The stage that failed; None on success.
      object: Name of the asset that it is about.
      instruction: In words.
      state_sha256: Of all its states, in double precision: what a replay must repeat.
      reset_kwargs: Of `gymnasium.Env.reset`.
    """

    episode_id: int
    episode_seed: int
    control_mode: str
    elapsed_steps: int
    success: bool
    failure: str | None
    object: str
    instruction: str
    state_sha256: str
    reset_kwargs: dict[str, Any]


@dataclass(frozen=True)
class DemoArrays:
    """What the HDF5 file holds of an episode.

    Attributes:
      actions: `(t, n)`.
      qpos: `(t + 1, nq)`, rounded to float32.
      qvel: `(t + 1, nv)`, likewise.
      success: `(t,)`, whether the goal was met after each step.
      truncated: Whether the time limit ended it.
    """

    actions: Float[np.ndarray, "t n"]
    qpos: Float[np.ndarray, "s nq"]
    qvel: Float[np.ndarray, "s nv"]
    success: np.ndarray
    truncated: bool


@dataclass(frozen=True)
class DemoSet:
    """The demonstrations of one task.

    Attributes:
      path: Of the HDF5 file.
      task: `"domain/name"`.
      env_kwargs: Of the environment: `obs_mode`, `control_mode`, `objects`, `split`.
      versions: Of the packages that can change a replay.
      protocol: Version and sha256 of the protocol whose seeds it must not hold.
      episodes: In the order of their ids.
      replayed: How many episodes of a recording it is a replay of; None: it is the recording.
      assets_sha256: Of which builds of the user's assets it is; None: all are built in.
    """

    path: Path
    task: str
    env_kwargs: dict[str, Any]
    versions: dict[str, str]
    protocol: dict[str, str]
    episodes: tuple[DemoEpisode, ...]
    replayed: int | None = None
    assets_sha256: str | None = None

    @property
    def document(self) -> dict[str, Any]:
        """The JSON."""
        return {
            "env_info": {
                "env_id": env_id(self.task),
                "task": self.task,
                "env_kwargs": self.env_kwargs,
                "control_hz": RECORDED_HZ,
            },
            "source_type": "motionplanning",
            "source_desc": "the baseline of ManiPose-MJ with true poses",
            "versions": self.versions,
            "protocol": self.protocol,
            **({} if self.replayed is None else {"replayed": self.replayed}),
            **({} if self.assets_sha256 is None else {"assets_sha256": self.assets_sha256}),
            "episodes": [asdict(episode) for episode in self.episodes],
        }


def trajectory_name(obs_mode: str, control_mode: str) -> str:
    """The file's name, without its ending; `none` stands for no observations."""
    return f"trajectory.{obs_mode.replace('/', '-') or 'none'}.{control_mode}.{BACKEND}"


def recorded_name() -> str:
    """Name of the HDF5 file of a recording, which no replay has."""
    return f"{trajectory_name('none', RECORDED_MODE)}.h5"


def task_folder(out: Path, task: str) -> Path:
    """Where the demonstrations of a task are, in the folder of several."""
    return out / task.replace("/", "__")


def current_versions() -> dict[str, str]:
    """Of the packages that can change a replay."""
    return {n: v for n, v in versions().items() if n not in ("platform", "source")}


def current_protocol() -> dict[str, str]:
    """The protocol of built-in objects."""
    return {"version": VERSIONS[0], "sha256": protocol.load(VERSIONS[0]).sha256}


def refuse_frozen(task: str, seeds: Iterable[int]) -> None:
    """Raise `InputError` where a seed is one of a protocol's: what is trained on cannot be evaluated on."""
    frozen = frozen_seeds(task)
    for seed in seeds:
        if seed in frozen:
            raise InputError(
                f"seed {seed} of {task} is an evaluation seed of a protocol; use others"
            )


def frozen_seeds(task: str) -> set[int]:
    """Evaluation seeds of a task, of all protocols that have it."""
    tables = [protocol.load(version).tasks for version in VERSIONS]
    return {seed for each in tables if task in each for seed in each[task].seeds.values()}


def refuse_test_objects(objects: Iterable[str]) -> None:
    """Raise `InputError` where an object is for tests: a built-in one, or one of a protocol's list of scans.

    Args:
      objects: Names of built-in objects, asset folders, or folders of them.
    """
    from manipose_mj.tasks.core.object_selection import is_folder  # loads the simulator

    for each in objects:
        if not is_folder(each):
            _refuse_builtin(each, each)
            continue
        for asset in built_assets([each]):
            if asset.built_in:
                _refuse_builtin(asset.built_in, f"{asset.folder}: {asset.built_in}")
            version = version_with(asset)
            if version is not None:
                raise InputError(
                    f"{asset.folder}: {asset.name} of {asset.data_set} is a test object of protocol {version}; "
                    "demonstrations take others"
                )


def _refuse_builtin(name: str, said: str) -> None:
    category, index = find(name)
    if category_row(category).split(index) == "test":
        raise InputError(f"{said} is a test object; demonstrations take training objects")


@contextmanager
def writing(path: Path) -> Iterator[h5py.File]:
    """A new HDF5 file that is there whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with h5py.File(aside, "w") as file:
            yield file
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def write_episode(file: h5py.File, number: int, arrays: DemoArrays) -> None:
    """Add what was done and came of it to the group of an episode, which may hold its observations."""
    group = file.require_group(f"traj_{number}")
    steps = len(arrays.actions)
    ended = np.zeros(steps, bool)
    ended[-1:] = arrays.truncated
    columns = {
        "actions": arrays.actions,
        "terminated": np.zeros(steps, bool),
        "truncated": ended,
        "success": arrays.success,
        "env_states/qpos": arrays.qpos,
        "env_states/qvel": arrays.qvel,
    }
    for name, values in columns.items():
        group.create_dataset(name, data=values, **(COMPRESSION if np.size(values) else {}))


def write_description(demos: DemoSet) -> None:
    """Write the JSON beside the HDF5 file."""
    text = json.dumps(demos.document, indent=1, allow_nan=False)
    write_atomically(demos.path.with_suffix(".json"), f"{text}\n".encode())


def find_sets(path: Path) -> list[DemoSet]:
    """The sets in a folder, or in the folders in it, or of one HDF5 file.

    Where a folder holds a recording, its replays in the same folder are left out.

    Raises:
      InputError: There is none, or a file is broken.
    """
    if not path.exists():
        raise InputError(
            f"{path}: no such folder or file; expected what `manipose demos record` wrote"
        )
    if path.is_file() and path.suffix != ".h5":
        raise InputError(f"{path}: expected a folder of demonstrations, or a file trajectory.*.h5")
    if path.suffix == ".h5" and not path.is_dir():
        return [_playable(read_set(path))]
    files = sorted([*path.glob("trajectory.*.h5"), *path.glob("*/trajectory.*.h5")])
    if not files:
        raise InputError(f"{path}: holds no demonstrations (trajectory.*.h5)")
    recorded = {file.parent for file in files if file.name == recorded_name()}
    return [
        _playable(read_set(file))
        for file in files
        if file.parent not in recorded or file.name == recorded_name()
    ]


def _playable(demos: DemoSet) -> DemoSet:
    """Raises InputError where there is no episode, or the user's objects were built anew since."""
    where = demos.path.with_suffix(".json")
    if not demos.episodes:
        raise InputError(f"{where}: describes no episode")
    digest = demos.assets_sha256
    if digest is not None and digest != digest_of_objects(demos.env_kwargs["objects"]):
        raise InputError(
            f"{where}: its objects were built otherwise; build them as they were, or record anew"
        )
    return demos


def read_set(path: Path) -> DemoSet:
    """What the JSON beside an HDF5 file says.

    Raises:
      InputError: One of both is missing or broken, or they do not fit each other.
    """
    description = path.with_suffix(".json")
    try:
        document = json.loads(description.read_text(encoding="utf-8"))
        info = document["env_info"]
        names = {field.name for field in fields(DemoEpisode)}
        episodes = tuple(
            DemoEpisode(**{k: v for k, v in each.items() if k in names})
            for each in document["episodes"]
        )
        demos = DemoSet(
            path,
            info["task"],
            info["env_kwargs"],
            document["versions"],
            document["protocol"],
            episodes,
            document.get("replayed"),
            document.get("assets_sha256"),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{description}: no description of demonstrations ({reason})") from None
    _check(demos, description)
    with reading(path) as file:
        missing = [e.episode_id for e in episodes if f"traj_{e.episode_id}" not in file]
    if missing:
        raise InputError(f"{path}: lacks traj_{missing[0]}, which {description.name} describes")
    refuse_frozen(demos.task, (episode.episode_seed for episode in episodes))
    return demos


def _check(demos: DemoSet, where: Path) -> None:
    """Raises InputError where the environment or the numbers of episodes are not those of demonstrations."""
    given = demos.env_kwargs
    kwargs = given if isinstance(given, dict) else {}
    objects, ids = kwargs.get("objects", ""), [episode.episode_id for episode in demos.episodes]
    listed = isinstance(objects, list) and all(isinstance(each, str) for each in objects)
    if not (objects is None or listed):
        said = repr(objects) if "objects" in kwargs else "missing"
        raise InputError(
            f"{where}: env_kwargs: objects is {said}; expected null or a list of names"
        )
    if not isinstance(kwargs.get("split"), str):
        raise InputError(f"{where}: env_kwargs: split is {kwargs.get('split')!r}; expected a name")
    if twice := [each for each, count in Counter(ids).items() if count > 1]:
        raise InputError(f"{where}: describes episode {twice[0]} twice")


@contextmanager
def reading(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file.

    Raises:
      InputError: It is missing, cut short or something else.
    """
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, KeyError) as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: no whole HDF5 file of demonstrations ({reason})") from None


def read_actions(demos: DemoSet, episode: DemoEpisode) -> Float[np.ndarray, "t n"]:
    """The actions of an episode.

    Raises:
      InputError: The file is broken.
    """
    with reading(demos.path) as file:
        group: Any = file[f"traj_{episode.episode_id}"]
        actions = np.asarray(group["actions"], float)
    if actions.ndim != 2 or len(actions) != episode.elapsed_steps:
        raise InputError(
            f"{demos.path}: traj_{episode.episode_id} has actions of shape {actions.shape}; expected "
            f"{episode.elapsed_steps}"
        )
    if not np.isfinite(actions).all():
        step = int(np.flatnonzero(~np.isfinite(actions).all(axis=1))[0])
        raise InputError(
            f"{demos.path}: traj_{episode.episode_id} has an action that is not finite, of step {step}"
        )
    return actions
