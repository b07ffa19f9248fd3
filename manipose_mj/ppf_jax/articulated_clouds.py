"""Clouds of furniture with the labels of its handles and joints, and the padded batches of training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.errors import InputError
from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.articulated_subject import JointLabel
from manipose_mj.ppf_jax.articulated_views import FurnitureView
from manipose_mj.ppf_jax.view_settings import TASK_FOVY

Array = Any  # a NumPy or a JAX array

BATCH_POINTS = 2048  # of a cloud as the networks see it
MAX_PARTS = 8  # of furniture that is trained on
CLOUD_POINTS = 8192  # of a cloud as it is kept
# In training, how wide the places are that many points are drawn from, and how far off a handle [m].
_FOCUS_WIDTH, _FOCUS_OFF = (0.03, 0.10), 0.015


@dataclass(frozen=True)
class FurnitureScene:
    """A piece of furniture whose parts stand open by given amounts, and what cameras saw of it.

    Attributes:
      name: The object and the scene, `cabinet_003/17`.
      category: Of the object.
      label: `(4, 4)`, `T_object_label` of the whole: X up, Y out of the front.
      joints: Of the parts with handles.
      openings: `(parts,)` [m or rad].
      views: At least one.
    """

    name: str
    category: str
    label: Float[np.ndarray, "4 4"]
    joints: tuple[JointLabel, ...]
    openings: Float[np.ndarray, "parts"]
    views: tuple[FurnitureView, ...]


@dataclass(frozen=True)
class FurnitureCloud:
    """What one or several cameras saw of a scene, in the frame of the first.

    Attributes:
      scene: Its labels.
      points: `(n, 3)` float32 [m].
      normals: `(n, 3)` float32, unit, each towards the camera that saw the point.
      part: `(n,)`, the part that a point belongs to; -1 for none.
      handle: `(n,)`, whether the point is on that part's handle.
      pose: `(4, 4)`, `T_camera_object`.
      handle_pixels: `(parts,)`, how many measured pixels show each handle, as if of 480 rows.
      handle_framed: `(parts,)`, whether both ends of each handle are within some camera's image.
      axis_framed: `(parts,)`, whether the point of each joint's axis that is nearest to the handle is.
    """

    scene: FurnitureScene
    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    part: Int[np.ndarray, "n"]
    handle: Bool[np.ndarray, "n"]
    pose: Float[np.ndarray, "4 4"]
    handle_pixels: Int[np.ndarray, "parts"]
    handle_framed: Bool[np.ndarray, "parts"]
    axis_framed: Bool[np.ndarray, "parts"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FurnitureBatch:
    """Clouds of one padded size with the labels of their parts; a pytree.

    Attributes:
      points: `(b, n, 3)` float32 [m], camera frames, in random order; 0 in padding.
      normals: `(b, n, 3)` float32; 0 in padding.
      mask: `(b, n)`, true for points, false for padding, which comes last.
      part: `(b, n)` int32, the part that a point belongs to; -1 for none.
      handle: `(b, n)`, whether the point is on that part's handle.
      body: `(b, 4, 4)`, `T_camera_label` of the whole: X up, Y out of the front.
      handles: `(b, parts, 4, 4)`, `T_camera_handle`.
      shut_x: `(b, parts, 3)`, the handles' X were their parts shut, camera frame.
      hinge: `(b, parts)`, whether the part turns.
      axis_origin: `(b, parts, 3)` [m], camera frame.
      axis: `(b, parts, 3)`, unit, camera frame.
      opening: `(b, parts)` [m or rad].
    """

    points: Float[Array, "b n 3"]
    normals: Float[Array, "b n 3"]
    mask: Bool[Array, "b n"]
    part: Int[Array, "b n"]
    handle: Bool[Array, "b n"]
    body: Float[Array, "b 4 4"]
    handles: Float[Array, "b parts 4 4"]
    shut_x: Float[Array, "b parts 3"]
    hinge: Bool[Array, "b parts"]
    axis_origin: Float[Array, "b parts 3"]
    axis: Float[Array, "b parts 3"]
    opening: Float[Array, "b parts"]

    def __len__(self) -> int:
        return len(self.points)


def fused_cloud(
    scene: FurnitureScene, chosen: Sequence[int], rng: np.random.Generator
) -> FurnitureCloud:
    """The cloud of some of a scene's views, in the camera frame of the first of them.

    Args:
      scene: With its views.
      chosen: Which of them.
      rng: Draws at most `CLOUD_POINTS` points.
    """
    views = [scene.views[i] for i in chosen]
    pose = views[0].pose.astype(float)
    points, normals = [], []
    for view in views:
        if view is views[0]:
            points.append(view.points)
            normals.append(view.normals)
            continue
        T_first_own = pose @ invert(view.pose.astype(float))
        points.append(transform(T_first_own, view.points.astype(float)))
        normals.append(view.normals @ T_first_own[:3, :3].T)
    rows = rng.permutation(sum(len(view.points) for view in views))[:CLOUD_POINTS]
    ends, feet = _landmarks(scene)
    return FurnitureCloud(
        scene=scene,
        points=np.concatenate(points)[rows].astype(np.float32),
        normals=np.concatenate(normals)[rows].astype(np.float32),
        part=np.concatenate([view.part for view in views])[rows],
        handle=np.concatenate([view.handle for view in views])[rows],
        pose=pose,
        handle_pixels=np.sum([view.handle_pixels for view in views], axis=0),
        handle_framed=np.any([_framed(view, ends).all(axis=1) for view in views], axis=0),
        axis_framed=np.any([_framed(view, feet) for view in views], axis=0),
    )


def _landmarks(
    scene: FurnitureScene,
) -> tuple[Float[np.ndarray, "parts 2 3"], Float[np.ndarray, "parts 3"]]:
    """Both ends of every handle, and the nearest point of its joint's axis; of a slide, the handle's centre."""
    ends, feet = np.zeros((len(scene.joints), 2, 3)), np.zeros((len(scene.joints), 3))
    for i, (joint, opening) in enumerate(zip(scene.joints, scene.openings, strict=True)):
        pose = joint.motion(opening) @ joint.handle
        half = 0.5 * joint.handle_extents[0] * pose[:3, 0]
        ends[i] = pose[:3, 3] + half, pose[:3, 3] - half
        feet[i] = pose[:3, 3]
        if joint.hinge:
            feet[i] = joint.origin + ((feet[i] - joint.origin) @ joint.axis) * joint.axis
    return ends, feet


def _framed(view: FurnitureView, points: Float[np.ndarray, "*b 3"]) -> Bool[np.ndarray, "*b"]:
    """Whether points of the object frame are within the image of a view."""
    flat = transform(view.pose.astype(float), points.reshape(-1, 3))
    half = np.tan(0.5 * TASK_FOVY) * np.array([4 / 3, 1.0])
    inside = (np.abs(flat[:, :2]) < half * flat[:, 2:]).all(axis=1)
    return inside.reshape(points.shape[:-1])


def handle_poses(cloud: FurnitureCloud) -> Float[np.ndarray, "parts 4 4"]:
    """`T_camera_handle` of every part."""
    scene = cloud.scene
    motions = [j.motion(q) for j, q in zip(scene.joints, scene.openings, strict=True)]
    return np.array([cloud.pose @ m @ j.handle for m, j in zip(motions, scene.joints, strict=True)])


def batch_furniture(
    clouds: Sequence[FurnitureCloud],
    *,
    rng: np.random.Generator,
    points: int = BATCH_POINTS,
    parts: int = MAX_PARTS,
    focus: float = 0.5,
) -> FurnitureBatch:
    """A batch with `points` points of every cloud; in some, half of them from around a few places.

    Args:
      clouds: At least one.
      rng: Draws the points.
      points: Rows of each cloud.
      parts: Rows of each cloud's parts.
      focus: Share of the clouds of which many points are drawn about handles, as an estimator does that
        looks again where it takes handles to be.

    Raises:
      InputError: No clouds, or one of furniture with more than `parts` parts.
    """
    if not clouds:
        raise InputError("no clouds to batch; expected at least one")
    rows = [_row(cloud, points, parts, rng.random() < focus, rng) for cloud in clouds]
    return FurnitureBatch(**{name: np.stack([row[name] for row in rows]) for name in rows[0]})


def _row(
    cloud: FurnitureCloud, points: int, parts: int, focused: bool, rng: np.random.Generator
) -> dict[str, Array]:
    scene, count = cloud.scene, len(cloud.scene.joints)
    if count > parts:
        raise InputError(f"{scene.name} has {count} parts with handles; expected at most {parts}")
    handles = handle_poses(cloud)
    if focused:
        chosen = _focused(cloud, handles[:, :3, 3], points, rng)
    else:
        chosen = rng.permutation(len(cloud.points))[:points]
    room = points - len(chosen)
    rotation = cloud.pose[:3, :3]

    def column(values: Any, shape: tuple[int, ...] = ()) -> Array:
        padded = np.zeros((parts, *shape), np.float32)
        padded[:count] = np.reshape(values, (count, *shape))
        return padded

    def rows(values: np.ndarray, fill: float = 0) -> Array:
        room_of = ((0, room),) + ((0, 0),) * (values.ndim - 1)
        return np.pad(values[chosen], room_of, constant_values=fill)

    origins = np.array([joint.origin for joint in scene.joints]).reshape(-1, 3)
    return {
        "points": rows(cloud.points),
        "normals": rows(cloud.normals),
        "mask": np.arange(points) < len(chosen),
        "part": rows(cloud.part.astype(np.int32), -1),
        "handle": rows(cloud.handle),
        "body": (cloud.pose @ scene.label).astype(np.float32),
        "handles": column(handles, (4, 4)),
        "shut_x": column([rotation @ joint.handle[:3, 0] for joint in scene.joints], (3,)),
        "hinge": column([joint.hinge for joint in scene.joints]) > 0,
        "axis_origin": column(transform(cloud.pose, origins), (3,)),
        "axis": column([rotation @ joint.axis for joint in scene.joints], (3,)),
        "opening": column(scene.openings),
    }


def _focused(
    cloud: FurnitureCloud,
    centres: Float[np.ndarray, "parts 3"],
    count: int,
    rng: np.random.Generator,
) -> Int[np.ndarray, "count"]:
    """Rows of which about half are near some handles, or a place that is mistaken for one."""
    some = centres[rng.random(len(centres)) < 0.8]
    strange = cloud.points[rng.integers(len(cloud.points), size=1 + int(rng.integers(2)))]
    places = np.concatenate([some + rng.normal(0.0, _FOCUS_OFF, some.shape), strange])
    width = rng.uniform(*_FOCUS_WIDTH)
    apart = np.linalg.norm(cloud.points[:, None] - places, axis=-1).min(axis=1)
    near = np.flatnonzero(apart < width)
    near = rng.permutation(near)[: count // 2]
    left = np.ones(len(cloud.points), bool)
    left[near] = False
    rest = rng.permutation(np.flatnonzero(left))[: count - len(near)]
    return rng.permutation(np.concatenate([near, rest]))
