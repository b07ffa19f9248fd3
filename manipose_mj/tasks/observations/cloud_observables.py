"""The mode `pointcloud`: what all cameras see as one cloud, and one cloud of each object.

`pointcloud/points`, `normals`, `colours` and `instance` are the fused cloud; `pointcloud/NAME/points` and so
on that of one object, with `pointcloud/NAME/count` points, then zeros. All in the world frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from dm_env import specs
from jaxtyping import Float, Int

from manipose_mj.mjcf.cameras.clouds import NO_INSTANCE, PointCloud, fuse, subset
from manipose_mj.mjcf.cameras.depth_normals import depth_normals
from manipose_mj.mjcf.cameras.ray_casting import rotated
from manipose_mj.tasks.observations.camera_rig import CameraRig, Frame
from manipose_mj.tasks.observations.declared import Declared, Read, bounded, unbounded
from manipose_mj.tasks.observations.sensor_config import SensorConfig
from manipose_mj.tasks.observations.step_cache import StepCache


class CloudObservables:
    """Makes clouds of a rig's frames, once a moment."""

    def __init__(self, rig: CameraRig, config: SensorConfig, *, shaded: bool) -> None:
        """Prepares.

        Args:
          rig: The cameras.
          config: Sizes.
          shaded: Whether points take the colours of `rgb`, with light and shadow, or those of the
            surfaces.
        """
        self._rig, self._config, self._shaded = rig, config, shaded
        self._cache = StepCache()

    def observables(
        self,
        objects: tuple[str, ...],
        instances: int,
        instance_of: Callable[[str], int],
        started: Callable[[], bool],
    ) -> dict[str, Declared]:
        """Without the mode's prefix.

        Args:
          objects: Names of those that get a cloud of their own.
          instances: How many there are, the background among them.
          instance_of: The instance of an object in this episode.
          started: Whether there is an episode to observe.
        """
        shown = _cloud("", self._config.cloud_size, self.fused, started)
        ids = bounded((self._config.cloud_size,), np.int32, NO_INSTANCE, instances - 1)
        shown["instance"] = Declared(ids, lambda p: self.fused(p).instance, started)
        size = self._config.object_cloud_size
        for name in objects:

            def own(physics: mjcf.Physics, name: str = name) -> PointCloud:
                return self._of(physics, name, instance_of(name))

            shown |= _cloud(f"{name}/", size, own, started)
            count = bounded((1,), np.int32, 0, size)
            shown[f"{name}/count"] = Declared(count, lambda p, f=own: [f(p).valid.sum()], started)
        return shown

    def forget(self) -> None:
        """An episode begins, or the state was changed from outside."""
        self._cache.forget()

    def fused(self, physics: mjcf.Physics) -> PointCloud:
        """All cameras' points as one cloud of fixed size; instance 0 is the surroundings."""
        size = self._config.cloud_size

        def make() -> PointCloud:
            seen = self._seen(physics)
            return self._cloud(physics, seen.rows(subset(len(seen.pixel), size))).resized(size)

        return self._cache.get(physics, "fused", make)

    def _of(self, physics: mjcf.Physics, name: str, instance: int) -> PointCloud:
        size = self._config.object_cloud_size

        def make() -> PointCloud:
            seen = self._seen(physics)
            # The background is nobody's: an object that the episode does not have has no points.
            own = np.flatnonzero(seen.instance == (instance if instance > 0 else NO_INSTANCE))
            return self._cloud(physics, seen.rows(own[subset(len(own), size)])).resized(size)

        return self._cache.get(physics, f"of {name}", make)

    def _seen(self, physics: mjcf.Physics) -> _Pixels:
        """All pixels with a depth."""

        def make() -> _Pixels:
            frames = [self._rig.frame(physics, name) for name in self._rig.names]
            pixels = [np.flatnonzero(frame.depth.ravel() > 0) for frame in frames]
            return _Pixels(
                camera=np.repeat(np.arange(len(frames)), [len(p) for p in pixels]),
                pixel=np.concatenate(pixels),
                instance=np.concatenate(
                    [f.instance.ravel()[p] for f, p in zip(frames, pixels, strict=True)]
                ),
            )

        return self._cache.get(physics, "seen", make)

    def _cloud(self, physics: mjcf.Physics, chosen: _Pixels) -> PointCloud:
        """The points of these pixels, camera by camera."""
        clouds = []
        for number, name in enumerate(self._rig.names):
            own = chosen.rows(np.flatnonzero(chosen.camera == number))
            frame = self._rig.frame(physics, name)
            if self._shaded:
                colours = self._rig.rgb(physics, name).reshape(-1, 3)[own.pixel]
            else:
                colours = self._rig.colours(physics, name, own.pixel)
            depth = frame.depth.ravel()[own.pixel, None]
            points = frame.pose[:3, 3] + frame.rays[own.pixel] * depth
            clouds.append(
                PointCloud(points.astype(np.float32), _normals(frame, own), colours, own.instance)
            )
        return fuse(clouds)


@dataclass(frozen=True)
class _Pixels:
    """Pixels of several cameras: which camera, the index in its flat image, the instance there."""

    camera: Int[np.ndarray, "n"]
    pixel: Int[np.ndarray, "n"]
    instance: Int[np.ndarray, "n"]

    def rows(self, rows: Int[np.ndarray, "m"]) -> _Pixels:
        return _Pixels(self.camera[rows], self.pixel[rows], self.instance[rows])


def _normals(frame: Frame, chosen: _Pixels) -> Float[np.ndarray, "n 3"]:
    """World normals, turned as calibration is: exact from an ideal sensor, else of each instance's noisy depth."""
    if frame.ideal:
        exact = frame.exact.normal.reshape(-1, 3)[chosen.pixel]
        return exact if frame.misread is None else rotated(exact, frame.misread).astype(np.float32)
    normals = np.zeros((len(chosen.pixel), 3))
    for instance in np.unique(chosen.instance):
        own = np.flatnonzero(chosen.instance == instance)
        pixels = np.stack(np.divmod(chosen.pixel[own], frame.intrinsics.width), axis=1)
        mask = frame.instance == instance
        normals[own] = depth_normals(frame.depth, mask, pixels, frame.intrinsics)
    return rotated(normals, frame.pose[:3, :3]).astype(np.float32)


def _cloud(
    prefix: str, size: int, cloud: Callable[[mjcf.Physics], PointCloud], started: Callable[[], bool]
) -> dict[str, Declared]:
    def show(spec: specs.Array, read: Read) -> Declared:
        return Declared(spec, read, started)

    return {
        f"{prefix}points": show(unbounded((size, 3), np.float32), lambda p: cloud(p).points_world),
        f"{prefix}normals": show(
            bounded((size, 3), np.float32, -1.0, 1.0),
            lambda p: np.clip(cloud(p).normals_world, -1.0, 1.0),
        ),
        f"{prefix}colours": show(bounded((size, 3), np.uint8, 0, 255), lambda p: cloud(p).colours),
    }
