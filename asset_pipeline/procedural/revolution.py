"""Solids of revolution about z: profiles, smooth surfaces, exact moments, convex wall wedges.

A profile is a polyline of `(r, z)` [m]. Walked with the material on its left (outer wall upwards,
inner wall downwards), its surface normals point out of the material.
"""

from __future__ import annotations

import manifold3d
import numpy as np
import trimesh
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from manipose_mj.assets.geometry import MassProperties, Shape

MAX_PART_VERTICES = 32


def fillet(
    points: Float[np.ndarray, "n 2"], radii: dict[int, float], steps: int = 6
) -> Float[np.ndarray, "m 2"]:
    """The polyline with some of its corners replaced by arcs.

    Args:
      points: Corners; the first and the last stay.
      radii: Arc radius [m] by index of the corner.
      steps: Segments per arc.
    """
    rounded: list[np.ndarray] = []
    for index, corner in enumerate(points):
        radius = radii.get(index, 0.0)
        if radius <= 0:
            rounded.append(corner[None])
            continue
        back, ahead = points[index - 1] - corner, points[index + 1] - corner
        back, ahead = back / np.linalg.norm(back), ahead / np.linalg.norm(ahead)
        half = np.arccos(np.clip(back @ ahead, -1, 1)) / 2
        bisector = (back + ahead) / np.linalg.norm(back + ahead)
        centre = corner + bisector * radius / np.sin(half)
        reach = radius / np.tan(half)
        start, end = corner + back * reach - centre, corner + ahead * reach - centre
        turn = np.pi - 2 * half
        weights = np.linspace(0, 1, steps + 1)[:, None]
        arc = (np.sin((1 - weights) * turn) * start + np.sin(weights * turn) * end) / np.sin(turn)
        rounded.append(centre + arc)
    return np.concatenate(rounded)


def curve_through(points: Float[np.ndarray, "n 2"], count: int) -> Float[np.ndarray, "count 2"]:
    """A smooth curve through a profile's points that swings past none of them in r or z.

    Args:
      points: At least two `(r, z)` [m], no two successive ones alike.
      count: Points of the curve, evenly spread along it.
    """
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    return PchipInterpolator(length, points)(np.linspace(0, length[-1], count))


def lathe(profile: Float[np.ndarray, "n 2"], sections: int = 72) -> trimesh.Trimesh:
    """The surface that the profile sweeps about z; points with r = 0 become one vertex each."""
    angles = np.arange(sections) * (2 * np.pi / sections)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings: list[np.ndarray] = []
    vertices: list[np.ndarray] = []
    count = 0
    for r, z in profile:
        ring = np.column_stack([r * circle, np.full(sections, z)])
        ring = ring[:1] if r == 0 else ring
        vertices.append(ring)
        rings.append(np.broadcast_to(count + np.arange(len(ring)), (sections,)))
        count += len(ring)
    faces = []
    for low, high in zip(rings[:-1], rings[1:], strict=True):
        right_low, right_high = np.roll(low, -1), np.roll(high, -1)
        faces += [np.stack([low, right_low, right_high], 1), np.stack([low, right_high, high], 1)]
    triangles = np.concatenate(faces)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    return trimesh.Trimesh(np.concatenate(vertices), triangles, process=False)


def revolved_mass(profile: Float[np.ndarray, "n 2"], density: float) -> MassProperties:
    """Exact mass properties of the solid of revolution inside a profile.

    The profile is closed by the straight line from its last point to its first (along the axis,
    for a profile that starts and ends there). Green's theorem turns each moment
    `int r^a z^b dr dz` into `oint r^(a+1) / (a+1) z^b dz`; three Gauss points per edge are exact.

    Args:
      profile: Walked with the material on its left.
      density: [kg/m^3].
    """
    ends = np.roll(profile, -1, axis=0)
    nodes = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)]) / 2 + 0.5
    weights = np.array([5.0, 8.0, 5.0]) / 18
    at = profile[:, None] + nodes[None, :, None] * (ends - profile)[:, None]
    r, z = at[..., 0], at[..., 1]
    dz = weights * (ends - profile)[:, 1:2]

    def integral(a: int, b: int) -> float:
        return float(2 * np.pi * density * np.sum(r ** (a + 1) / (a + 1) * z**b * dz))

    mass = integral(1, 0)
    height = integral(1, 1) / mass
    vertical = integral(3, 0)
    horizontal = vertical / 2 + integral(1, 2) - mass * height**2
    return MassProperties(
        mass, np.array([0.0, 0.0, height]), np.diag([horizontal, horizontal, vertical])
    )


def wall_wedges(
    outer: Float[np.ndarray, "n 2"],
    inner: Float[np.ndarray, "m 2"],
    count: int,
    *,
    arc_steps: int = 3,
) -> tuple[Shape, ...]:
    """A ring of wall as convex wedges that share their end planes.

    The outside follows a polygon of `count * arc_steps` corners. The inside is hollow, so a wedge
    spans it by its chord: its inner corners are moved out by half the chord's sagitta, which
    leaves the same error, half a sagitta, in the middle and at the ends.

    Args:
      outer: The outer side of the wall's section, rim and foot roundings included; convex.
      inner: The inner side; straight, as far as the wedge is to follow it.
      count: Wedges around; the first begins at the x axis, so the xz plane mirrors the ring.
      arc_steps: Outer segments per wedge.
    """
    pitch = 2 * np.pi / count
    half_sagitta = (1 + 1 / np.cos(pitch / 2)) / 2
    wedges = []
    for index in range(count):
        angles = pitch * (index + np.linspace(0, 1, arc_steps + 1))
        points = [_around(outer, angle) for angle in angles]
        points += [_around(inner * [half_sagitta, 1.0], angle) for angle in angles[[0, -1]]]
        wedges.append(convex_part(np.concatenate(points)))
    return tuple(wedges)


def convex_part(points: Float[np.ndarray, "n 3"]) -> Shape:
    """The convex hull of a few points as a collision shape."""
    hull = trimesh.convex.convex_hull(np.round(points, 9), qhull_options="QbB Pp Qt")
    assert len(hull.vertices) <= MAX_PART_VERTICES, len(hull.vertices)
    return Shape("mesh", mesh=trimesh.Trimesh(hull.vertices, hull.faces, process=False))


def halves(part: Shape) -> tuple[Shape, Shape]:
    """A convex part cut along the xz plane, which it must straddle.

    A plane touches a convex mesh at one corner and its neighbours only: a wide part lying on rounded
    corners would rock from side to side for ever, and two narrow ones do not.
    """
    assert part.mesh is not None
    whole = manifold3d.Manifold.hull_points(np.array(part.mesh.vertices, np.float64))
    left, right = (
        convex_part(np.asarray(half.to_mesh64().vert_properties)[:, :3])
        for half in whole.split_by_plane((0.0, 1.0, 0.0), 0.0)
    )
    return left, right


def _around(profile: Float[np.ndarray, "n 2"], angle: float) -> Float[np.ndarray, "n 3"]:
    r, z = profile.T
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
