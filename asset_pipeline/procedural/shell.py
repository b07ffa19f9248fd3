"""Hollow things of any outline, with one opening: pots, jugs, domes; walls between two grids of points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.solids import loft
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

FLOOR_CORNERS = 16
ARC_POINTS = 4  # of a wall part's outer side, along each ring


def revolved_loops(profile: Float[np.ndarray, "n 2"], points: int) -> Float[np.ndarray, "n p 3"]:
    """Rings about z through the points `(r, z)` of a profile [m]; the first point is on the x axis."""
    angles = np.arange(points) * (2 * np.pi / points)
    r, z = profile.T[:, :, None]
    return np.stack([r * np.cos(angles), r * np.sin(angles), z + 0 * angles], axis=-1)


def shell_piece(
    outer: Float[np.ndarray, "l p 3"],
    inner: Float[np.ndarray, "l p 3"],
    *,
    cuts: Sequence[int],
    wedges: Sequence[int],
    colours: Sequence[tuple[int, Colour]],
    inside: Colour,
    density: float,
    floor: bool = False,
) -> Piece:
    """A shell with one opening: a vessel or a dome.

    Args:
      outer: Rings of the outer side from the closed end to the rim [m].
      inner: Their counterparts on the inner side; the wall lies between `outer[k]` and `inner[k]`.
      cuts: Indices of the rings, increasing, between which the wall is cut into bands.
      wedges: Convex collision parts of each band; divisors of the number of points in a ring.
      colours: Last ring and colour of each band of the outside, from the closed end; the last one's
        goes to the rim.
      inside: Colour of the inner side.
      density: [kg/m^3].
      floor: Whether a flat part fills the space between the first rings; a dome's crown needs none.
    """
    rings = np.concatenate([outer, inner[::-1]])
    closed = loft(rings)
    if closed.volume < 0:
        rings = rings[:, ::-1]
        closed = loft(rings)
    visuals, start = [], 0
    for number, (stop, rgba) in enumerate(colours):
        last = len(outer) if number == len(colours) - 1 else stop
        mesh = loft(rings[start : last + 1], caps=(start == 0, False))
        visuals.append(Shape("mesh", mesh=mesh, rgba=rgba))
        start = last
    visuals.append(Shape("mesh", mesh=loft(rings[start:], caps=(False, True)), rgba=inside))
    parts = wall_parts(outer, inner, cuts, wedges)
    if floor:
        step = outer.shape[1] // FLOOR_CORNERS
        parts = (convex_part(np.concatenate([outer[0, ::step], inner[0, ::step]])), *parts)
    mass = solid_mass_properties(closed, density * float(closed.volume))
    return Piece(tuple(visuals), parts, mass)


def wall_parts(
    outer: Float[np.ndarray, "l p 3"],
    inner: Float[np.ndarray, "l p 3"],
    cuts: Sequence[int],
    wedges: Sequence[int],
) -> tuple[Shape, ...]:
    """Convex pieces of the wall between two closed grids; arguments as in `shell_piece`."""
    count = outer.shape[1]
    shapes = []
    for low, high, around in zip(cuts[:-1], cuts[1:], wedges, strict=True):
        edges = np.arange(around + 1) * count // around
        between = edges[:-1] + edges[1:]
        middles = inner[(low + high) // 2, np.stack([between // 2, (between + 1) // 2])].mean(
            axis=0
        )
        corners = inner[np.ix_((low, high), edges % count)]
        # The hollow side lies halfway between chord and curve; neighbours share their corners.
        sagitta = _sagitta(corners, middles) / 2
        corners = (
            corners + (sagitta[np.arange(around + 1) % around] + sagitta[np.arange(-1, around)]) / 2
        )
        levels = sorted({low, (low + high) // 2, high})
        for k in range(around):
            along = np.round(np.linspace(edges[k], edges[k + 1], ARC_POINTS)).astype(int)
            seen = outer[np.ix_(levels, np.unique(along) % count)]
            hidden = corners[:, k : k + 2]
            shapes.append(convex_part(np.concatenate([seen.reshape(-1, 3), hidden.reshape(-1, 3)])))
    return tuple(shapes)


def _sagitta(
    corners: Float[np.ndarray, "2 edges 3"], middles: Float[np.ndarray, "w 3"]
) -> Float[np.ndarray, "w 3"]:
    """How far the middle of each piece of a band lies off the plane of its four corners."""
    normals = np.cross(corners[1, 1:] - corners[0, :-1], corners[1, :-1] - corners[0, 1:])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = middles - (corners[:, :-1] + corners[:, 1:]).mean(axis=0) / 2
    return (offsets * normals).sum(axis=1, keepdims=True) * normals


def painted(
    mesh: trimesh.Trimesh, mask: np.ndarray, rgba: Colour, other: Colour
) -> tuple[Shape, ...]:
    """A surface in two colours, by a mask over its faces."""
    shapes = []
    for faces, colour in ((mask, rgba), (~mask, other)):
        part = trimesh.Trimesh(mesh.vertices, mesh.faces[faces], process=False)
        part.remove_unreferenced_vertices()
        shapes.append(Shape("mesh", mesh=part, rgba=colour))
    return tuple(shapes)


def offset_loops(loops: Float[np.ndarray, "l p 3"], thickness: float) -> Float[np.ndarray, "l p 3"]:
    """The rings moved by `thickness` [m] along the surface's normals, to the side of a dome's hollow.

    Args:
      loops: Rings from the crown outwards, anticlockwise as seen from above.
      thickness: Small against the radii of curvature.
    """
    along = np.gradient(loops, axis=0)
    around = np.roll(loops, -1, axis=1) - np.roll(loops, 1, axis=1)
    normals = np.cross(along, around)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return loops - thickness * normals
