"""What shuts a cell: a flat slab, or a frame around a thinner pane of wood or glass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import shapely
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.articulated.handles.portion import Portion, portion
from asset_pipeline.procedural.solids import box, rounded_box, rounded_rectangle
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

EDGE = 0.002  # radius of a slab's edges [m]
Point = Float[np.ndarray, "3"]
# Extrusions are made along z of their own frame, from the yz plane of the object's.
INTO_YZ = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0, 0, 0, 1]])


@dataclass(frozen=True)
class Pane:
    """What a frame holds. Attributes: inset, how far it lies behind the frame's outer side [m];
    thickness [m]; rgba; density [kg/m^3]."""

    inset: float
    thickness: float
    rgba: Colour
    density: float


def slab(low: Point, high: Point, *, rgba: Colour, density: float) -> Portion:
    """A massive board with rounded edges."""
    solid = (box(low, high, rgba),)
    visuals = (rounded_box(low, high, EDGE, rgba),)
    return portion(visuals, solid, density)


def framed(
    low: Point,
    high: Point,
    rails: tuple[float, float, float, float],
    pane: Pane,
    *,
    rgba: Colour,
    density: float,
    corners: tuple[float, float] = (EDGE, 0.0),
) -> Portion:
    """A frame between two corners, with a pane in its window.

    Args:
      low, high: Corners of the frame, `(3,)` [m]; the outer side is at low x.
      rails: Widths at low y, at high y, at low z and at high z [m].
      pane: What fills the window; it reaches 1 mm into the frame, so that no light shines through.
      rgba: Of the frame.
      density: Of the frame [kg/m^3].
      corners: Radii of the frame's outline and of the window's [m].
    """
    window_low = np.array([low[0] + pane.inset, low[1] + rails[0], low[2] + rails[2]])
    window_high = np.array(
        [low[0] + pane.inset + pane.thickness, high[1] - rails[1], high[2] - rails[3]]
    )
    solid = [
        *(box(*ends, rgba) for ends in ring_boxes(low, high, window_low, window_high)),
        box(window_low, window_high, pane.rgba),
    ]
    ring = ring_mesh(
        (low[0], high[0]),
        (low[1:], high[1:], corners[0]),
        (window_low[1:], window_high[1:], corners[1]),
    )
    lap = np.array([0.0, 0.001, 0.001])
    visuals = (
        Shape("mesh", mesh=ring, rgba=rgba),
        box(window_low - lap, window_high + lap, pane.rgba),
    )
    return Portion(visuals, tuple(solid), (*[density] * 4, pane.density))


def ring_boxes(
    low: Point, high: Point, inner_low: Point, inner_high: Point
) -> list[tuple[Point, Point]]:
    """A box less the part of it whose y and z are between the inner corners': four boxes."""
    return [
        (low, np.array([high[0], inner_low[1], high[2]])),
        (np.array([low[0], inner_high[1], low[2]]), high),
        (
            np.array([low[0], inner_low[1], low[2]]),
            np.array([high[0], inner_high[1], inner_low[2]]),
        ),
        (
            np.array([low[0], inner_low[1], inner_high[2]]),
            np.array([high[0], inner_high[1], high[2]]),
        ),
    ]


Rectangle = tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"], float]


def ring_mesh(x: tuple[float, float], outer: Rectangle, inner: Rectangle) -> trimesh.Trimesh:
    """A plate across x with a window; rectangles are low and high (y, z), and the corners' radius."""
    return extruded_along_x(shapely.Polygon(_outline(outer), [_outline(inner)]), x)


def plate_mesh(x: tuple[float, float], outer: Rectangle) -> trimesh.Trimesh:
    """A plate across x with rounded corners."""
    return extruded_along_x(shapely.Polygon(_outline(outer)), x)


def extruded_along_x(outline: shapely.Polygon, x: tuple[float, float]) -> trimesh.Trimesh:
    """A plate whose outline is given in y and z [m]."""
    mesh = trimesh.creation.extrude_polygon(outline, x[1] - x[0])
    mesh.apply_translation([0.0, 0.0, x[0]])
    mesh.apply_transform(INTO_YZ)
    return mesh


def merged(meshes: Sequence[trimesh.Trimesh], rgba: Colour) -> Shape:
    """Meshes of one colour as one shape to look at."""
    return Shape(
        "mesh", mesh=cast(trimesh.Trimesh, trimesh.util.concatenate(list(meshes))), rgba=rgba
    )


def _outline(rectangle: Rectangle) -> Float[np.ndarray, "p 2"]:
    low, high, radius = np.asarray(rectangle[0]), np.asarray(rectangle[1]), rectangle[2]
    half = (high - low) / 2
    steps = 4 if radius > 0 else 0
    if steps == 0:
        return (low + high) / 2 + half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return (low + high) / 2 + rounded_rectangle((half[0], half[1]), radius, steps)
