"""The shape of an object of which no like is known: its cloud, completed by the symmetry of its type.

What has a plane of symmetry is mirrored, what is round is revolved. What no camera can see, beneath, is taken to be filled
down to the lowest point that is seen. Convex parts are cut where that saves most volume.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.ndimage import minimum_filter
from scipy.spatial import ConvexHull, QhullError, cKDTree

from manipose_mj.assets.asset import StablePose
from manipose_mj.assets.geometry import MassProperties, Shape
from manipose_mj.assets.label import ObjectType, PoseLabel
from manipose_mj.control.perception.objects.estimated_symmetry import estimated_symmetry
from manipose_mj.control.perception.objects.known_shapes import KnownShape
from manipose_mj.control.perception.objects.object_views import ObjectView, seen_points
from manipose_mj.control.perception.objects.symmetric_completion import symmetry_turns
from manipose_mj.grasp_sampling.touch_points import union_points
from manipose_mj.poses import SymmetryGroup, invert, transform

_PARTS = 8  # convex ones, at most
_SAVES = 0.08  # of the volume of a part, from which on it is cut in two
_CUTS = (0.25, 0.5, 0.75)  # of its length along each axis
_OVERLAP = 0.002  # of the two sides of a cut [m]
_FEWEST = 8  # points of a part
_THIN = 0.002  # what has no volume is made so thick [m]
_HULL_POINTS = 500  # of a cloud, to cut
_LONELY = 3.0  # times the median distance of neighbours, from which on a point is noise
_NEIGHBOURS = 6
_LOWEST = 1.0  # percentile of heights that is the lowest point: one alone may be noise
_DENSITY = 500.0  # kg/m^3; nobody weighs what is seen
_SURFACE_POINTS = 1500
_IN_FRONT = 0.006  # of what a camera measured, as far as depth is not known better [m]
_FAR = 0.02  # [m]
_ABOUT = 5  # pixels
_RESTS = 6  # stable poses, the likeliest


def completed_shape(
    category: str,
    object_type: ObjectType,
    pose: Float[np.ndarray, "4 4"],
    views: Sequence[ObjectView],
) -> KnownShape:
    """What is seen, completed, as a shape in the label's frame, with the symmetry that it shows.

    Args:
      category: For its name.
      object_type: Whose symmetry completes it.
      pose: `T_world_label` by a hypothesis.
      views: Of at least `_FEWEST` points together.
    """
    points = seen_points(views)
    points = points[in_company(points)]
    hulls = convex_parts(_completed(object_type, pose, _filled_beneath(points)))
    corners = np.concatenate(hulls)
    low, high = corners.min(axis=0), corners.max(axis=0)
    extents, center = np.maximum(high - low, 1e-3), (low + high) / 2
    meshes = [trimesh.convex.convex_hull(hull) for hull in hulls]
    outside = union_points([Shape("mesh", mesh=mesh) for mesh in meshes], np.random.default_rng(0))
    surface = outside.thinned(_SURFACE_POINTS, np.random.default_rng(0)).points
    seen = transform(invert(pose), points)
    group = estimated_symmetry(
        object_type, seen, surface, center, lambda moved: in_front(transform(pose, moved), views)
    )
    label = PoseLabel(np.zeros(3), np.eye(3), object_type, extents, group, center=center)
    mass = _mass(meshes)
    return KnownShape(
        name=f"seen_{category}",
        label=label,
        hulls=tuple(hulls),
        surface=np.concatenate([surface, seen]),
        rests=stable_rests(corners, mass.center_of_mass),
        mass=mass,
    )


def looked_through(
    object_type: ObjectType,
    pose: Float[np.ndarray, "4 4"],
    points: Float[np.ndarray, "n 3"],
    views: Sequence[ObjectView],
) -> float:
    """How far in front of what the cameras measured symmetry puts surface, the mean over its points [m].

    A wrong plane of symmetry puts surface where a camera looks through.

    Args:
      object_type: Whose symmetry completes the cloud.
      pose: `T_world_label` by a hypothesis.
      points: Seen, world frame [m].
      views: That they are from.
    """
    return in_front(transform(pose, _completed(object_type, pose, points)), views)


def in_front(points: Float[np.ndarray, "n 3"], views: Sequence[ObjectView]) -> float:
    """How far points of the world frame are in front of what the cameras measured, the mean over them [m]."""
    farthest = np.zeros(len(points))
    for view in views:
        local = transform(invert(view.T_world_camera), points)
        image = local @ view.image.intrinsics.matrix.T
        pixel = np.round(image[:, :2] / np.maximum(image[:, 2:], 1e-6)).astype(int)
        nearest = _nearest_about(view.image.depth)
        height, width = nearest.shape
        inside = ((pixel >= 0) & (pixel < [width, height])).all(axis=1) & (local[:, 2] > 0)
        depth = np.zeros(len(points))
        depth[inside] = nearest[pixel[inside, 1], pixel[inside, 0]]
        off = np.where(depth > 0, depth - local[:, 2] - _IN_FRONT, 0.0)
        farthest = np.maximum(farthest, np.clip(off, 0.0, _FAR))
    return float(farthest.mean())


def _nearest_about(depth: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """The least depth around each pixel: edges are not known to the pixel; 0 where nothing was measured."""
    least = minimum_filter(np.where(depth > 0, depth, np.inf), size=_ABOUT)
    return np.where(np.isfinite(least), least, 0.0)


def convex_parts(points: Float[np.ndarray, "n 3"]) -> list[Float[np.ndarray, "_ 3"]]:
    """Vertices of the convex hulls of parts of a cloud [m]: cut along the axes where that saves most volume."""
    if len(points) > _HULL_POINTS:
        extreme = _corners(points)
        some = np.random.default_rng(0).permutation(len(points))[:_HULL_POINTS]
        points = np.concatenate([extreme, points[some]])
    parts = [_Part.of(points)]
    while len(parts) < _PARTS:
        cuts = [(part.saved, number) for number, part in enumerate(parts) if part.cut is not None]
        if not cuts:
            break
        _, number = max(cuts)
        part = parts.pop(number)
        assert part.cut is not None
        parts[number:number] = [_Part.of(part.points[side]) for side in part.cut]
    return [part.corners for part in parts]


@dataclass(frozen=True)
class _Part:
    """Some points, their hull, and the best cut; None where none is worth it. `saved`: volume [m^3]."""

    points: Float[np.ndarray, "n 3"]
    corners: Float[np.ndarray, "_ 3"]
    cut: tuple[Bool[np.ndarray, "n"], Bool[np.ndarray, "n"]] | None
    saved: float

    @classmethod
    def of(cls, points: Float[np.ndarray, "n 3"]) -> _Part:
        volume, best, saved = _volume(points), None, 0.0
        low, high = points.min(axis=0), points.max(axis=0)
        for axis in range(3):
            for share in _CUTS:
                at = low[axis] + share * (high[axis] - low[axis])
                sides = points[:, axis] < at + _OVERLAP, points[:, axis] > at - _OVERLAP
                if min(side.sum() for side in sides) < _FEWEST:
                    continue
                gain = volume - sum(_volume(points[side]) for side in sides)
                if gain > max(saved, _SAVES * volume):
                    best, saved = sides, gain
        return cls(points, _corners(points), best, saved)


def _volume(points: Float[np.ndarray, "n 3"]) -> float:
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0


def _corners(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "_ 3"]:
    """The vertices of the convex hull; of what is flat, of a thin body about it."""
    try:
        hull = ConvexHull(points)
    except QhullError:
        shifts = np.concatenate([np.eye(3), -np.eye(3)]) * _THIN / 2
        points = (points[:, None] + shifts).reshape(-1, 3)
        hull = ConvexHull(points)
    return points[hull.vertices]


def in_company(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Which points have others about as near as most have."""
    count = min(_NEIGHBOURS + 1, len(points))
    reach = cKDTree(points).query(points, k=[count])[0][:, 0]
    return reach <= _LONELY * np.median(reach)


def _completed(
    object_type: ObjectType, pose: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "m 3"]:
    """Points of the world frame, and where symmetry puts them as well, in the label's frame [m]."""
    group = SymmetryGroup(np.eye(3)[None], axial=object_type == "axial")
    local = transform(invert(pose), points)
    return np.concatenate([local @ turn.T for turn in symmetry_turns(object_type, group)])


def _filled_beneath(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "m 3"]:
    """The points, and each one's foot at the height of the lowest; world frame [m]."""
    feet = points.copy()
    feet[:, 2] = np.percentile(points[:, 2], _LOWEST)
    return np.concatenate([points, feet])


def _mass(meshes: Sequence[trimesh.Trimesh]) -> MassProperties:
    """Of a uniform solid; where parts overlap they count twice."""
    volumes = np.array([max(float(mesh.volume), 1e-9) for mesh in meshes])
    centers = np.array([np.asarray(mesh.center_mass) for mesh in meshes])
    center = (volumes[:, None] * centers).sum(axis=0) / volumes.sum()
    mass = float(_DENSITY * volumes.sum())
    spread = max(float(np.ptp(np.concatenate([m.vertices for m in meshes]), axis=0).max()), 1e-3)
    return MassProperties(mass, center, mass * spread**2 / 12 * np.eye(3))


def stable_rests(
    corners: Float[np.ndarray, "c 3"], center: Float[np.ndarray, "3"]
) -> tuple[StablePose, ...]:
    """The likeliest poses in which the hull lies still.

    A centre of mass that is not inside the hull, as rounding puts it in thin or far bodies, counts as the mean corner.
    A hull without an inside rests as it is.
    """
    hull = trimesh.convex.convex_hull(corners)
    centers = [each for each in (center, hull.vertices.mean(axis=0)) if _inside(hull, each)]
    if not centers:  # trimesh would draw centres until one is inside, for ever
        return (StablePose(np.eye(3), -float(corners[:, 2].min()), 1.0),)
    poses, shares = trimesh.poses.compute_stable_poses(hull, center_mass=centers[0])
    rests = [
        StablePose(pose[:3, :3], -float((corners @ pose[2, :3]).min()), float(share))
        for pose, share in zip(poses, shares, strict=True)
    ]
    return tuple(sorted(rests, key=lambda rest: -rest.probability)[:_RESTS])


def _inside(hull: trimesh.Trimesh, point: Float[np.ndarray, "3"]) -> bool:
    """Whether a point is inside all faces, as `compute_stable_poses` looks for it."""
    hull = hull.convex_hull  # kept by the mesh
    heights = ((point - hull.triangles_center) * hull.face_normals).sum(axis=1)
    return bool((heights < 0).all())
