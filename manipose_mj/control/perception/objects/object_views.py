"""What each camera sees of one object: the crops that a pose estimator looks at.

Read from a task's observations of depth and segmentation, and from nothing else of the simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation.observable import Observable
from jaxtyping import Bool, Float, UInt8

from manipose_mj.mjcf.cameras.clouds import subset
from manipose_mj.mjcf.cameras.depth_normals import depth_normals
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import transform

MAX_VIEW_POINTS = 256  # what an estimator samples of a cloud: one padded size, one compilation


@dataclass(frozen=True)
class ViewImage:
    """The whole image that an object was cut out of.

    Attributes:
      depth: [m]; 0 where nothing was measured.
      mask: The object's pixels, as the segmentation has them.
      intrinsics: Of the image.
      rgb: Renders its colours.
    """

    depth: Float[np.ndarray, "height width"]
    mask: Bool[np.ndarray, "height width"]
    intrinsics: Intrinsics
    rgb: Callable[[], UInt8[np.ndarray, "height width 3"]]


@dataclass(frozen=True)
class ObjectView:
    """One camera's points on one object.

    Attributes:
      camera: Its name.
      T_world_camera: `(4, 4)`, OpenCV's axes.
      points: `(n, 3)` float32 [m], camera frame.
      normals: `(n, 3)` float32, unit, towards the camera, camera frame.
      image: That it was cut out of.
      mesh: Vertices and faces of the object in the frame of its label, where an estimator is to have them.
    """

    camera: str
    T_world_camera: Float[np.ndarray, "4 4"]
    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    image: ViewImage
    mesh: Mapping[str, np.ndarray] | None = None

    def __len__(self) -> int:
        return len(self.points)

    @property
    def points_world(self) -> Float[np.ndarray, "n 3"]:
        """The points in the world frame [m]."""
        return transform(self.T_world_camera, self.points.astype(float))


def seen_points(views: Sequence[ObjectView]) -> Float[np.ndarray, "n 3"]:
    """What all cameras see, in the world frame [m]."""
    return np.concatenate([view.points_world for view in views])


class ObjectViews:
    """Crops objects out of a task's depth images by its segmentation."""

    def __init__(self, observables: Mapping[str, Observable], cameras: Sequence[str]) -> None:
        """Looks at nothing yet.

        Args:
          observables: Of the task, enabled or not.
          cameras: Names of those to look through.
        """
        self._observables = observables
        self._cameras = tuple(cameras)

    def of(self, physics: mjcf.Physics, name: str) -> tuple[ObjectView, ...]:
        """What the cameras see of an object now, each camera that sees anything of it.

        Args:
          physics: That the sensors measure.
          name: Of the object, as the task's goals call it.
        """
        number = int(self._read(physics, f"segmentation/ids/{name}")[0])
        found = []
        for camera in self._cameras:
            depth = self._read(physics, f"depth/{camera}")
            segmented = self._read(physics, f"segmentation/{camera}") == number
            mask = segmented & (depth > 0)
            if not mask.any():
                continue
            pose = self._read(physics, f"camera/{camera}/pose")
            matrix = self._read(physics, f"camera/{camera}/intrinsics")
            rgb = partial(self._read, physics, f"rgb/{camera}")
            image = ViewImage(depth, segmented, _intrinsics(matrix, depth.shape), rgb)
            found.append(_view(camera, pose, image, mask))
        return tuple(found)

    def _read(self, physics: mjcf.Physics, key: str) -> np.ndarray:
        return np.asarray(self._observables[key](physics))


def _view(
    camera: str,
    pose: Float[np.ndarray, "4 4"],
    image: ViewImage,
    mask: Bool[np.ndarray, "height width"],
) -> ObjectView:
    """The view of the pixels in `mask`, all of which are measured."""
    depth, intrinsics = image.depth, image.intrinsics
    pixels = np.argwhere(mask)
    pixels = pixels[subset(len(pixels), MAX_VIEW_POINTS)]
    measured = depth[pixels[:, 0], pixels[:, 1], None].astype(float)
    slopes = (pixels[:, ::-1] - [intrinsics.cx, intrinsics.cy]) / [intrinsics.fx, intrinsics.fy]
    points = np.concatenate([slopes, np.ones((len(pixels), 1))], axis=1) * measured
    normals = depth_normals(depth, mask, pixels, intrinsics)
    return ObjectView(camera, pose, points.astype(np.float32), normals.astype(np.float32), image)


def _intrinsics(matrix: Float[np.ndarray, "3 3"], shape: tuple[int, ...]) -> Intrinsics:
    fx, fy, cx, cy = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return Intrinsics(shape[1], shape[0], fx, fy, cx, cy)
