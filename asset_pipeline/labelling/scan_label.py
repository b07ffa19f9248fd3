"""The pose label of a scan, from its type, its source's up and its geometry."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import ConvexHull

from asset_pipeline.labelling.label import ObjectType, PoseLabel
from asset_pipeline.labelling.surface_symmetry import SurfaceProbe, measured_symmetry, mirror
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, rotation_about

SLICES = 60
# The joint of grip and functional area lies between these shares of a tool's length.
JOINT_RANGE = (0.15, 0.85)
MAX_LEAN = np.deg2rad(5.0)


def scan_label(
    mesh: trimesh.Trimesh,
    object_type: ObjectType,
    up: Float[np.ndarray, "3"],
    *,
    functional: Float[np.ndarray, "3"] | None = None,
    textured: bool = True,
) -> PoseLabel:
    """The label frame of a scan, by the rules of the conventions.

    Scans lean: where half a turn about an axis within 5 degrees of `up` maps the shape onto itself,
    that axis is X, and not `up`. Where the rules leave something open:

    - axial: X is `up`. Y is the mesh frame's x axis made horizontal (its y axis where x is up), and
      the axis passes through the centre of the bounding box. An axial object that turns out not to
      be one of revolution is laid along its minimum-area rectangle, like a box.
    - mirror: X is `up`; the candidate planes are the sides of the minimum-area rectangle around the
      outline seen from above, or else the vertical plane with the least mirror residual. If both
      hold, or none does, Y is along the longer side, its sign the one with a positive first large
      component in the mesh frame. If one holds, Y lies in it, towards the side that breaks the
      symmetry: where the bounding box reaches farther from the centroid of the surface.
    - functional: X is the side of the minimum-area rectangle seen from above (or `up`) nearest to
      `functional`, towards it. Where the source does not know that direction, X is the longest of
      them, towards the thinner end: the one farther from the surface's centroid. Y is `up` made
      perpendicular to X: tools lie flat and are gripped from above. The origin is where the width
      along X changes most: the split of the width profile into two constant pieces with the least
      squared error, midway across the slice there.

    The symmetry group is measured (`surface_symmetry`), except that functional tools have none: the
    edge of a knife matters more than its outline.

    Args:
      mesh: In the mesh frame [m].
      object_type: `"axial"`, `"mirror"` or `"functional"`.
      up: `(3,)`, in the mesh frame.
      functional: `(3,)`, roughly from grip to functional end, in the mesh frame.
      textured: Whether the asset has a texture that tells the ends of an axial object apart.

    Raises:
      InputError: Another object type, which scans do not have.
    """
    vertices = np.asarray(mesh.vertices)[np.unique(mesh.faces)]
    up = np.asarray(up, float) / np.linalg.norm(up)
    if object_type == "functional":
        rotation = _functional_frame(mesh, vertices, up, functional)
        origin, extents = _box(vertices, rotation)
        origin = _joint_point(mesh, rotation, origin)
        return PoseLabel(origin, rotation, object_type, extents, SymmetryGroup.identity())
    if object_type not in ("axial", "mirror"):
        raise InputError(
            f"object type {object_type!r} of a scan; expected axial, mirror or functional"
        )
    probe = SurfaceProbe.of(mesh)
    up = _own_axis(probe, vertices, up)
    if object_type == "axial":
        rotation = _projected_frame(up)
        origin, extents = _box(vertices, rotation)
        symmetry = measured_symmetry(probe, rotation, origin, textured=textured)
        if symmetry.axial:
            return PoseLabel(origin, rotation, object_type, extents, symmetry)
    rotation = _mirror_frame(mesh, vertices, up, probe)
    origin, extents = _box(vertices, rotation)
    symmetry = measured_symmetry(probe, rotation, origin, textured=textured)
    return PoseLabel(origin, rotation, object_type, extents, symmetry)


def _frame(x: np.ndarray, y: np.ndarray) -> Float[np.ndarray, "3 3"]:
    """Columns X, Y made perpendicular to X, and Z right-handed."""
    y = y - x * (x @ y)
    y = y / np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _projected_frame(up: np.ndarray) -> Float[np.ndarray, "3 3"]:
    x_axis, y_axis = np.eye(3)[:2]
    return _frame(up, x_axis if abs(up[0]) < 0.9 else y_axis)


def _own_axis(probe: SurfaceProbe, vertices: np.ndarray, up: np.ndarray) -> Float[np.ndarray, "3"]:
    """The shape's own axis of half turns, if there is one close to `up`; else `up`."""
    axis = probe.half_turn_axis(up, _box(vertices, _projected_frame(up))[0])
    center = _box(vertices, _projected_frame(axis))[0]
    near = axis @ up >= np.cos(MAX_LEAN)
    return axis if near and probe.holds(rotation_about(axis, np.pi), center) else up


def _box(vertices: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (mesh frame) and lengths of the bounding box along the frame's axes [m]."""
    local = vertices @ rotation
    low, high = local.min(axis=0), local.max(axis=0)
    return rotation @ ((low + high) / 2), high - low


def _rectangle_axes(
    vertices: np.ndarray, up: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Unit axes of the least rectangle around the outline along `up`, longer first; lengths."""
    plane = _projected_frame(up)[:, 1:]
    outline = vertices @ plane
    outline = outline[ConvexHull(outline).vertices]
    # The least rectangle shares a side with the hull (Freeman and Shapira, 1975).
    edges = np.roll(outline, -1, axis=0) - outline
    along = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    lengths = np.stack([np.ptp(outline @ d.T, axis=0) for d in (along, across)], axis=1)
    best = int(lengths.prod(axis=1).argmin())
    sides = [(float(lengths[best, i]), plane @ d[best]) for i, d in enumerate((along, across))]
    (long, long_axis), (short, short_axis) = sorted(sides, key=lambda s: -s[0])
    return _positive(long_axis), _positive(short_axis), long, short


def _positive(axis: np.ndarray) -> np.ndarray:
    """The one of +-axis whose first large component is positive."""
    first = axis[np.abs(axis) > 0.3][0]
    return axis if first > 0 else -axis


def _mirror_frame(
    mesh: trimesh.Trimesh, vertices: np.ndarray, up: np.ndarray, probe: SurfaceProbe
) -> Float[np.ndarray, "3 3"]:
    long, short, _, _ = _rectangle_axes(vertices, up)
    across_long, across_short = (_mirrors(vertices, up, probe, axis) for axis in (long, short))
    if across_long and across_short:
        return _frame(up, long)
    if across_short:
        return _frame(up, _towards_bulge(mesh, vertices, up, long))
    if across_long:
        return _frame(up, _towards_bulge(mesh, vertices, up, short))
    normals = [rotation_about(up, a) @ long for a in np.deg2rad(np.arange(0.0, 180.0, 3.0))]
    best = min(normals, key=lambda n: probe.residual(mirror(n), _center(vertices, up, n)))
    if _mirrors(vertices, up, probe, best):
        return _frame(up, _towards_bulge(mesh, vertices, up, np.cross(up, best)))
    return _frame(up, long)


def _center(vertices: np.ndarray, up: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return _box(vertices, _frame(up, normal))[0]


def _mirrors(vertices: np.ndarray, up: np.ndarray, probe: SurfaceProbe, normal: np.ndarray) -> bool:
    return probe.holds(mirror(normal), _center(vertices, up, normal))


def _towards_bulge(
    mesh: trimesh.Trimesh, vertices: np.ndarray, up: np.ndarray, axis: np.ndarray
) -> np.ndarray:
    """+-axis, towards where the bounding box reaches farther from the surface's centroid."""
    reach = (_center(vertices, up, axis) - mesh.centroid) @ axis
    return axis if reach >= 0 else -axis


def _functional_frame(
    mesh: trimesh.Trimesh, vertices: np.ndarray, up: np.ndarray, functional: np.ndarray | None
) -> Float[np.ndarray, "3 3"]:
    long, short, length, _ = _rectangle_axes(vertices, up)
    axis, side = (up, long) if np.ptp(vertices @ up) > length else (long, up)
    if functional is not None:
        axis = max((long, short, up), key=lambda a: abs(a @ np.asarray(functional, float)))
        side = long if axis is up else up
    if functional is not None:
        sign = float(axis @ np.asarray(functional, float))
    else:
        along = vertices @ axis
        sign = float((along.max() + along.min()) / 2 - mesh.centroid @ axis)
    return _frame(axis if sign >= 0 else -axis, side)


def _joint_point(
    mesh: trimesh.Trimesh, rotation: np.ndarray, center: np.ndarray
) -> Float[np.ndarray, "3"]:
    points = (trimesh.sample.sample_surface(mesh, 12_000, seed=0)[0] - center) @ rotation
    edges = np.linspace(points[:, 0].min(), points[:, 0].max(), SLICES + 1)
    slices = np.clip(np.digitize(points[:, 0], edges) - 1, 0, SLICES - 1)
    low, high = np.full((SLICES, 2), np.nan), np.full((SLICES, 2), np.nan)
    for k in range(SLICES):
        inside = points[slices == k, 1:]
        if len(inside):
            low[k], high[k] = inside.min(axis=0), inside.max(axis=0)
    width = np.nan_to_num(np.linalg.norm(high - low, axis=1))
    first, last = (int(share * SLICES) for share in JOINT_RANGE)
    split = min(
        range(first, last + 1),
        key=lambda k: width[:k].var() * k + width[k:].var() * (SLICES - k),
    )
    middle = np.nan_to_num((low[split] + high[split]) / 2)
    return center + rotation @ np.array([edges[split], *middle])
