"""Flat pieces of even thickness: blades, panels, rings, jaws."""

from __future__ import annotations

import numpy as np
import shapely
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece, solid_piece
from asset_pipeline.procedural.revolution import MAX_PART_VERTICES, convex_part
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

MAX_CORNERS = MAX_PART_VERTICES // 2
_CONVEX = 1e-4  # how much of its hull's area a polygon may miss and still count as convex


def panel(
    outline: shapely.Polygon,
    low: float,
    high: float,
    *,
    rgba: Colour,
    density: float,
    coarse: shapely.Polygon | None = None,
) -> Piece:
    """A plate in the xy plane between two heights, with or without holes.

    Args:
      outline: In the xy plane [m].
      low: Height of its underside [m].
      high: And of its upper side [m].
      rgba: Its colour.
      density: [kg/m^3].
      coarse: What collides, where the outline has more corners than that takes; None for the outline.
    """
    mesh = trimesh.creation.extrude_polygon(outline, high - low)
    mesh.apply_translation([0.0, 0.0, low])
    solid = convex_prisms(outline if coarse is None else coarse, low, high)
    return solid_piece(mesh, solid, rgba=rgba, density=density)


def convex_prisms(outline: shapely.Polygon, low: float, high: float) -> tuple[Shape, ...]:
    """Convex collision parts that fill a plate exactly, up to 0.01 % of their area."""
    return tuple(
        convex_part(
            np.concatenate(
                [np.column_stack([corners, np.full(len(corners), z)]) for z in (low, high)]
            )
        )
        for corners in convex_polygons(outline)
    )


def convex_polygons(outline: shapely.Polygon) -> list[Float[np.ndarray, "corners 2"]]:
    """Convex polygons of at most 16 corners that tile a polygon.

    Its triangles are merged across shared edges, the pair with the longest one first, as long as
    the result is convex.
    """
    vertices, faces = trimesh.creation.triangulate_polygon(outline)
    tiles = [shapely.Polygon(vertices[face]) for face in faces]
    tiles = [tile for tile in tiles if tile.area > 1e-12]
    while True:
        best, choice = 0.0, None
        for i, first in enumerate(tiles):
            for j in range(i + 1, len(tiles)):
                shared = first.intersection(tiles[j]).length
                if shared > best and _mergeable(first, tiles[j]):
                    best, choice = shared, (i, j)
        if choice is None:
            return [_corners(tile) for tile in tiles]
        i, j = choice
        merged = tiles[i].union(tiles[j]).convex_hull
        assert isinstance(merged, shapely.Polygon)
        tiles[i] = merged
        del tiles[j]


def _mergeable(first: shapely.Polygon, second: shapely.Polygon) -> bool:
    union = first.union(second)
    hull = union.convex_hull
    return hull.area - union.area < _CONVEX * hull.area and len(_corners(hull)) <= MAX_CORNERS


def _corners(polygon: shapely.Geometry) -> Float[np.ndarray, "corners 2"]:
    assert isinstance(polygon, shapely.Polygon)
    return np.asarray(polygon.exterior.coords)[:-1]
