"""The cameras of a task: each is rendered once a moment for all that look at it."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float, Int, UInt8

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.mjcf.arena import look_at
from manipose_mj.mjcf.cameras.clouds import geom_instances, pixel_instances
from manipose_mj.mjcf.cameras.depth_noise import measure
from manipose_mj.mjcf.cameras.pictures import Painter, binds_gl, make_painter
from manipose_mj.mjcf.cameras.ray_camera import (
    Intrinsics,
    RayCamera,
    RayImage,
    camera_id,
    camera_intrinsics,
    camera_pose,
)
from manipose_mj.mjcf.cameras.ray_casting import VISIBLE_GROUPS, rotated
from manipose_mj.mjcf.cameras.ray_memory import RayMemory
from manipose_mj.mjcf.cameras.ray_picture import RayShading
from manipose_mj.mjcf.cameras.surface_colours import SurfaceColours, to_display
from manipose_mj.tasks.observations.sensor_config import CameraView, SensorConfig
from manipose_mj.tasks.observations.step_cache import StepCache, step_number

_log = logging.getLogger(__name__)

# Without GL a picture is one ray a pixel, with hard shadows: good enough for a policy, and quick.
SENSOR_SHADING = RayShading(supersampling=1, light_radius=0.0)


@dataclass(frozen=True)
class Frame:
    """What one camera measured.

    Attributes:
      depth: `(height, width)` float32 [m]; 0 where nothing was measured.
      instance: `(height, width)` int32, which of the task's instances; 0 is everything else.
      exact: What is there; the same as `depth` from an ideal sensor.
      intrinsics: Of the image.
      pose: `T_world_camera` as calibration states it, OpenCV's axes.
      rays: `(height * width, 3)`, of each pixel in the world's axes, likewise; times the depth it is the way
        from the camera to the point.
      misread: `(3, 3)`, by how much calibration turns what is there; None where it is right.
    """

    depth: Float[np.ndarray, "height width"]
    instance: Int[np.ndarray, "height width"]
    exact: RayImage
    intrinsics: Intrinsics
    pose: Float[np.ndarray, "4 4"]
    rays: Float[np.ndarray, "pixels 3"]
    misread: Float[np.ndarray, "3 3"] | None = None

    @property
    def ideal(self) -> bool:
        """Whether the sensor has no noise."""
        return self.depth is self.exact.depth


class CameraRig:
    """Renders the configured cameras; noise follows from the episode's seed, the time and a camera's place among them alone.

    Attributes:
      names: Of the cameras, as in the model.
    """

    def __init__(
        self,
        config: SensorConfig,
        arena: composer.Arena,
        instances: Mapping[str, composer.Entity],
    ) -> None:
        """Adds the user's cameras to the arena.

        Args:
          config: What to render, and how well.
          arena: The scene, not compiled yet.
          instances: What segmentation tells apart, counted from 1.

        Raises:
          InputError: A camera does not exist, or one of the user's has the name of another.
        """
        self.names = config.camera_names
        self._config = config
        self._entities = tuple(instances.values())
        known = [c.full_identifier for c in arena.mjcf_model.find_all("camera")]
        for camera in config.cameras:
            if isinstance(camera, CameraView):
                _add_camera(arena, camera, known)
            elif camera not in known:
                raise unknown_name("camera", camera, known)
        self._camera = RayCamera(config.height, config.width)
        self._memories: dict[str, RayMemory] = {}
        self._cache = StepCache()
        self._owners: Int[np.ndarray, "ngeom"] | None = None
        self._painter: Painter | None = None
        self._colours: SurfaceColours | None = None
        self._rays: dict[str, tuple[Intrinsics, np.ndarray, np.ndarray]] = {}
        self._model: object = None
        self._seed = 0

    def require_renderer(self) -> None:
        """Find out which renderer `rgb` will use, and log it.

        Raises:
          InputError: GL was asked for and does not work here; says what to install.
        """
        used = "GL" if binds_gl(self._config.renderer) else "rays"
        _log.info("rgb is rendered by %s", used)

    def forget(self, seed: int) -> None:
        """Drop what was rendered, and draw noise from this seed from now on."""
        self._cache.forget()
        self._memories.clear()
        self._owners = None
        self._seed = seed

    def close(self) -> None:
        """Free what GL holds."""
        if self._painter is not None:
            self._painter.close()
        self._painter = None

    def frame(self, physics: mjcf.Physics, camera: str) -> Frame:
        """Depth and segmentation."""
        return self._cache.get(physics, camera, lambda: self._measured(physics, camera))

    def rgb(self, physics: mjcf.Physics, camera: str) -> UInt8[np.ndarray, "height width 3"]:
        """The colour picture, without goal markers."""
        return self._cache.get(physics, f"rgb {camera}", lambda: self._painted(physics, camera))

    def colours(
        self, physics: mjcf.Physics, camera: str, pixels: Int[np.ndarray, "n"]
    ) -> UInt8[np.ndarray, "n 3"]:
        """The colours of the surfaces there, without light and shadow; black where nothing is.

        Args:
          physics: The scene's.
          camera: Its name.
          pixels: Indices in the flat image.
        """
        self._follow(physics)
        assert self._colours is not None
        plain = self._cache.get(physics, "plain colours", self._plain_colours)
        frame = self.frame(physics, camera)
        geoms = frame.exact.geom_id.ravel()[pixels]
        colours = plain[geoms]
        textured = np.flatnonzero(self._colours.textured[geoms] & (geoms >= 0))
        if len(textured):
            depth = frame.exact.depth.ravel()[pixels[textured], None]
            eye = camera_pose(physics.model.ptr, physics.data.ptr, camera)[:3, 3]
            rays = self._true_rays(physics, camera, frame.intrinsics)
            points = eye + rays[pixels[textured]] * depth
            linear = self._colours.at(physics.data.ptr, points, geoms[textured])
            colours[textured] = _as_bytes(linear)
        return colours

    def _plain_colours(self) -> UInt8[np.ndarray, "ngeom1 3"]:
        """Of all geoms but for textures, and black at the end, which is where nothing, -1, finds it."""
        assert self._colours is not None
        return np.pad(_as_bytes(self._colours.plain()), ((0, 1), (0, 0)))

    def pose(self, physics: mjcf.Physics, camera: str) -> Float[np.ndarray, "4 4"]:
        """`T_world_camera` as calibration states it, OpenCV's axes."""
        true = camera_pose(physics.model.ptr, physics.data.ptr, camera)
        error = self._config.camera_error
        return true @ error.drawn(self._seed, f"camera {camera}") if error else true

    def intrinsics(self, physics: mjcf.Physics, camera: str) -> Intrinsics:
        """The pinhole of a camera's images."""
        return camera_intrinsics(physics.model.ptr, camera, self._config.height, self._config.width)

    def _measured(self, physics: mjcf.Physics, camera: str) -> Frame:
        model, data = physics.model.ptr, physics.data.ptr
        index = camera_id(model, camera)
        memory = self._memories.setdefault(camera, RayMemory())
        exact = self._camera.render(model, data, index, memory)
        if self._owners is None:
            self._owners = geom_instances(model, self._bodies(physics)) + 1
        # What has no instance, and what is nothing, is 0.
        instance = np.maximum(pixel_instances(exact.geom_id, self._owners), 0)
        pose, intrinsics = self.pose(physics, camera), self.intrinsics(physics, camera)
        rays = self._world_rays(camera, pose[:3, :3], intrinsics)
        misread = self._misread(physics, camera, pose)
        sensor = self._config.depth_sensor
        if sensor is None:
            return Frame(exact.depth, instance, exact, intrinsics, pose, rays, misread)
        true = self._true_rays(physics, camera, intrinsics)
        towards = -np.einsum("ni,ni->n", exact.normal.reshape(-1, 3), true)
        cosine = (towards / np.linalg.norm(true, axis=1)).reshape(exact.depth.shape)
        number = self.names.index(camera) + 1
        rng = np.random.default_rng((self._seed, step_number(physics), number))
        noisy = measure(exact.depth.astype(float), cosine, intrinsics, rng, sensor)
        depth = noisy.depth.astype(np.float32)
        return Frame(depth, noisy.moved(instance), exact, intrinsics, pose, rays, misread)

    def _misread(
        self, physics: mjcf.Physics, camera: str, stated: Float[np.ndarray, "4 4"]
    ) -> Float[np.ndarray, "3 3"] | None:
        if not self._config.camera_error:
            return None
        true = camera_pose(physics.model.ptr, physics.data.ptr, camera)
        return stated[:3, :3] @ true[:3, :3].T

    def _true_rays(
        self, physics: mjcf.Physics, camera: str, intrinsics: Intrinsics
    ) -> Float[np.ndarray, "pixels 3"]:
        """Of each pixel, in the world's axes as the camera really stands."""
        rotation = camera_pose(physics.model.ptr, physics.data.ptr, camera)[:3, :3]
        kept = f"{camera}, true" if self._config.camera_error else camera
        return self._world_rays(kept, rotation, intrinsics)

    def _world_rays(
        self, camera: str, rotation: Float[np.ndarray, "3 3"], intrinsics: Intrinsics
    ) -> Float[np.ndarray, "pixels 3"]:
        """Of each pixel, kept for as long as the camera does not turn."""
        kept = self._rays.get(camera)
        if kept is None or kept[0] != intrinsics or not np.array_equal(kept[1], rotation):
            slopes = intrinsics.slopes().reshape(-1, 2)
            rays = rotated(np.concatenate([slopes, np.ones((len(slopes), 1))], axis=1), rotation)
            kept = self._rays[camera] = (intrinsics, rotation, rays)
        return kept[2]

    def _painted(self, physics: mjcf.Physics, camera: str) -> np.ndarray:
        self._follow(physics)
        if self._painter is None:
            self._painter = make_painter(
                physics.model.ptr,
                self._config.height,
                self._config.width,
                engine=self._config.renderer,
                groups=VISIBLE_GROUPS,
                shading=SENSOR_SHADING,
            )
        return self._painter.paint(physics.data.ptr, camera)

    def _follow(self, physics: mjcf.Physics) -> None:
        """Start anew when the scene was compiled anew."""
        if physics.model.ptr is not self._model:
            self.close()
            self._model = physics.model.ptr
            self._colours = SurfaceColours(physics.model.ptr)

    def _bodies(self, physics: mjcf.Physics) -> list[int]:
        frames = [mjcf.get_attachment_frame(e.mjcf_model) for e in self._entities]
        return [int(physics.bind(frame).element_id) for frame in frames]


def _as_bytes(linear: Float[np.ndarray, "n 3"]) -> UInt8[np.ndarray, "n 3"]:
    return np.round(255 * to_display(linear)).astype(np.uint8)


def _add_camera(arena: composer.Arena, view: CameraView, known: list[str]) -> None:
    if view.name in known:
        raise InputError(
            f"camera {view.name!r}: the scene has one of that name; its own: {', '.join(known)}"
        )
    arena.mjcf_model.worldbody.add(
        "camera",
        name=view.name,
        pos=view.position,
        xyaxes=look_at(view.position, view.target),
        fovy=view.fovy,
    )
