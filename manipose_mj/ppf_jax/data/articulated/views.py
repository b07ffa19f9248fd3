"""Views of furniture whose parts stand open by random amounts, each point knowing its part.

As `rendering` draws rigid objects: exact depth by the tasks' pinhole, a table underneath, the noise of a
structured-light camera, cut out by an outline that strays, with the normals that the noisy depth
supports.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import zoom

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.depth_noise import KINECT, structured_light
from manipose_mj.mjcf.cameras.depth_normals import depth_normals
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import compose, invert, rotation_about, transform
from manipose_mj.ppf_jax.data.articulated.furniture_view import (
    FurnitureView,
    kept_directions,
    kept_places,
    thinned,
)
from manipose_mj.ppf_jax.data.articulated.region_of_interest import RegionOfInterest
from manipose_mj.ppf_jax.data.articulated.subject import ArticulatedSubject
from manipose_mj.ppf_jax.data.rasteriser import Triangles, pixel_rays, rasterise
from manipose_mj.ppf_jax.data.view_settings import task_intrinsics

TABLE_ITEM = 0  # what a pixel shows: the table, the base, or a part's index and 2
BASE_ITEM = 1
_MARGIN = 12  # around the object [pixels]
_SLACK = 0.005  # around a handle's box, for noise [m]
_NEAREST = 0.3  # of anything drawn [m]
_BLEED = 0.7  # how far the segmentation's outline strays [pixels at 480 rows]
_DRAWS = 60
_SPOTS = 3  # of a view, besides handles
_ABOVE = 0.03  # the surface they are, at most [m]


@dataclass(frozen=True)
class FurnitureSetting:
    """From where furniture is seen, and how far it stands open.

    Attributes:
      image_heights: One of them is drawn for each view [pixels].
      azimuth: Largest angle from the front, either way [rad].
      elevation: Of the camera above the point it looks at [rad].
      distance: To that point, uniform [m].
      shut: Share of parts that are shut, besides the scenes in which all are.
      all_shut: Share of scenes in which everything is shut.
      points: Of a view, at most: an even sample.
      dense_regions: Whether many more points are kept around handles, and around other spots as well.
    """

    image_heights: tuple[int, ...] = (480,)
    azimuth: float = float(np.deg2rad(72.0))
    elevation: tuple[float, float] = (float(np.deg2rad(-5.0)), float(np.deg2rad(60.0)))
    distance: tuple[float, float] = (0.6, 1.6)
    shut: float = 0.4
    all_shut: float = 0.2
    points: int = 65_536
    dense_regions: bool = False


FURNITURE_SETTINGS: dict[str, FurnitureSetting] = {
    "front": FurnitureSetting(),
    "training": FurnitureSetting(image_heights=(240, 240, 480), points=4096, dense_regions=True),
}


def random_openings(
    subject: ArticulatedSubject, setting: FurnitureSetting, rng: np.random.Generator
) -> Float[np.ndarray, "parts"]:
    """How far each part stands open [m or rad]."""
    travel = np.array([joint.travel for joint in subject.joints])
    opened = rng.random(len(travel)) >= setting.shut
    if rng.random() < setting.all_shut:
        opened[:] = False
    return np.where(opened, travel * rng.random(len(travel)), 0.0)


def render_furniture(
    subject: ArticulatedSubject,
    openings: Float[np.ndarray, "parts"],
    setting: FurnitureSetting,
    rng: np.random.Generator,
    *,
    least: int = 256,
    placement: Literal["front", "around"] = "front",
) -> FurnitureView:
    """One view of the furniture as it stands.

    Args:
      subject: What is seen.
      openings: Of its parts [m or rad].
      setting: From where, and how well.
      rng: Draws all that is random.
      least: Points that a view must show.
      placement: The camera before the front, or anywhere around.

    Raises:
      InputError: Hardly any view shows enough of it.
    """
    for _ in range(_DRAWS):
        pose, height = _camera(subject, setting, placement, rng)
        view = view_from(subject, openings, pose, height, rng, setting)
        if view is not None and len(view.places) >= least:
            return view
    raise InputError(
        f"{subject.name}: {_DRAWS} views in a row show fewer than {least} points; is it in metres?"
    )


def view_from(
    subject: ArticulatedSubject,
    openings: Float[np.ndarray, "parts"],
    T_camera_object: Float[np.ndarray, "4 4"],
    height: int,
    rng: np.random.Generator,
    setting: FurnitureSetting,
) -> FurnitureView | None:
    """What a camera sees from a given place; None if a part is too near to it or nothing is seen."""
    motions = [joint.motion(q) for joint, q in zip(subject.joints, openings, strict=True)]
    items = [(_TABLE, T_camera_object), (subject.base, T_camera_object)]
    items += [
        (mesh, T_camera_object @ motion)
        for mesh, motion in zip(subject.parts, motions, strict=True)
    ]
    corners = [transform(T_camera_object, subject.hull)]
    corners += [transform(pose, mesh.corners.reshape(-1, 3)) for mesh, pose in items[2:]]
    corners = np.concatenate(corners)
    if corners[:, 2].min() < _NEAREST:
        return None
    k = _window(task_intrinsics(height), corners)
    drawn = rasterise(items, k)
    rays = pixel_rays(k)
    cosine = -np.einsum("hwi,hwi->hw", drawn.normal, rays) / np.linalg.norm(rays, axis=-1)
    depth = structured_light(drawn.depth, cosine, k, rng, KINECT)
    mask = _strayed(drawn.item >= BASE_ITEM, _BLEED * height / 480, rng) & (depth > 0)
    pixels = np.argwhere(mask)
    if not len(pixels):
        return None
    item = drawn.item[pixels[:, 0], pixels[:, 1]]
    points = rays[pixels[:, 0], pixels[:, 1]] * depth[pixels[:, 0], pixels[:, 1]][:, None]
    part = np.where(item > BASE_ITEM, item - BASE_ITEM - 1, -1)
    handle = np.zeros(len(points), bool)
    counts = np.zeros(len(subject.joints), np.int32)
    for i, (joint, motion) in enumerate(zip(subject.joints, motions, strict=True)):
        own = part == i
        local = transform(invert(T_camera_object @ motion @ joint.handle), points[own])
        inside = np.all(np.abs(local) < joint.handle_extents / 2 + _SLACK, axis=1)
        handle[np.flatnonzero(own)[inside]] = True
        counts[i] = round(int(inside.sum()) * (480 / height) ** 2)
    spots = np.zeros((0, 2, 3))
    if setting.dense_regions:
        grips = np.array(
            [T_camera_object @ m @ j.handle for m, j in zip(motions, subject.joints, strict=True)]
        )
        handles = np.stack([grips[:, :3, 3], grips[:, :3, 1]], axis=1)
        front = (T_camera_object[:3, :3] @ subject.label.rotation)[:, 1]
        ways = np.concatenate([handles[:, 1], front[None]])  # of the parts, and of the base
        seen = rng.integers(len(points), size=_SPOTS)
        above = rng.uniform(0.0, _ABOVE, (_SPOTS, 1)) * ways[part[seen]]
        spots = np.stack([points[seen] + above, ways[part[seen]]], axis=1)
        rows, even = thinned(
            points, np.concatenate([handles, spots]), setting.points, RegionOfInterest(), rng
        )
    else:
        rows = rng.permutation(len(pixels))[: setting.points]
        even = len(rows)
    return FurnitureView(
        places=kept_places(points[rows]),
        directions=kept_directions(depth_normals(depth, mask, pixels[rows], k)),
        part=part[rows].astype(np.int8),
        handle=handle[rows],
        pose=T_camera_object.astype(np.float32),
        handle_pixels=counts,
        even=even,
        pixels=len(pixels) * (480 / height) ** 2,
        spots=spots.astype(np.float32),
    )


def _camera(
    subject: ArticulatedSubject, setting: FurnitureSetting, placement: str, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "4 4"], int]:
    """`T_camera_object` of a random camera, nearly upright, and the rows of its image."""
    rotation, half = subject.label.rotation, subject.label.extents / 2
    up, front, side = rotation.T
    # Looks at a point of the box, rather of its front.
    share = rng.uniform([-0.8, 0.0, -0.8], [0.8, 1.0, 0.8]) * half
    target = subject.label.origin + rotation @ share
    around = placement == "around"
    azimuth = np.pi if around else setting.azimuth
    a, e = rng.uniform(-azimuth, azimuth), rng.uniform(*setting.elevation)
    towards = np.cos(e) * (np.cos(a) * front + np.sin(a) * side) + np.sin(e) * up
    position = target + rng.uniform(*setting.distance) * towards
    forward = -towards
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    looking = np.stack([right, np.cross(forward, right), forward], axis=1)
    looking = looking @ rotation_about(np.array([0.0, 0.0, 1.0]), rng.normal(0.0, 0.15))
    return invert(compose(looking, position)), int(rng.choice(setting.image_heights))


def _window(k: Intrinsics, corners: Float[np.ndarray, "c 3"]) -> Intrinsics:
    """The part of the image that can show the object, at least a few pixels."""
    u = np.clip(k.fx * corners[:, 0] / corners[:, 2] + k.cx, 0, k.width - 1)
    v = np.clip(k.fy * corners[:, 1] / corners[:, 2] + k.cy, 0, k.height - 1)
    left, top = max(int(u.min()) - _MARGIN, 0), max(int(v.min()) - _MARGIN, 0)
    right = min(int(u.max()) + _MARGIN, k.width)
    bottom = min(int(v.max()) + _MARGIN, k.height)
    return replace(k, width=right - left, height=bottom - top, cx=k.cx - left, cy=k.cy - top)


def _strayed(
    mask: Bool[np.ndarray, "height width"], reach: float, rng: np.random.Generator
) -> Bool[np.ndarray, "height width"]:
    """A mask that is shifted smoothly by about `reach` pixels, elsewhere elsewhere."""
    grid = [-(-side // 12) + 1 for side in mask.shape]
    index = np.indices(mask.shape)
    moved = []
    for axis, side in enumerate(mask.shape):
        scale = [full / coarse for full, coarse in zip(mask.shape, grid, strict=True)]
        shift = zoom(reach * rng.standard_normal(grid), scale, order=1)
        shift = shift[: mask.shape[0], : mask.shape[1]]
        moved.append(np.clip(np.rint(index[axis] + shift).astype(int), 0, side - 1))
    return mask[moved[0], moved[1]]


_S = 3.0  # half the table's side [m]
_TABLE = Triangles(
    np.array(
        [
            [[-_S, -_S, 0.0], [_S, -_S, 0.0], [_S, _S, 0.0]],
            [[-_S, -_S, 0.0], [_S, _S, 0.0], [-_S, _S, 0.0]],
        ]
    )
    - [0.0, 0.0, 1e-4],
    False,
)
