"""What an environment is, what an episode is, and what a task fixes about itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from manipose_mj.actions import CONTROL_MODES
from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import SPLITS, Split
from manipose_mj.errors import InputError, brief, unknown_name
from manipose_mj.mjcf.panda.robot import VISUALS, Visuals
from manipose_mj.tasks.core.object_selection import is_folder, select_assets
from manipose_mj.tasks.core.randomisation import STRENGTHS
from manipose_mj.tasks.core.start_check import check_pose
from manipose_mj.tasks.goals import RewardMode, Tolerance
from manipose_mj.tasks.observations.sensor_config import SensorConfig
from manipose_mj.tasks.observations.sensors import parse_modes

REWARD_MODES: tuple[RewardMode, ...] = ("sparse", "dense")
PRIMITIVE = "primitive"
SEEDS = 2**32  # of episodes: those of `numpy.random.RandomState`
_USUAL_SPLIT: Split = "train"
Objects = Sequence[Asset | str | Path]


@dataclass(frozen=True)
class EnvConfig:
    """What an environment is; every front door makes one of these.

    Attributes:
      task: `"domain/name"`.
      obs_mode: Any `+` combination of observation modes, such as `"state+pose+pointcloud"`.
      control_mode: What actions mean, such as `"pd_joint_pos"`, `"pd_ee_delta_pose"` or `"primitive"`; the
        physics is the same for all.
      reward_mode: `"sparse"`, 1 while the goals are met; or `"dense"`, in [0, 1].
      objects: Objects to draw from instead of the built-in ones: assets, names of built-in objects, asset
        folders, or folders of asset folders. The name of a split stands for `split`, unless there is a folder of
        that name; both are then as if `split` alone had been given.
      split: Which built-in objects to draw from; train and test objects have nothing in common.
      randomisation: Name of a strength of domain randomisation.
      sensors: Cameras, images, clouds and their noise.
      latency: By how much servo targets come late, beside what `randomisation` draws [s].
      robot_visuals: How the robot looks, to sensors too: `"primitive"`, alike on every machine; or `"menagerie"`, which
        needs Menagerie's meshes.

    Raises:
      InputError: A mode, split or strength is unknown, and the nearest names are offered; `objects` and `split` name
        different splits; or the latency is negative.
    """

    task: str
    obs_mode: str = "state+pose"
    control_mode: str = "pd_joint_pos"
    reward_mode: RewardMode = "sparse"
    objects: Objects | None = None
    split: Split = _USUAL_SPLIT
    randomisation: str = "none"
    sensors: SensorConfig = SensorConfig()
    latency: float = 0.0
    robot_visuals: Visuals = "primitive"

    def __post_init__(self) -> None:
        number = isinstance(self.latency, int | float | np.number)
        if not number or isinstance(self.latency, bool) or not 0 <= self.latency < 10:
            raise InputError(f"latency is {self.latency!r} s; expected a number from 0 to 10")
        if not isinstance(self.sensors, SensorConfig):
            raise InputError(f"sensors is a {type(self.sensors).__name__}; expected a SensorConfig")
        self._take_split()
        for what, value, known in (
            ("control mode", self.control_mode, (*CONTROL_MODES, PRIMITIVE)),
            ("reward mode", self.reward_mode, REWARD_MODES),
            ("split", self.split, SPLITS),
            ("randomisation", self.randomisation, STRENGTHS),
            ("robot visuals", self.robot_visuals, VISUALS),
        ):
            if value not in known:
                raise unknown_name(what, value, known)
        parse_modes(self.obs_mode)
        chosen: Any = self.objects
        if chosen is not None:
            one = isinstance(chosen, str | Path | Asset)
            if not one and not isinstance(chosen, Iterable):
                raise InputError(f"objects is {chosen!r}; expected names, folders or assets")
            object.__setattr__(self, "objects", (chosen,) if one else tuple(chosen))
            for each in self.objects or ():
                if not isinstance(each, str | Path | Asset) or each == "":
                    raise InputError(f"objects: {each!r} is no name, folder or asset")

    def _take_split(self) -> None:
        """Let `objects` that name a split say which."""
        chosen: Any = self.objects
        if not isinstance(chosen, str) or chosen not in SPLITS or is_folder(chosen):
            return
        if self.split not in (_USUAL_SPLIT, chosen):
            raise _two_splits(chosen, self.split)
        object.__setattr__(self, "objects", None)
        object.__setattr__(self, "split", chosen)

    def assets(self) -> tuple[Asset, ...] | None:
        """The objects chosen, loaded; None where the task shall use the built-in ones.

        Raises:
          InputError: There is no built-in object or asset folder of a name, or two assets have one name.
        """
        if self.objects is None:
            return None
        found: dict[str, Asset] = {}
        for asset in select_assets(self.objects):
            other = found.setdefault(asset.name, asset)
            if other.folder != asset.folder:
                raise InputError(
                    f"{asset.folder}: has the name of {other.folder}; an episode names its objects: choose one"
                )
        return tuple(found.values())


class EnvOptions(TypedDict, total=False):
    """The fields of `EnvConfig` but for the task, as keywords of the front doors."""

    obs_mode: str
    control_mode: str
    reward_mode: RewardMode
    objects: Objects | None
    split: Split
    randomisation: str
    sensors: SensorConfig
    latency: float


def env_config(task: str, options: EnvOptions, others: Iterable[str] = ()) -> EnvConfig:
    """An environment's configuration from the keywords of a front door.

    Args:
      task: `"domain/name"`.
      options: Fields of `EnvConfig`.
      others: The front door's own keywords, which a misspelt one may stand for.

    Raises:
      InputError: The task is no name, a field is unknown or holds what it cannot, or `objects` and `split` name different
        splits.
    """
    if not isinstance(task, str):
        raise InputError(f'task is {task!r}; expected "domain/name"')
    for name in options:
        if name not in EnvOptions.__annotations__:
            raise unknown_name("option", name, [*EnvOptions.__annotations__, *others])
    config, split = EnvConfig(task, **options), options.get("split")
    if split is not None and split != config.split:
        raise _two_splits(config.split, split)
    return config


def _two_splits(objects: str, split: str) -> InputError:
    return InputError(f"objects is {objects!r} and split is {split!r}; expected one of them")


@dataclass(frozen=True)
class EpisodeSpec:
    """What an episode is, within an environment.

    Attributes:
      seed: From which all that is random about it follows; None goes on from the episode before.
      object: Name of the rigid asset that it shall be about, one of those that the environment draws from; None
        draws one.
      furniture: Name of the articulated asset, likewise.
      part: Name of the drawer or door that it shall be about, likewise.
      goal: `T_world_label` that the object shall have in the end, `(4, 4)`, kept as rows; None draws it.

    Raises:
      InputError: The seed is no whole number from 0 to 2**32 - 1, a name no text, or the goal no pose.
    """

    seed: int | None = None
    object: str | None = None
    furniture: str | None = None
    part: str | None = None
    goal: tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self) -> None:
        if self.seed is not None:
            check_seed(self.seed)
        for what in ("object", "furniture", "part"):
            name = getattr(self, what)
            if name is not None and not (isinstance(name, str) and name):
                raise InputError(f"{what} is {brief(name)}; expected a name")
        if self.goal is not None:
            try:
                pose = np.asarray(self.goal, float)
            except (TypeError, ValueError):
                raise InputError("goal is no array of numbers; expected a pose, 4 x 4") from None
            check_pose(pose, "goal")
            object.__setattr__(self, "goal", tuple(map(tuple, pose.tolist())))


def check_seed(seed: Any, what: str = "seed") -> None:
    """Raises InputError for what is no seed of an episode; `what` names it in the message."""
    whole = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
    if not whole or not 0 <= seed < SEEDS:
        raise InputError(f"{what} is {seed!r}; expected a whole number from 0 to {SEEDS - 1}")


@dataclass(frozen=True)
class TaskConfig:
    """What every task fixes; its own configuration adds to this.

    Attributes:
      tolerance: What counts as success.
      horizon: Time limit of an episode [s].
      settle: Time that objects have to come to rest before an episode starts [s].
    """

    tolerance: Tolerance = Tolerance()
    horizon: float = 60.0
    settle: float = 0.3
