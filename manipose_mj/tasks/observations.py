"""Observation modes: what a task shows, switched on by names joined with `+`."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.mjcf.clouds import (
    PointCloud,
    cloud_from_depth,
    fuse,
    geom_instances,
    pixel_instances,
)
from manipose_mj.mjcf.ray_camera import (
    RayCamera,
    RayImage,
    camera_id,
    camera_intrinsics,
    camera_pose,
)

MODES = ("state", "pose", "depth", "segmentation", "pointcloud")


@dataclass(frozen=True)
class SensorConfig:
    """Attributes: cameras: names of cameras in the scene (`front`, `left`, `right`, `overview`,
    `panda/wrist`); height, width: of their images [pixels]; cloud_size: points of the fused cloud."""

    cameras: tuple[str, ...] = ("front", "left", "right")
    height: int = 120
    width: int = 160
    cloud_size: int = 16384


def parse_modes(observations: str) -> tuple[str, ...]:
    """The observation modes named in `observations`, such as `"state+pose"`.

    Raises:
      InputError: One of them is unknown, or there is none.
    """
    modes = tuple(observations.split("+"))
    for mode in modes:
        if mode not in MODES:
            raise unknown_name("observation mode", mode, MODES)
    return modes


class SensorObservables:
    """Builds a task's observables; an image is rendered once for all that use it."""

    def __init__(
        self,
        instances: Mapping[str, composer.Entity],
        arena: composer.Arena,
        config: SensorConfig,
    ) -> None:
        self._entities = tuple(instances.values())
        self._config = config
        self._camera = RayCamera(config.height, config.width)
        known = [c.full_identifier for c in arena.mjcf_model.find_all("camera")]
        for name in config.cameras:
            if name not in known:
                raise unknown_name("camera", name, known)
        if config.cloud_size < 1:
            raise InputError(f"cloud_size is {config.cloud_size}; expected at least 1")
        self._images: dict[str, tuple[float, Any]] = {}

    def build(
        self, observations: str, poses: Mapping[str, observable.Observable]
    ) -> OrderedDict[str, observable.Observable]:
        """The task observables; those of the modes asked for are enabled."""
        modes = parse_modes(observations)
        built: OrderedDict[str, observable.Observable] = OrderedDict()
        for name, pose in poses.items():
            built[f"pose/{name}"] = pose
        for camera in self._config.cameras:
            built[f"depth/{camera}"] = observable.Generic(
                lambda physics, name=camera: self._image(physics, name).depth
            )
            built[f"segmentation/{camera}"] = observable.Generic(
                lambda physics, name=camera: self._segmentation(physics, name)
            )
        built["pointcloud/points"] = observable.Generic(lambda p: self.cloud(p).points_world)
        built["pointcloud/normals"] = observable.Generic(lambda p: self.cloud(p).normals_world)
        built["pointcloud/instance"] = observable.Generic(lambda p: self.cloud(p).instance)
        for name, each in built.items():
            each.enabled = name.split("/")[0] in modes
        return built

    def cloud(self, physics: mjcf.Physics) -> PointCloud:
        """All cameras' points as one cloud of fixed size; instance 0 is the surroundings."""
        key = "cloud"
        cached = self._cached(physics, key)
        if cached is None:
            model, data = physics.model.ptr, physics.data.ptr
            clouds = []
            for name in self._config.cameras:
                image = self._image(physics, name)
                intrinsics = camera_intrinsics(
                    model, camera_id(model, name), self._config.height, self._config.width
                )
                clouds.append(
                    cloud_from_depth(
                        image.depth,
                        self._segmentation(physics, name),
                        intrinsics,
                        camera_pose(model, data, name),
                    )
                )
            cached = fuse(clouds).resized(self._config.cloud_size)
            self._images[key] = (physics.data.time, cached)
        return cached

    def _image(self, physics: mjcf.Physics, camera: str) -> RayImage:
        cached = self._cached(physics, camera)
        if cached is None:
            cached = self._camera.render(physics.model.ptr, physics.data.ptr, camera)
            self._images[camera] = (physics.data.time, cached)
        return cached

    def _segmentation(self, physics: mjcf.Physics, camera: str) -> np.ndarray:
        owners = geom_instances(physics.model.ptr, self._bodies(physics))
        # The task's names start with the background.
        return pixel_instances(self._image(physics, camera).geom_id, owners) + 1

    def _bodies(self, physics: mjcf.Physics) -> list[int]:
        frames = [mjcf.get_attachment_frame(e.mjcf_model) for e in self._entities]
        return [int(physics.bind(frame).element_id) for frame in frames]

    def forget(self) -> None:
        """Drop what was rendered; time alone cannot tell one episode's start from the next's."""
        self._images.clear()

    def _cached(self, physics: mjcf.Physics, key: str) -> Any:
        time, value = self._images.get(key, (-1.0, None))
        return value if time == physics.data.time else None
