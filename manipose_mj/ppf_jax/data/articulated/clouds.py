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
from manipose_mj.ppf_jax.data.articulated.furniture_view import SLIP, FurnitureView
from manipose_mj.ppf_jax.data.articulated.region_of_interest import (
    RegionOfInterest,
    region_training_rows,
)
from manipose_mj.ppf_jax.data.articulated.subject import JointLabel
from manipose_mj.ppf_jax.data.view_settings import TASK_FOVY

Array = Any  # a NumPy or a JAX array

BATCH_POINTS = 2048  # of a cloud as the networks see it
MAX_PARTS = 12  # of furniture that is trained on
CLOUD_POINTS = 65_536  # of a cloud, at most
# How far from a handle a region of interest may be, in training: mostly, and as often as `_LOST` says [m].
_NEAR_OFF, _FAR_OFF, _LOST = 0.010, 0.030, 0.4
_HEIGHT_OFF = 0.005  # along the handle's Y [m]
_ASTRAY = 0.15  # share of clouds whose regions of interest hold no handle
_TILT = (0.04, 0.20)  # of what is taken for that Y, mostly and seldom [rad]


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
      even: `(n,)`, which points are an even sample of what was seen; the others are more from around
        handles and spots, for training.
      spots: `(s, 2, 3)`, other such places [m] and which way is out there.
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
    even: Bool[np.ndarray, "n"]
    spots: Float[np.ndarray, "s 2 3"]


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


def fused_cloud(scene: FurnitureScene, chosen: Sequence[int]) -> FurnitureCloud:
    """The cloud of some of a scene's views, in the camera frame of the first of them.

    Args:
      scene: With its views.
      chosen: Which of them; of each, as large a share of what it saw.
    """
    views = [scene.views[i] for i in chosen]
    pose = views[0].pose.astype(float)
    # Rows for a pixel: as many as every view has, and all have room for.
    rate = min(view.even / view.pixels for view in views)
    rate = min(rate, CLOUD_POINTS / sum(view.pixels for view in views))
    columns: dict[str, list[np.ndarray]] = {name: [] for name in _COLUMNS}
    for view in views:
        kept = int(rate * view.pixels + 1e-6)
        rows = slice(None)
        if kept < view.even:
            rows = np.concatenate([np.arange(kept), np.arange(view.even, len(view.part))])
        points, normals, spots = view.points[rows], view.normals[rows], view.spots
        if view is not views[0]:
            T_first_own = (pose @ invert(view.pose.astype(float))).astype(np.float32)
            turn, shift = T_first_own[:3, :3], T_first_own[:3, 3]
            points, normals = points @ turn.T + shift, normals @ turn.T
            spots = spots @ turn.T + np.stack([shift, 0 * shift])
        own = (points, normals, view.part[rows], view.handle[rows], np.arange(len(points)) < kept)
        for name, values in zip(_COLUMNS, (*own, spots), strict=True):
            columns[name].append(values)
    ends, feet = _reference_points(scene)
    return FurnitureCloud(
        scene=scene,
        pose=pose,
        handle_pixels=np.sum([view.handle_pixels for view in views], axis=0),
        handle_framed=np.any([_framed(view, ends).all(axis=1) for view in views], axis=0),
        axis_framed=np.any([_framed(view, feet) for view in views], axis=0),
        **{name: np.concatenate(rows) for name, rows in columns.items()},
    )


_COLUMNS = ("points", "normals", "part", "handle", "even", "spots")


def _reference_points(
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
    """A batch with `points` points of every cloud: some evenly drawn, some resampled in regions of interest.

    Args:
      clouds: At least one.
      rng: Draws the points.
      points: Rows of each cloud.
      parts: Rows of each cloud's parts.
      focus: Share of the clouds of the second kind.

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
        places, outward = _supposed(cloud, handles, rng)
        chosen = region_training_rows(
            cloud.points, cloud.even, places, outward, points, RegionOfInterest(), rng
        )
    else:
        chosen = rng.permutation(np.flatnonzero(cloud.even))[:points]
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


def _supposed(
    cloud: FurnitureCloud, handles: Float[np.ndarray, "parts 4 4"], rng: np.random.Generator
) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "k 3"]]:
    """Where a first vote may take handles to be: most of them, nearly, and some places that are none."""
    # In a wrong frame there may be nothing else.
    chosen = rng.random(len(handles)) < (0.0 if rng.random() < _ASTRAY else 0.85)
    known, length = handles[chosen], np.array([j.handle_extents[0] for j in cloud.scene.joints])
    far = rng.random((len(known), 1)) < _LOST
    # Along X, Y and Z of the handle; along a long one it is hard to tell where its middle is.
    off = np.where(far, _FAR_OFF, _NEAR_OFF) * rng.normal(0.0, 1.0, (len(known), 3))
    off[:, 0] += 0.1 * length[chosen] * rng.normal(0.0, 1.0, len(known))
    off[:, 1] = _HEIGHT_OFF * rng.normal(0.0, 1.0, len(known))
    off *= np.minimum(1.0, SLIP / (np.linalg.norm(off, axis=1, keepdims=True) + 1e-9))
    places = known[:, :3, 3] + np.einsum("kij,kj->ki", known[:, :3, :3], off)
    elsewhere = cloud.spots[rng.permutation(len(cloud.spots))[: 1 + int(rng.integers(3))]]
    places = np.concatenate([places, elsewhere[:, 0]])
    outward = np.concatenate([known[:, :3, 1], elsewhere[:, 1]])
    tilt = np.where(rng.random((len(outward), 1)) < 0.8, *_TILT)
    outward = outward + tilt * rng.normal(0.0, 1.0, outward.shape)
    return places, outward / np.linalg.norm(outward, axis=1, keepdims=True)
