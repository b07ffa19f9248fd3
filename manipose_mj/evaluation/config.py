"""What an evaluation runs, and the seed of each of its episodes."""

from __future__ import annotations

import hashlib
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from manipose_mj.assets.categories import Split
from manipose_mj.control.perception.source_names import (
    GRASP_SOURCES,
    TOLD_OF_KINDS,
    GraspSource,
    default_grasps,
    masks_of,
)
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.injected_errors import InjectedErrors
from manipose_mj.evaluation.planner_settings import PlannerSettings
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.protocol.own_assets import (
    digest_of,
    digest_of_objects,
    find_assets,
    pool_folders,
)

if TYPE_CHECKING:
    from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

# What a source of poses means for objects and for furniture.
_POSES_OF = {
    "oracle": ("true", "true"),
    "estimated": ("estimated", "estimated"),
    "estimated_objects": ("estimated", "true"),
    "none": ("none", "none"),
}


@dataclass(frozen=True)
class BatchSettings:
    """Episodes that run side by side in batched worlds.

    Attributes: engine: `"c"` or `"warp"`; worlds: how many.
    """

    engine: Literal["c", "warp"]
    worlds: int = 256

    @property
    def words(self) -> list[str]:
        """The options of the command line that say the same."""
        return ["--engine", self.engine, "--worlds", str(self.worlds)]


@dataclass(frozen=True)
class EvaluationConfig:
    """An evaluation's input; with the versions, it determines every result but the times.

    Attributes:
      tasks: `"domain/task"` names.
      out: Folder for the results.
      episodes: Number per task.
      seed: Base seed, from which every episode's own seed follows.
      pose: Where the baseline takes object poses from.
      jobs: Episodes that run at the same time, each on one core; of the engine `c`, threads. Results do not
        depend on it.
      objects: What to use instead of the tasks' own objects: names of built-in ones, asset folders, or
        folders of them.
      protocol: Version of the protocol whose seeds and objects to take instead of `seed` and the training
        objects.
      assets: Folders with the assets that this version leaves to the user to build; else none.
      dask: Address of a dask scheduler whose workers run the episodes instead of `jobs` processes of this
        machine; they have to see `out` and the folders of `objects` and `assets`. Results do not depend on it.
      policy: Whose episodes they are; None: the baseline's.
      resample: Base seed for other seeds of the protocol's episodes, whose objects, furniture and parts stay.
      planner: Makes the baseline's plans.
      estimator: Whose estimates `pose="estimated"` means; None: those of the package's weights.
      batch: Run a policy in batched worlds; None: in the tasks' own environments, one episode a process.
      errors: Made on purpose.
      grasps: Where the baseline's grasps of objects come from; None: as suits `pose`.
    """

    tasks: tuple[str, ...]
    out: Path
    episodes: int = 50
    seed: int = 0
    pose: str = "oracle"
    jobs: int = 1
    objects: tuple[str, ...] | None = None
    protocol: str | None = None
    dask: str | None = None
    policy: PolicySettings | None = None
    resample: int | None = None
    planner: PlannerSettings = PlannerSettings()
    estimator: EstimatorSettings | None = None
    batch: BatchSettings | None = None
    errors: InjectedErrors = InjectedErrors()
    grasps: GraspSource | None = None
    assets: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.tasks:
            raise InputError("no task given; `manipose list` names them")
        if len(set(self.tasks)) < len(self.tasks):
            raise InputError(f"a task is given twice: {' '.join(self.tasks)}")
        for name, least in (("episodes", 1), ("seed", 0), ("jobs", 1)):
            if getattr(self, name) < least:
                raise InputError(f"{name} is {getattr(self, name)}; expected at least {least}")
        if self.policy is not None and self.pose != "oracle":
            raise InputError(f"pose {self.pose!r} is of the baseline; leave it out with a policy")
        if self.policy is not None and self.planner.kind != "rules":
            raise InputError(
                f"planner {self.planner.kind!r} is of the baseline; leave it out with a policy"
            )
        if self.resample is not None and self.protocol is None:
            raise InputError(
                f"resample {self.resample}: there is no protocol whose seeds it replaces; "
                f"add --protocol {protocol.VERSIONS[0]}, or choose episodes by --seed"
            )
        if self.resample is not None and not _is_base_seed(self.resample):
            raise InputError(f"resample is {self.resample!r}; expected a whole number, at least 0")
        if self.estimator is not None and self.pose == "oracle":
            raise InputError("an estimator needs --pose estimated: nobody else asks for estimates")
        if self.batch is not None:
            if self.batch.worlds < 1:
                raise InputError(f"worlds is {self.batch.worlds}; expected at least 1")
            if self.policy is None:
                raise InputError("batched worlds play policies; name one by --policy")
            if self.policy.execute is not None:
                raise InputError("--execute: in batched worlds a policy gives one action at a time")
            if self.dask is not None:
                raise InputError("--dask: batched worlds run on this machine; leave out --engine")
        self._check_errors()
        self._check_grasps()
        if self.protocol is not None:
            self._check_protocol(protocol.load(self.protocol))
        elif self.assets:
            raise InputError("--assets is of a protocol's objects; name others by --objects")

    def _check_errors(self) -> None:
        """Refuse errors that nobody would notice."""
        errors = self.errors
        errors.check()
        if errors.of_objects:
            self._check_tasks_have_objects(errors.of_objects[0])
        if self.policy is None:
            if errors.of_cameras and self.pose == "oracle":
                raise InputError(
                    f"{errors.of_cameras[0]}: with true poses nobody looks; add --pose estimated"
                )
            return
        if errors.assume_upright:
            raise InputError("--assume-upright is of the baseline; leave it out with a policy")
        modes = {part.split("/")[0] for part in self.policy.obs_mode.split("+")}
        if errors.of_poses and "pose" not in modes:
            raise InputError("--pose-error: the policy sees no poses; --obs-mode names none")
        if errors.of_cameras and modes.isdisjoint(("rgb", "depth", "segmentation", "pointcloud")):
            raise InputError(
                f"{errors.of_cameras[0]}: the policy sees no images; --obs-mode names none"
            )
        if errors.cameras and self.policy.obs_format == "droid":
            from manipose_mj.gym.features import CAMERAS

            lacking = [name for name in CAMERAS.values() if name not in errors.cameras]
            if lacking:
                raise InputError(f"--cameras: DROID's format needs {' and '.join(lacking)} too")

    def _check_tasks_have_objects(self, option: str) -> None:
        # Loads the simulator: only with errors of objects.
        from manipose_mj.tasks import registered  # noqa: F401  (registers the tasks)
        from manipose_mj.tasks.core.registry import named_task

        lacking = [task for task in self.tasks if not named_task(task).rigid]
        if lacking:
            more = f" and {len(lacking) - 3} more" if len(lacking) > 3 else ""
            have = "has" if len(lacking) == 1 else "have"
            some = "those tasks" if lacking[1:] else "that task"
            what = "it" if len(lacking) == len(self.tasks) else some
            raise InputError(
                f"{option}: {', '.join(lacking[:3])}{more} {have} no objects; leave {what} out"
            )

    def _check_grasps(self) -> None:
        if self.grasps is None:
            return
        if self.grasps not in GRASP_SOURCES:
            raise unknown_name("source of grasps", self.grasps, GRASP_SOURCES)
        if self.policy is not None:
            raise InputError("--grasps is of the baseline; leave it out with a policy")
        if self.grasps != "annotated" and self.pose == "oracle":
            raise InputError(
                f"--grasps {self.grasps} needs --pose estimated: with true poses nobody looks"
            )

    @property
    def grasp_source(self) -> str | None:
        """Where the baseline's grasps come from; None for a policy."""
        return None if self.policy is not None else self.grasps or default_grasps(self.pose)

    def _check_protocol(self, frozen: protocol.Protocol) -> None:
        if self.seed or self.objects is not None:
            raise InputError(
                f"protocol {self.protocol} fixes seeds and objects; leave out seed and objects"
            )
        for task in self.tasks:
            known = len(frozen.task(task).episodes)
            if self.episodes > known:
                raise InputError(
                    f"episodes is {self.episodes}; protocol {self.protocol} has {known} episodes of {task}"
                )
        if self.assets and not frozen.sources:
            raise InputError(
                f"protocol {self.protocol} has built-in objects only; leave out --assets"
            )

    def check_assets(self) -> None:
        """Raise `InputError`, one line that names them, where the user has not built all that the protocol asks for."""
        if self.protocol is not None:
            find_assets(self.protocol, self.tasks, self.assets)

    def independent_of_folder(self) -> EvaluationConfig:
        """The same for workers in another folder, and for policies and estimators that change it: with absolute paths."""
        from manipose_mj.tasks.core.object_selection import is_folder  # loads the simulator

        objects = self.objects and tuple(
            str(Path(each).absolute()) if is_folder(each) else each for each in self.objects
        )
        assets = tuple(str(Path(each).absolute()) for each in self.assets)
        record = self.planner.record and self.planner.record.absolute()
        planner = replace(self.planner, record=record)
        return replace(
            self, out=self.out.absolute(), objects=objects, assets=assets, planner=planner
        )

    def objects_of(self, task: str) -> tuple[str, ...] | None:
        """What the episodes of a task use instead of built-in objects, as `objects`."""
        if self.protocol is None:
            return self.objects
        return pool_folders(self.protocol, task, self.assets)

    @property
    def assets_digest(self) -> str | None:
        """Which builds of the user's assets the episodes use; None where all are built in."""
        if self.protocol is not None and self.assets:
            return digest_of(find_assets(self.protocol, self.tasks, self.assets).values())
        return digest_of_objects(self.objects)

    @property
    def poses(self) -> dict[str, str]:
        """What of a scene the policy knows truly, by estimates or not at all, for reports."""
        wrong = f", {self.errors.of_poses}" if self.errors.of_poses else ""
        if self.policy is not None:
            objects, furniture = _POSES_OF[self.policy.pose_source]
            return {"objects": objects + wrong, "furniture": furniture}
        objects, furniture = _POSES_OF[self.pose]
        if self.estimator is not None:
            objects = self.estimator.source
        told = {} if self.pose == "oracle" else {"kinds": TOLD_OF_KINDS}
        return {"objects": objects + wrong, **told, "furniture": furniture}

    @property
    def pose_source(self) -> str:
        """Where object poses come from; of a policy, once `attachment` says whether it is given the simulator."""
        return self.pose if self.policy is None else self.policy.pose_source

    @property
    def mask_source(self) -> str:
        """Where instance masks come from, likewise."""
        return masks_of(self.pose) if self.policy is None else self.policy.mask_source

    @property
    def split(self) -> Split:
        """Which built-in objects the episodes use."""
        return "train" if self.protocol is None else "test"

    def env_config(self, task: str) -> EnvConfig:
        """The environment that the episodes of a task take place in."""
        # Loads the simulator: workers only.
        from manipose_mj.control.perception.pose_sources import sensors_for
        from manipose_mj.gym.features import feature_sensors
        from manipose_mj.tasks.core.config import EnvConfig

        if self.policy is not None:
            return EnvConfig(
                task,
                obs_mode=self.policy.obs_mode,
                control_mode=self.policy.control_mode,
                objects=self.objects_of(task),
                split=self.split,
                sensors=self.errors.of_sensors(feature_sensors(self.policy.obs_mode)),
                latency=self.errors.latency,
            )
        return EnvConfig(
            task,
            obs_mode="state",
            objects=self.objects_of(task),
            split=self.split,
            sensors=self.errors.of_sensors(sensors_for(self.pose)),
            latency=self.errors.latency,
        )

    def episode_seed(self, task: str, episode: int) -> int:
        """The seed of one episode."""
        if self.resample is not None:
            return episode_seed(self.resample, f"{self.protocol}/{task}", episode)
        if self.protocol is not None:
            return protocol.load(self.protocol).episode(task, episode).seed
        return episode_seed(self.seed, task, episode)

    def episode_spec(self, task: str, episode: int) -> EpisodeSpec:
        """What one episode is."""
        # Loads the simulator: workers only.
        from manipose_mj.tasks.core.config import EpisodeSpec

        if self.protocol is not None:
            asked = protocol.load(self.protocol).episode(task, episode).asked
            return EpisodeSpec(**{**asked, "seed": self.episode_seed(task, episode)})
        return EpisodeSpec(self.episode_seed(task, episode))

    @property
    def identity(self) -> dict[str, Any]:
        """What two runs must share for their results to belong together."""
        return {
            "tasks": sorted(self.tasks),
            "episodes": self.episodes,
            "seed": self.seed,
            "pose": self.pose_source,
            "objects": None if self.objects is None else list(self.objects),
            "protocol": self.protocol,
            "protocol sha256": self.protocol and protocol.load(self.protocol).sha256,
            "assets sha256": self.assets_digest,
            "resample": self.resample,
            "policy": self.policy and self.policy.identity,
            "planner": self.planner.identity,
            "estimator": self.estimator and self.estimator.identity,
            "batch": self.batch and dict(vars(self.batch)),
            "injected errors": self.errors.identity,
            # With true poses the default has always been the same: older runs can go on.
            "grasps": self.grasps if self.pose == "oracle" else self.grasp_source,
        }

    @property
    def command(self) -> str:
        """The command line that repeats this evaluation."""
        words = ["manipose", "evaluate", *self.tasks]
        chosen = ["--protocol", self.protocol] if self.protocol else ["--seed", str(self.seed)]
        chosen += ["--assets", *self.assets] if self.assets else []
        if self.resample is not None:
            chosen += ["--resample", str(self.resample)]
        whose = ["--pose", self.pose, *self.planner.words]
        whose += self.estimator.words if self.estimator is not None else []
        if self.policy is not None:
            whose = self.policy.words + (self.batch.words if self.batch else [])
        whose += [] if self.grasps is None else ["--grasps", self.grasps]
        words += ["--episodes", str(self.episodes), *chosen, *whose, *self.errors.words]
        words += ["--jobs", str(self.jobs), "--out", str(self.out)]
        if self.objects is not None:
            words += ["--objects", *self.objects]
        if self.dask is not None:
            words += ["--dask", self.dask]
        return shlex.join(words)


def _is_base_seed(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def episode_seed(seed: int, task: str, episode: int) -> int:
    """The seed of one episode: a 32-bit number, whatever else runs and in whatever order.

    Args:
      seed: Base seed of the evaluation.
      task: `"domain/task"`.
      episode: Index within the evaluation.
    """
    # `hash` differs between processes.
    name = int.from_bytes(hashlib.sha256(task.encode()).digest()[:8], "big")
    return int(np.random.SeedSequence([seed, name, episode]).generate_state(1)[0])
