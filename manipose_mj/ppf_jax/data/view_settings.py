"""From where objects are seen: the settings of the tables and of training, and their camera poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from manipose_mj.errors import unknown_name
from manipose_mj.mjcf.cameras.depth_noise import KINECT, StructuredLight
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import compose, invert, rotation_about


@dataclass(frozen=True)
class ViewSetting:
    """How views of an object are drawn.

    Attributes:
      name: For people; the other fields are what counts.
      placement: `"anywhere"`: orientation uniform on SO(3). `"resting"`: in a stable pose on a table,
        seen from the upper hemisphere. `"tasks"`: the same, by the tasks' fixed cameras.
      image_heights: One of them is drawn for each view; the aspect is 4:3 [pixels].
      distance: From the camera, uniform [m]; the tasks' cameras have their own.
      elevation: Of the camera above the table, its sine uniform [rad].
      off_centre: How far from the image's middle the object may be, as a share of the half image.
      occluded: Share of views in which something in front hides a part.
      bleed: How far the segmentation's outline strays [pixels of the sensor's focal length].
      sensor: None for exact depth.
      taper: How much wider or narrower the upper end of an object may be drawn than it is, as a share
        (`tapering.py`); of rigid objects of the catalogue.
      cameras: Least and most that look at once; what more than one sees is one cloud.
    """

    name: str
    placement: Literal["anywhere", "resting", "tasks"]
    image_heights: tuple[int, ...] = (480,)
    distance: tuple[float, float] = (0.5, 1.0)
    elevation: tuple[float, float] = (np.deg2rad(10.0), np.deg2rad(80.0))
    off_centre: float = 0.5
    occluded: float = 0.0
    bleed: float = 0.7
    sensor: StructuredLight | None = KINECT
    taper: float = 0.0
    cameras: tuple[int, int] = (1, 1)


_ANYWHERE = ViewSetting("anywhere", "anywhere")
SETTINGS: dict[str, ViewSetting] = {
    setting.name: setting
    for setting in (
        _ANYWHERE,
        ViewSetting("resting", "resting"),
        ViewSetting("tasks", "tasks"),
        replace(_ANYWHERE, name="occluded", occluded=1.0),
        replace(_ANYWHERE, name="clean", bleed=0.0, sensor=None),
        # What networks learn from: every distance and image size that the others have, and more hidden.
        replace(
            _ANYWHERE,
            name="training",
            image_heights=(120, 240, 480, 480),
            distance=(0.5, 1.3),
            off_centre=0.7,
            occluded=0.3,
            taper=0.2,
        ),
        # The same for networks that look through several cameras.
        ViewSetting(
            "several",
            "anywhere",
            image_heights=(120, 240, 480),
            distance=(0.5, 1.3),
            off_centre=0.7,
            occluded=0.4,
            cameras=(2, 4),
        ),
        ViewSetting(
            "several_tasks",
            "tasks",
            image_heights=(120, 240, 240, 480),
            occluded=0.4,
            cameras=(1, 7),
        ),
    )
}


def view_setting(name: str) -> ViewSetting:
    """The setting of this name.

    Raises:
      InputError: There is none.
    """
    if name not in SETTINGS:
        raise unknown_name("view setting", name, SETTINGS)
    return SETTINGS[name]


@dataclass(frozen=True)
class Placement:
    """Where an object is in front of a camera, and on what.

    Attributes:
      T_camera_mesh: `(4, 4)`.
      intrinsics: Of the whole image.
      ground: `(point, normal)` of a plane in the camera frame, the normal towards the camera; None
        for nothing.
    """

    T_camera_mesh: Float[np.ndarray, "4 4"]
    intrinsics: Intrinsics
    ground: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]] | None


def place_before_several(
    setting: ViewSetting,
    centre: Float[np.ndarray, "3"],
    radius: float,
    rests: list[tuple[Float[np.ndarray, "3 3"], float, float]],
    rng: np.random.Generator,
) -> list[Placement]:
    """Draw an object before as many cameras as `setting.cameras` says; arguments as of `place`.

    The tasks' usual ones, of each of which an object may be out of sight, or some of all that tasks have.
    """
    least, most = setting.cameras
    if setting.placement != "tasks":
        count = int(rng.integers(least, most + 1))
        return [place(setting, centre, radius, rests, rng) for _ in range(count)]
    T_world_mesh = _on_task_table(rests, rng)
    if rng.random() < _USUAL:
        views = [view for view in _TASK_CAMERAS if rng.random() > _OUT_OF_SIGHT]
        views = views if len(views) >= least else list(_TASK_CAMERAS)
    else:
        every = task_views()
        count = int(rng.integers(least, min(most, len(every)) + 1))
        views = [list(every)[i] for i in rng.choice(len(every), count, replace=False)]
    return [
        _on_table(T_world_mesh, _task_camera(view), _drawn_intrinsics(setting, rng))
        for view in views
    ]


def place(
    setting: ViewSetting,
    centre: Float[np.ndarray, "3"],
    radius: float,
    rests: list[tuple[Float[np.ndarray, "3 3"], float, float]],
    rng: np.random.Generator,
) -> Placement:
    """Draw a view.

    Args:
      setting: How.
      centre: Of the object's bounding box, mesh frame [m].
      radius: Half the diagonal of the bounding box [m].
      rests: Rotation to the world, height of the mesh's origin [m] and probability of each way to lie
        on a table; not needed for `"anywhere"`.
      rng: Draws it.
    """
    intrinsics = _drawn_intrinsics(setting, rng)
    if setting.placement == "tasks":
        T_world_mesh = _on_task_table(rests, rng)
        view = _TASK_CAMERAS[rng.integers(len(_TASK_CAMERAS))]
        return _on_table(T_world_mesh, _task_camera(view), intrinsics)
    if setting.placement == "anywhere":
        rotation = Rotation.random(random_state=rng).as_matrix()
        position = rng.uniform(*setting.distance) * _unit(_off_centre(setting, intrinsics, rng))
        pose = compose(rotation, position - rotation @ centre)
        return Placement(pose, intrinsics, _wall(position, radius, rng))
    T_world_mesh = _resting(rests, rng)
    target = T_world_mesh[:3, :3] @ centre + T_world_mesh[:3, 3]
    return _on_table(T_world_mesh, _above(target, setting, intrinsics, rng), intrinsics)


def task_views() -> dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Where the tasks' fixed cameras are, those over the robot's shoulders included, and what they look at [m]."""
    from manipose_mj.mjcf.arena import FIXED_CAMERAS  # loads dm_control

    fixed = {name: (position, target) for name, (position, target, _) in FIXED_CAMERAS.items()}
    return {**fixed, **_OVER_SHOULDERS}


def _on_table(
    T_world_mesh: Float[np.ndarray, "4 4"],
    T_world_camera: Float[np.ndarray, "4 4"],
    intrinsics: Intrinsics,
) -> Placement:
    T_camera_world = invert(T_world_camera)
    ground = (T_camera_world[:3, 3], T_camera_world[:3, 2])
    return Placement(T_camera_world @ T_world_mesh, intrinsics, ground)


def _on_task_table(
    rests: list[tuple[Float[np.ndarray, "3 3"], float, float]], rng: np.random.Generator
) -> Float[np.ndarray, "4 4"]:
    T_world_mesh = _resting(rests, rng)
    T_world_mesh[:3, 3] += np.array([rng.uniform(*_TASK_X), rng.uniform(*_TASK_Y), 0.0])
    return T_world_mesh


def _task_camera(view: str) -> Float[np.ndarray, "4 4"]:
    position, target = (np.array(point) for point in task_views()[view])
    return compose(_looking(position, target), position)


def _drawn_intrinsics(setting: ViewSetting, rng: np.random.Generator) -> Intrinsics:
    return task_intrinsics(int(rng.choice(setting.image_heights)))


# Of `manipose_mj.tasks.single_object.target_pose` [m], and the cameras that tasks fuse by default.
_TASK_X, _TASK_Y = (0.38, 0.60), (-0.28, 0.28)
_TASK_CAMERAS = ("front", "left", "right")
# As in `manipose_mj.control.perception.camera_rig`, which this package may not know.
_LOOKED_AT = (0.72, 0.0, 0.15)
_OVER_SHOULDERS = {
    "above": ((-0.35, 0.0, 1.25), _LOOKED_AT),
    "left_shoulder": ((-0.05, 0.6, 0.75), _LOOKED_AT),
    "right_shoulder": ((-0.05, -0.6, 0.75), _LOOKED_AT),
}
_USUAL, _OUT_OF_SIGHT = 0.7, 0.15  # shares of rigs, and of each of their cameras
TASK_FOVY = np.deg2rad(45.0)  # of the tasks' fixed cameras, and at 480 rows about the Kinect's
_ROLL = np.deg2rad(10.0)  # deviation of a hand-mounted camera's roll


def task_intrinsics(height: int) -> Intrinsics:
    """The tasks' pinhole at 4:3 and this many rows."""
    width = height * 4 // 3
    focal = 0.5 * height / np.tan(0.5 * TASK_FOVY)
    return Intrinsics(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))


def _off_centre(
    setting: ViewSetting, intrinsics: Intrinsics, rng: np.random.Generator
) -> Float[np.ndarray, "3"]:
    half = 0.5 * np.array([intrinsics.width / intrinsics.fx, intrinsics.height / intrinsics.fy])
    return np.append(rng.uniform(-1, 1, 2) * setting.off_centre * half, 1.0)


def _wall(position: np.ndarray, radius: float, rng: np.random.Generator):
    """Half the time a plane behind the object, at any angle, never through it."""
    if rng.random() < 0.5:
        return None
    normal = _unit(-_unit(position) + 0.5 * rng.standard_normal(3))
    return position - (radius + rng.uniform(0.0, 0.5)) * normal, normal


def _resting(
    rests: list[tuple[Float[np.ndarray, "3 3"], float, float]], rng: np.random.Generator
) -> Float[np.ndarray, "4 4"]:
    share = np.array([probability for _, _, probability in rests])
    rotation, height, _ = rests[rng.choice(len(rests), p=share / share.sum())]
    yaw = rotation_about(np.array([0.0, 0.0, 1.0]), rng.uniform(-np.pi, np.pi))
    return compose(yaw @ rotation, np.array([0.0, 0.0, height]))


def _above(
    target: np.ndarray, setting: ViewSetting, intrinsics: Intrinsics, rng: np.random.Generator
) -> Float[np.ndarray, "4 4"]:
    sine = rng.uniform(*np.sin(setting.elevation))
    azimuth, cosine = rng.uniform(-np.pi, np.pi), np.sqrt(1 - sine**2)
    towards = np.array([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine])
    position = target + rng.uniform(*setting.distance) * towards
    looking = _looking(position, target) @ rotation_about(
        np.array([0.0, 0.0, 1.0]), rng.normal(0.0, _ROLL)
    )
    seen_along = _unit(_off_centre(setting, intrinsics, rng))
    turn, _ = Rotation.align_vectors(np.array([[0.0, 0.0, 1.0]]), seen_along[None])
    return compose(looking @ turn.as_matrix(), position)


def _looking(position: np.ndarray, target: np.ndarray) -> Float[np.ndarray, "3 3"]:
    """OpenCV's camera axes in the world, its y as far down as can be."""
    forward = _unit(target - position)
    right = _unit(np.cross(forward, [0.0, 0.0, 1.0]))
    return np.stack([right, np.cross(forward, right), forward], axis=1)


def _unit(vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    return vector / np.linalg.norm(vector)
