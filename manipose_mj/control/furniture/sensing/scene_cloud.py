"""What all cameras see of a scene, as one cloud whose points know their instance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation.observable import Observable
from jaxtyping import Bool, Float, Int

from manipose_mj.mjcf.cameras.depth_normals import depth_normals
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import invert, transform

_IN_FRONT = 0.03  # what is that much nearer to a camera hides what is behind it [m]
_BEHIND = 0.01  # what is that much further from a camera than a point leaves it free [m]


@dataclass(frozen=True)
class SceneCloud:
    """Points of several cameras.

    Attributes:
      points: `(n, 3)`, world frame [m].
      normals: `(n, 3)`, unit, towards the camera that saw the point, world frame; zero where not asked for.
      instance: `(n,)`, as the segmentation has them.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    instance: Int[np.ndarray, "n"]

    def of(self, instance: int) -> SceneCloud:
        """The points of one instance."""
        rows = self.instance == instance
        return SceneCloud(self.points[rows], self.normals[rows], self.instance[rows])

    def joined_by(self, other: SceneCloud) -> SceneCloud:
        """These points, then those of another cloud."""
        return SceneCloud(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.normals, other.normals]),
            np.concatenate([self.instance, other.instance]),
        )


@dataclass(frozen=True)
class Sight:
    """How far one camera sees. Attributes: depth `(h, w)` [m], 0 where nothing was measured; intrinsics; pose: `T_world_camera`."""

    depth: Float[np.ndarray, "h w"]
    intrinsics: Intrinsics
    pose: Float[np.ndarray, "4 4"]

    def reaches(self, points: Float[np.ndarray, "n 3"], beyond: float) -> Bool[np.ndarray, "n"]:
        """Which points, world frame [m], it would see if they were there: nothing is in front of them.

        Args:
          points: To look for.
          beyond: How far behind a point what is seen there has to be [m]; negative: how far it may be before it.
        """
        local, k = transform(invert(self.pose), points), self.intrinsics
        z = np.maximum(local[:, 2], 1e-6)
        column = np.floor(local[:, 0] / z * k.fx + k.cx + 0.5)
        row = np.floor(local[:, 1] / z * k.fy + k.cy + 0.5)
        inside = (local[:, 2] > 0) & (column >= 0) & (column < self.depth.shape[1])
        inside &= (row >= 0) & (row < self.depth.shape[0])
        measured = self.depth[row[inside].astype(int), column[inside].astype(int)]
        reached = np.zeros(len(points), bool)
        reached[inside] = (measured > 0) & (measured > z[inside] + beyond)
        return reached


def hidden_from(
    sights: Sequence[Sight], pose: Float[np.ndarray, "4 4"]
) -> Callable[[Float[np.ndarray, "n 3"]], Bool[np.ndarray, "n"]]:
    """Which points, of the frame at `pose` in the world [m], none of the cameras can see for what is in front of them."""
    return lambda points: ~_reached(sights, transform(pose, points), -_IN_FRONT)


def seen_past(
    sights: Sequence[Sight], pose: Float[np.ndarray, "4 4"]
) -> Callable[[Float[np.ndarray, "n 3"]], Bool[np.ndarray, "n"]]:
    """Which points, of the frame at `pose` in the world [m], some camera looks past: they are free."""
    return lambda points: _reached(sights, transform(pose, points), _BEHIND)


def _reached(
    sights: Sequence[Sight], points: Float[np.ndarray, "n 3"], beyond: float
) -> Bool[np.ndarray, "n"]:
    """Which points one of the cameras reaches, as `Sight.reaches`."""
    return np.any([sight.reaches(points, beyond) for sight in sights], axis=0)


class SceneViews:
    """Reads depth, segmentation and camera poses of a task's observations, and nothing else."""

    def __init__(
        self,
        observables: Mapping[str, Observable],
        cameras: Sequence[str],
        wide: Sequence[str] = (),
    ) -> None:
        """Looks at nothing yet.

        Args:
          observables: Of the task, enabled or not.
          cameras: Names of those to look through.
          wide: Names of more, which show what is large whole and all else coarsely.
        """
        self._observables = observables
        self.cameras, self.wide = tuple(cameras), tuple(wide)

    def camera_pose(self, physics: mjcf.Physics, camera: str) -> Float[np.ndarray, "4 4"]:
        """`T_world_camera`, OpenCV's axes."""
        return self._read(physics, f"camera/{camera}/pose")

    def cloud(
        self,
        physics: mjcf.Physics,
        instance: int,
        *,
        cameras: Sequence[str] | None = None,
        normals: bool = True,
    ) -> SceneCloud:
        """The measured points of one instance.

        Args:
          physics: That the sensors measure.
          instance: As the segmentation has it; 0 is what has no mask of its own.
          cameras: Through which to look; all by default.
          normals: Whether they are wanted: they take time.
        """
        points, directions = [np.zeros((0, 3))], [np.zeros((0, 3))]
        for camera in self.cameras if cameras is None else cameras:
            depth = self._read(physics, f"depth/{camera}")
            mask = (self._read(physics, f"segmentation/{camera}") == instance) & (depth > 0)
            pixels = np.argwhere(mask)
            if not len(pixels):
                continue
            pose = self.camera_pose(physics, camera)
            k = _intrinsics(self._read(physics, f"camera/{camera}/intrinsics"), depth.shape)
            slopes = (pixels[:, ::-1] - [k.cx, k.cy]) / [k.fx, k.fy]
            rays = np.concatenate([slopes, np.ones((len(pixels), 1))], axis=1)
            measured = depth[pixels[:, 0], pixels[:, 1], None].astype(float)
            points.append(transform(pose, rays * measured))
            if normals:
                directions.append(depth_normals(depth, mask, pixels, k) @ pose[:3, :3].T)
            else:
                directions.append(np.zeros((len(pixels), 3)))
        found = np.concatenate(points)
        return SceneCloud(found, np.concatenate(directions), np.full(len(found), instance))

    def sights(
        self, physics: mjcf.Physics, cameras: Sequence[str] | None = None
    ) -> tuple[Sight, ...]:
        """How far these cameras see; all by default."""
        found = []
        for camera in self.cameras if cameras is None else cameras:
            depth = self._read(physics, f"depth/{camera}")
            k = _intrinsics(self._read(physics, f"camera/{camera}/intrinsics"), depth.shape)
            found.append(Sight(depth, k, self.camera_pose(physics, camera)))
        return tuple(found)

    def _read(self, physics: mjcf.Physics, key: str) -> np.ndarray:
        return np.asarray(self._observables[key](physics))


def _intrinsics(matrix: Float[np.ndarray, "3 3"], shape: tuple[int, ...]) -> Intrinsics:
    return Intrinsics(
        shape[1],
        shape[0],
        float(matrix[0, 0]),
        float(matrix[1, 1]),
        float(matrix[0, 2]),
        float(matrix[1, 2]),
    )
