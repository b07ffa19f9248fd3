"""Solid bodies stacked from rounded polygons: cases, covers, cartons, lids, buttons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.extruded import MAX_CORNERS
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.solids import loft, print_on_face
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.tool_handles import loop_hulls
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose

EDGE_STEPS = 4  # segments of a rounded edge
# What is drawn along z as it is to lie with its outline in the xz plane: z becomes -y, y becomes z.
ON_EDGE = compose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.zeros(3))


def rectangle(x: float, y: float) -> Float[np.ndarray, "4 2"]:
    """The corners of a rectangle about the origin with these half lengths [m], anticlockwise."""
    return np.array([[x, y], [-x, y], [-x, -y], [x, -y]])


def rounded_polygon(
    corners: Float[np.ndarray, "k 2"],
    radii: float | Sequence[float],
    *,
    inset: float = 0.0,
    steps: int = 3,
) -> Float[np.ndarray, "p 2"]:
    """A convex polygon with its corners replaced by arcs, `k (steps + 1)` points.

    Args:
      corners: Anticlockwise [m].
      radii: Of the arcs [m], one for all or one for each corner.
      inset: How far the outline is moved inwards; radii shrink with it [m].
      steps: Segments per arc.
    """
    ahead = np.roll(corners, -1, axis=0) - corners
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    behind = np.roll(ahead, 1, axis=0)
    start = np.arctan2(-behind[:, 0], behind[:, 1])  # of the outward normal before the corner
    turn = np.arctan2(
        behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0], (ahead * behind).sum(1)
    )
    radius = np.maximum(np.broadcast_to(np.asarray(radii, float), len(corners)) - inset, 1e-5)
    middle = start + turn / 2
    outwards = np.stack([np.cos(middle), np.sin(middle)], axis=1)
    centres = corners - ((radius + inset) / np.cos(turn / 2))[:, None] * outwards
    angles = start[:, None] + turn[:, None] * np.linspace(0, 1, steps + 1)
    arcs = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return (centres[:, None] + radius[:, None, None] * arcs).reshape(-1, 2)


def slab_loops(
    corners: Float[np.ndarray, "k 2"],
    radii: float | Sequence[float],
    low: float,
    high: float,
    *,
    edges: tuple[float, float] = (0.0, 0.0),
    cuts: Sequence[float] = (),
    steps: int = 3,
) -> Float[np.ndarray, "l p 3"]:
    """Outlines from the bottom of a slab to its top.

    Args:
      corners: Of its outline, convex, anticlockwise [m].
      radii: Of the outline's corners [m].
      low: Height of its underside [m].
      high: And of its upper side [m].
      edges: Radii of the roundings of the lower and the upper edge; 0 is sharp [m].
      cuts: Heights between the roundings with an outline of their own, where colours change [m].
      steps: Segments of a corner; 3 leaves all points of a rectangle in the collision parts.
    """
    rows = [(z, 0.0) for z in cuts]
    for end, inwards, radius in ((low, 1.0, edges[0]), (high, -1.0, edges[1])):
        angles = np.linspace(0, np.pi / 2, EDGE_STEPS + 1) if radius > 0 else np.zeros(1)
        rows += [
            (end + inwards * radius * (1 - np.cos(a)), radius * (1 - np.sin(a))) for a in angles
        ]
    rows.sort()
    return np.stack(
        [
            np.column_stack([line, np.full(len(line), z)])
            for z, inset in rows
            for line in [rounded_polygon(corners, radii, inset=inset, steps=steps)]
        ]
    )


def moulded(
    loops: Float[np.ndarray, "l p 3"],
    bands: Sequence[tuple[float, Colour]],
    *,
    density: float,
    prints: Sequence[Shape] = (),
) -> Piece:
    """A massive piece through convex loops, one above the other.

    Args:
      loops: As `slab_loops` makes them, bent or tapered as it may be [m].
      bands: Upper end and colour of each band, from the bottom, as a share of the height of each
        loop's first point; the last goes to the top.
      density: [kg/m^3].
      prints: What else is seen, too flat to be touched.
    """
    mesh = loft(loops)
    mass = solid_mass_properties(mesh, density * float(mesh.volume))
    parts = loop_hulls(loops[:, outstanding(loops[len(loops) // 2], MAX_CORNERS)])
    return Piece((*banded_loft(loops, bands), *prints), parts, mass)


def outstanding(outline: Float[np.ndarray, "p 3"], count: int) -> list[int]:
    """Which corners of a convex outline to keep, `count` at most: those that cut least off are left out."""
    kept = list(range(len(outline)))
    while len(kept) > count:
        corners = outline[kept]
        behind, ahead = (
            corners - np.roll(corners, 1, axis=0),
            np.roll(corners, -1, axis=0) - corners,
        )
        kept.pop(int(np.argmin(np.linalg.norm(np.cross(behind, ahead), axis=1))))
    return kept


def banded_loft(
    loops: Float[np.ndarray, "l p 3"], bands: Sequence[tuple[float, Colour]]
) -> tuple[Shape, ...]:
    """The closed surface through loops in bands of colour, as in `moulded`."""
    heights = loops[:, 0, 2]
    shares = (heights - heights[0]) / (heights[-1] - heights[0])
    last = len(loops) - 1
    stops = [int(np.argmin(np.abs(shares - top))) for top, _ in bands[:-1]] + [last]
    starts = [0, *stops[:-1]]
    return tuple(
        Shape("mesh", mesh=loft(loops[a : b + 1], (a == 0, b == last)), rgba=rgba)
        for a, b, (_, rgba) in zip(starts, stops, bands, strict=True)
    )


def facing(
    normal: Float[np.ndarray, "3"] | tuple[float, float, float],
    at: Float[np.ndarray, "3"] | tuple[float, float, float],
    up: tuple[float, float, float] = (0.0, 0.0, 1.0),
) -> Float[np.ndarray, "4 4"]:
    """`T_body_face` of a face: z along its normal, y as near to `up` as it goes."""
    z = np.asarray(normal, float) / np.linalg.norm(normal)
    x = np.cross(np.asarray(up, float), z)
    x = x / np.linalg.norm(x)
    return compose(np.stack([x, np.cross(z, x), z], axis=1), np.asarray(at, float))


def printed(
    outline: Float[np.ndarray, "p 2"], pose: Float[np.ndarray, "4 4"], rgba: Colour, layer: int = 1
) -> Shape:
    """A flat print on a face, as `print_on_face` makes it."""
    return Shape("mesh", mesh=print_on_face(outline, pose, layer), rgba=rgba)


def raised(
    outline: Float[np.ndarray, "p 2"],
    pose: Float[np.ndarray, "4 4"],
    height: float,
    rgba: Colour,
    *,
    shrink: float = 0.88,
) -> Shape:
    """A button on a face: straight sides, then a bevel up to a smaller top.

    Args:
      outline: Star-shaped about the origin of the face, anticlockwise [m].
      pose: `T_body_face`.
      height: [m].
      rgba: Its colour.
      shrink: Size of the top as a share.
    """
    rows = [(1.0, 0.0), (1.0, 0.65 * height), (shrink, height)]
    mesh: trimesh.Trimesh = loft(
        np.stack([np.column_stack([s * outline, np.full(len(outline), z)]) for s, z in rows]),
        caps=(False, True),
    )
    mesh.apply_transform(pose)
    return Shape("mesh", mesh=mesh, rgba=rgba)
