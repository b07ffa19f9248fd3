"""What the sensors of a task are: cameras, sizes, renderer, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from manipose_mj.errors import InputError, check_count, unknown_name
from manipose_mj.mjcf.cameras.depth_noise import KINECT, StructuredLight, is_number
from manipose_mj.mjcf.cameras.pictures import ENGINES, Engine
from manipose_mj.tasks.observations.fixed_error import FixedError

MAX_PIXELS = 8192  # along a side of a picture
DEPTH_MODELS: dict[str, StructuredLight | None] = {"ideal": None, "structured_light": KINECT}


@dataclass(frozen=True)
class CameraView:
    """A camera of your own, fixed in the world.

    Attributes:
      name: As observations will call it.
      position: [m].
      target: The point it looks at [m]; the world's z is up in the image, or its x if it looks
        straight down or up.
      fovy: Vertical field of view [deg].
    """

    name: str
    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fovy: float = 45.0

    def __post_init__(self) -> None:
        word = self.name.replace("_", "") if isinstance(self.name, str) else ""
        if not word.isalnum():
            raise InputError(f"camera name {self.name!r}: expected letters, digits and underscores")
        for field in ("position", "target"):
            object.__setattr__(self, field, _numbers(getattr(self, field)))
        numbers = (*self.position, *self.target)
        if len(numbers) != 6 or not np.isfinite(numbers).all() or self.position == self.target:
            raise InputError(
                f"camera {self.name!r}: position {self.position} and target {self.target}; "
                "expected two different points of three finite coordinates"
            )
        if not is_number(self.fovy) or not 0 < self.fovy < 180:
            raise InputError(f"camera {self.name!r}: fovy {self.fovy!r} deg; expected 0 to 180")


def _numbers(point: Any) -> tuple[float, ...]:
    """A point of any kind as a tuple of numbers, which are not finite where it is none."""
    try:
        return tuple(map(float, point))
    except (TypeError, ValueError):
        return (np.nan,) * 3


@dataclass(frozen=True)
class PoseNoise:
    """Normal errors of observed poses, of each thing for itself and in every step anew.

    Attributes:
      translation: Standard deviation along each axis [m].
      rotation: Standard deviation of the rotation vector about each axis [rad].
    """

    translation: float = 0.0
    rotation: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not is_number(value) or not 0 <= value < np.inf:
                raise InputError(f"pose noise: {name} is {value!r}; expected 0 or more")


@dataclass(frozen=True)
class SensorConfig:
    """Attributes:
    cameras: Cameras of the scene (`front`, `left`, `right`, `overview`, `panda/wrist`), or your
      own as `CameraView`. The noise of depth depends on a camera's place among them.
    height, width: Of their images [pixels].
    cloud_size: Points of the cloud that all cameras give together.
    object_cloud_size: Points of the cloud of each object.
    depth_model: `"ideal"`, `"structured_light"` (a Kinect's noise, which reaches depth, outlines of the
      segmentation and clouds), or a `StructuredLight` of your own.
    pose_noise: Of the observed poses of objects and furniture; goals are exact.
    pose_error: Of each object's observed pose, the same throughout an episode.
    camera_error: Of each camera's stated pose, likewise; images are those of the true one, clouds lie where the
      stated one puts them, and poses in a camera's frame are in the stated one.
    renderer: Of `rgb`: `"gl"`, `"ray"`, or `"auto"` for GL where it works. Depth, segmentation and
      clouds are the same everywhere: rays give them.
    """

    cameras: tuple[str | CameraView, ...] = ("front", "left", "right")
    height: int = 120
    width: int = 160
    cloud_size: int = 16384
    object_cloud_size: int = 512
    depth_model: str | StructuredLight = "ideal"
    pose_noise: PoseNoise = PoseNoise()
    pose_error: FixedError = FixedError()
    camera_error: FixedError = FixedError()
    renderer: Engine = "auto"

    def __post_init__(self) -> None:
        for name in ("height", "width", "cloud_size", "object_cloud_size"):
            check_count(f"sensors: {name}", getattr(self, name), least=1)
        for name in ("height", "width"):
            if getattr(self, name) > MAX_PIXELS:
                raise InputError(
                    f"sensors: {name} is {getattr(self, name)}; expected at most {MAX_PIXELS} pixels"
                )
        kinds = {
            "depth_model": (str, StructuredLight),
            "pose_noise": (PoseNoise,),
            "pose_error": (FixedError,),
            "camera_error": (FixedError,),
        }
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                expected = " or ".join("a name" if k is str else f"a {k.__name__}" for k in kind)
                raise InputError(f"sensors: {name} is {getattr(self, name)!r}; expected {expected}")
        if isinstance(self.cameras, str) or not isinstance(self.cameras, Sequence):
            raise InputError(f"sensors: cameras is {self.cameras!r}; expected a tuple of cameras")
        object.__setattr__(self, "cameras", tuple(self.cameras))
        names = self.camera_names
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"sensors: camera {name!r} is named {names.count(name)} times")
        if isinstance(self.depth_model, str) and self.depth_model not in DEPTH_MODELS:
            raise unknown_name("depth model", self.depth_model, DEPTH_MODELS)
        if self.renderer not in ENGINES:
            raise unknown_name("renderer", self.renderer, ENGINES)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """The names of all cameras, in their order."""
        return tuple(c.name if isinstance(c, CameraView) else c for c in self.cameras)

    @property
    def depth_sensor(self) -> StructuredLight | None:
        """The noise of depth; None if there is none."""
        if isinstance(self.depth_model, str):
            return DEPTH_MODELS[self.depth_model]
        return self.depth_model
