"""Surfaces that are not of revolution: lofts through closed loops, rounded boxes, prints on faces."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.assets.geometry import Shape

# How far a print stands off the surface it is on [m]; renderers need some.
PRINT_THICKNESS = 1e-4


def loft(
    loops: Float[np.ndarray, "l p 3"], caps: tuple[bool, bool] = (True, True)
) -> trimesh.Trimesh:
    """The surface through successive closed loops of equally many points.

    Loops run anticlockwise as seen from where they are heading; the normals then point outwards.

    Args:
      loops: Points of each loop.
      caps: Whether to close the first and the last loop, by a fan about its centre.
    """
    count, points = loops.shape[:2]
    vertices = np.concatenate([loops.reshape(-1, 3), loops[[0, -1]].mean(axis=1)])
    index = np.arange(count * points).reshape(count, points)
    low, high = index[:-1], index[1:]
    right_low, right_high = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    faces = [
        np.stack([low, right_low, right_high], -1).reshape(-1, 3),
        np.stack([low, right_high, high], -1).reshape(-1, 3),
    ]
    centre = np.full(points, count * points)
    if caps[0]:
        faces.append(np.stack([centre, right_low[0], low[0]], 1))
    if caps[1]:
        faces.append(np.stack([centre + 1, index[-1], np.roll(index[-1], -1)], 1))
    mesh = trimesh.Trimesh(vertices, np.concatenate(faces), process=False)
    mesh.remove_unreferenced_vertices()
    return mesh


def rounded_rectangle(
    half: tuple[float, float], radius: float, steps: int = 4
) -> Float[np.ndarray, "p 2"]:
    """The outline of a rectangle with rounded corners, anticlockwise, `4 (steps + 1)` points."""
    corner = np.linspace(0, np.pi / 2, steps + 1)
    outline = []
    for quarter, (sx, sy) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        angle = corner + quarter * np.pi / 2
        centre = np.array([sx * (half[0] - radius), sy * (half[1] - radius)])
        outline.append(centre + radius * np.stack([np.cos(angle), np.sin(angle)], 1))
    return np.concatenate(outline)


def rounded_box_bands(
    half: tuple[float, float, float], radius: float, cuts: tuple[float, ...] = ()
) -> list[trimesh.Trimesh]:
    """A box with rounded edges, cut by horizontal planes into bands from bottom to top.

    Together the bands are the closed surface.

    Args:
      half: Half lengths along x, y, z [m].
      radius: Of every edge [m].
      cuts: Heights of the cuts, increasing, within the straight part of the sides [m].
    """
    x, y, z = half
    rounding = [
        (z - radius * (1 - np.sin(a)), radius * (1 - np.cos(a)))
        for a in np.linspace(0, np.pi / 2, 5)
    ]
    levels = [(-height, inset) for height, inset in rounding[::-1]]
    levels += [(cut, 0.0) for cut in cuts] + rounding
    loops = []
    for height, inset in levels:
        outline = rounded_rectangle((x - inset, y - inset), max(radius - inset, 1e-5))
        loops.append(np.column_stack([outline, np.full(len(outline), height)]))
    stack = np.stack(loops)
    first_cut = len(rounding)
    ends = [0, *range(first_cut, first_cut + len(cuts)), len(levels) - 1]
    return [
        loft(stack[start : stop + 1], caps=(start == 0, stop == len(levels) - 1))
        for start, stop in zip(ends[:-1], ends[1:], strict=True)
    ]


def ellipse(half: tuple[float, float], points: int = 48) -> Float[np.ndarray, "p 2"]:
    """The outline of an ellipse, anticlockwise."""
    angles = np.arange(points) * (2 * np.pi / points)
    return np.stack([half[0] * np.cos(angles), half[1] * np.sin(angles)], 1)


def print_on_face(
    outline: Float[np.ndarray, "p 2"], pose: Float[np.ndarray, "4 4"], layer: int = 1
) -> trimesh.Trimesh:
    """A flat print with a star-shaped outline on the xy plane of `pose`, z pointing off the face.

    Args:
      outline: Anticlockwise, about the origin [m].
      pose: `T_body_face`.
      layer: Prints of higher layers lie over those of lower ones.
    """
    flat = np.column_stack([outline, np.zeros(len(outline))])
    top = flat + [0, 0, layer * PRINT_THICKNESS]
    mesh = loft(np.stack([flat, top]), caps=(False, True))
    mesh.apply_transform(pose)
    return mesh


def print_on_cylinder(
    outline: Float[np.ndarray, "p 2"], radius: float, *, angle: float, height: float, layer: int = 1
) -> trimesh.Trimesh:
    """A print wrapped on a cylinder about z.

    Args:
      outline: Star-shaped, anticlockwise; along the circumference and along z [m].
      radius: Of the cylinder [m].
      angle: Where the outline's origin lies about z [rad].
      height: And along z [m].
      layer: Prints of higher layers lie over those of lower ones.
    """
    out = radius + layer * PRINT_THICKNESS
    shares = np.linspace(1.0, 0.0, 9)[:-1]  # rings towards the centre, to follow the curve
    rings = []
    for share, r in [(1.0, radius), *[(s, out) for s in shares]]:
        along, up = (share * outline).T
        phi = angle + along / radius
        rings.append(np.column_stack([r * np.cos(phi), r * np.sin(phi), height + up]))
    mesh = loft(np.stack(rings), caps=(False, True))
    # The fan's hub is the mean of the innermost ring, which lies inside the cylinder.
    hub = np.array([out * np.cos(angle), out * np.sin(angle), height])
    nearest = int(np.argmin(np.linalg.norm(mesh.vertices - hub, axis=1)))
    mesh.vertices[nearest] = hub
    return mesh


def box(
    low: Float[np.ndarray, "3"] | tuple[float, float, float],
    high: Float[np.ndarray, "3"] | tuple[float, float, float],
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0),
) -> Shape:
    """A box geom between two corners."""
    lower, upper = np.asarray(low, float), np.asarray(high, float)
    pose = np.eye(4)
    pose[:3, 3] = (lower + upper) / 2
    return Shape("box", tuple((upper - lower) / 2), pose, rgba=rgba)


def rounded_box(
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    radius: float,
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0),
) -> Shape:
    """A box with rounded edges between two corners, as a mesh to look at."""
    lower, upper = np.asarray(low, float), np.asarray(high, float)
    x, y, z = (upper - lower) / 2
    (mesh,) = rounded_box_bands((x, y, z), radius)
    mesh.apply_translation((lower + upper) / 2)
    return Shape("mesh", mesh=mesh, rgba=rgba)
