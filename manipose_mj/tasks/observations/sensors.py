"""Observation modes: what a task shows, switched on by names joined with `+`.

Modes are `state` (the robot's joints and gripper), `pose`, `rgb`, `depth`, `segmentation` and `pointcloud`;
each is a set of observables whose keys start with its name. A single key, such as `depth/front`, may
stand in place of a mode and brings nothing else. Modes of images bring `camera/NAME/pose` (`T_world_camera`,
OpenCV's axes) and `camera/NAME/intrinsics` with them.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from dm_env import specs

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.mjcf.cameras.clouds import PointCloud
from manipose_mj.tasks.observations.camera_rig import CameraRig
from manipose_mj.tasks.observations.cloud_observables import CloudObservables
from manipose_mj.tasks.observations.declared import Declared, Read, bounded, unbounded
from manipose_mj.tasks.observations.frames import PosedScene
from manipose_mj.tasks.observations.pose_observables import PoseObservables, Slots
from manipose_mj.tasks.observations.sensor_config import CameraView, PoseNoise, SensorConfig

__all__ = [
    "MODES",
    "CameraView",
    "PoseNoise",
    "SensorConfig",
    "SensorObservables",
    "Slots",
    "parse_modes",
]

MODES = ("state", "pose", "rgb", "depth", "segmentation", "pointcloud")
_IMAGES = ("rgb", "depth", "segmentation")


def parse_modes(observations: str) -> tuple[str, ...]:
    """The modes and keys named in `observations`, such as `"state+pose+depth/front"`.

    Raises:
      InputError: A mode is unknown, or there is none. Keys, which have a `/`, are checked when the
        task that they are of is known.
    """
    if not isinstance(observations, str):
        raise InputError(f"obs_mode is {observations!r}; expected a text, such as 'state+pose'")
    parts = tuple(observations.split("+"))
    for part in parts:
        if "/" not in part and part not in MODES:
            raise unknown_name("observation mode", part, MODES)
    return parts


class SensorObservables:
    """A task's observables; those of the modes asked for are enabled."""

    def __init__(
        self,
        scene: PosedScene,
        slots: Slots,
        instances: Mapping[str, composer.Entity],
        arena: composer.Arena,
        config: SensorConfig,
        observations: str,
    ) -> None:
        """Prepares; the arena must not be compiled yet.

        Args:
          scene: The task.
          slots: What it may show in any episode.
          instances: What segmentation tells apart, counted from 1.
          arena: Gets the user's cameras.
          config: Cameras, sizes, noise.
          observations: Modes and keys, joined by `+`.

        Raises:
          InputError: A mode or camera is unknown, a camera has the name of another, or images are
            asked for without a camera or a renderer.
        """
        self._parts = parse_modes(observations)
        modes = {part.split("/")[0] for part in self._parts}
        self._scene, self._slots, self._config = scene, slots, config
        self._entities = tuple(instances.values())
        self._robot = instances["robot"]
        self._rig = CameraRig(config, arena, instances)
        self._poses = PoseObservables(
            scene,
            self._robot,
            slots,
            self._rig.names,
            self._rig.pose,
            config.pose_noise,
            config.pose_error,
        )
        self._clouds = CloudObservables(self._rig, config, shaded="rgb" in modes)
        if not self._rig.names and modes & {*_IMAGES, "pointcloud"}:
            raise InputError(f"observations {observations!r} need a camera; sensors name none")
        if "rgb" in modes:
            self._rig.require_renderer()

    def build(
        self, poses: Mapping[str, observable.Observable]
    ) -> OrderedDict[str, observable.Observable]:
        """All observables of the task; the robot's own are switched on as asked for as well.

        Args:
          poses: More for the mode `pose`; those of objects, furniture and goals come by themselves.

        Raises:
          InputError: A key is unknown.
        """
        built: OrderedDict[str, observable.Observable] = OrderedDict()
        own = self._poses.observables()
        built.update((f"pose/{name}", pose) for name, pose in own.items())
        built.update((f"pose/{name}", pose) for name, pose in poses.items() if name not in own)
        built.update(self._images())
        built.update(self._cloud_observables())
        _enable(built, self._robot.observables.as_dict(fully_qualified=True), self._parts)
        return built

    def cloud(self, physics: mjcf.Physics) -> PointCloud:
        """All cameras' points as one cloud of fixed size; instance 0 is the surroundings."""
        return self._clouds.fused(physics)

    @property
    def poses(self) -> PoseObservables:
        """What the mode `pose` shows."""
        return self._poses

    def forget(self) -> None:
        """An episode begins, or the state was changed from outside."""
        self._rig.forget(self._scene.noise_seed or 0)
        self._poses.forget()
        self._clouds.forget()

    def close(self) -> None:
        """Free what GL holds."""
        self._rig.close()

    def _started(self) -> bool:
        return self._scene.noise_seed is not None

    def _images(self) -> dict[str, Declared]:
        shown: dict[str, Declared] = {}

        def show(name: str, spec: specs.Array, read: Read) -> None:
            shown[name] = Declared(spec, read, self._started)

        rig, shape = self._rig, (self._config.height, self._config.width)
        most = len(self._entities)
        for camera in rig.names:
            colours = bounded((*shape, 3), np.uint8, 0, 255)
            show(f"rgb/{camera}", colours, lambda p, c=camera: rig.rgb(p, c))
            depths = bounded(shape, np.float32, 0.0, np.inf)
            show(f"depth/{camera}", depths, lambda p, c=camera: rig.frame(p, c).depth)
            ids = bounded(shape, np.int32, 0, most)
            show(f"segmentation/{camera}", ids, lambda p, c=camera: rig.frame(p, c).instance)
            show(f"camera/{camera}/pose", unbounded((4, 4)), lambda p, c=camera: rig.pose(p, c))
            show(
                f"camera/{camera}/intrinsics",
                unbounded((3, 3)),
                lambda p, c=camera: rig.intrinsics(p, c).matrix,
            )
        for name in self._clouded():
            ids = bounded((1,), np.int32, 0, most)
            show(f"segmentation/ids/{name}", ids, lambda _, n=name: [self._instance_of(n)])
        return shown

    def _cloud_observables(self) -> dict[str, Declared]:
        clouds = self._clouds.observables(
            self._clouded(), len(self._entities) + 1, self._instance_of, self._started
        )
        for name in self._clouded():
            ids = bounded((1,), np.int32, 0, len(self._entities))
            clouds[f"ids/{name}"] = Declared(
                ids, lambda _, n=name: [self._instance_of(n)], self._started
            )
        return {f"pointcloud/{name}": each for name, each in clouds.items()}

    def _clouded(self) -> tuple[str, ...]:
        """Names of what has a cloud of its own: objects, and the episode's furniture."""
        return (*self._slots.objects, "furniture") if self._slots.furniture else self._slots.objects

    def _instance_of(self, name: str) -> int:
        """Which instance it is in this episode; 0 if the episode does not have it."""
        if name == "furniture":
            entity = next(iter(self._scene.articulated_objects), None)
        else:
            entity = self._scene.objects.get(name)
        numbers = {each: number for number, each in enumerate(self._entities, start=1)}
        return 0 if entity is None else numbers.get(entity, 0)


def _enable(
    observables: Mapping[str, observable.Observable],
    state: Mapping[str, observable.Observable],
    parts: Iterable[str],
) -> None:
    """Switch on those of the modes and keys named; `state` is what the mode of that name shows.

    Raises:
      InputError: A key is unknown; the nearest are offered.
    """
    modes = set(parts)
    for part in parts:
        if "/" in part and part not in observables and part not in state:
            raise unknown_name("observation key", part, (*observables, *state))
    for name, each in state.items():
        each.enabled = "state" in modes or name in modes
    for name, each in observables.items():
        mode = name.split("/")[0]
        images = mode == "camera" and not modes.isdisjoint(_IMAGES)
        each.enabled = mode in modes or name in modes or images
