"""A spanner: open-ended, combination, ring, or adjustable.

Typical sizes, from general knowledge and not from a data sheet: a 24 mm open-ended spanner is 210
mm long, its head 50 mm wide and 9 mm thick; combination spanners of 13-27 mm are 165-300 mm long;
an 8 inch adjustable one is 206 mm long, its head 56 mm wide and 13 mm thick. Jaws stand at 15 deg
to the handle, adjustable ones at 22.5 deg. X runs from the handle to the jaws (of a combination
spanner to the open ones, the larger end); the origin is at their neck. Z points to the side to
which the slanted jaws lean; a ring leans to none, so half a turn about X is in its group.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from shapely import affinity

from asset_pipeline.procedural.extruded import panel
from asset_pipeline.procedural.pieces import Piece, placed
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, superellipse
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

STEEL = 7850.0  # [kg/m^3]
NECK = 0.893  # centre of a round head from where its edge leaves the handle's, in radii

Style = Literal["open", "combination", "ring", "adjustable"]
_STYLES: tuple[Style, ...] = ("open", "adjustable", "combination", "ring")
# Handle, and what is polished or knurled of the head.
_FINISHES: tuple[tuple[Colour, Colour], ...] = (
    ((0.74, 0.75, 0.77, 1.0), (0.84, 0.85, 0.87, 1.0)),
    ((0.24, 0.25, 0.27, 1.0), (0.60, 0.61, 0.63, 1.0)),
    ((0.62, 0.62, 0.60, 1.0), (0.62, 0.62, 0.60, 1.0)),
    ((0.72, 0.14, 0.13, 1.0), (0.78, 0.79, 0.81, 1.0)),
    ((0.17, 0.30, 0.58, 1.0), (0.78, 0.79, 0.81, 1.0)),
)


@dataclass(frozen=True)
class Spanner:
    """Sizes [m], style and colours.

    Attributes: style; length, from the handle's end to the neck; jaw, width across the nut's flats;
    slant of the jaws [rad]; wide and thick, the handle's section at the neck; body and polish,
    colours.
    """

    style: Style = "combination"
    length: float = 0.165
    jaw: float = 0.019
    slant: float = np.deg2rad(15.0)
    wide: float = 0.0150
    thick: float = 0.0074
    body: Colour = (0.74, 0.75, 0.77, 1.0)
    polish: Colour = (0.84, 0.85, 0.87, 1.0)


def design(index: int) -> Spanner:
    """The sizes of instance `index`; 0 is a 19 mm combination spanner, the styles take turns."""
    if index == 0:
        return Spanner()
    rng = specimen_rng("spanner", index)
    style = _STYLES[index % 4]
    jaw = rng.uniform(0.014, 0.026)
    body, polish = in_turn(index, _FINISHES)
    return Spanner(
        style,
        length=round(float(jaw * rng.uniform(7.2, 9.0)), 4),
        jaw=round(float(jaw), 4),
        slant=np.deg2rad(22.5 if style == "adjustable" else round(float(rng.uniform(15, 20)), 1)),
        wide=round(float(0.0045 + 0.60 * jaw), 4),
        thick=round(float(0.0030 + 0.23 * jaw), 4),
        body=body,
        polish=polish,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying flat with its handle along x."""
    spanner = design(index)
    pieces = _handle(spanner) + _HEADS[spanner.style](spanner)
    return tool_specimen(
        "spanner",
        pieces,
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.two_planes() if spanner.style == "ring" else None,
    )


def _polygon(shape: shapely.Geometry) -> shapely.Polygon:
    """What set operations on polygons give where the result is one."""
    assert isinstance(shape, shapely.Polygon)
    return shape


def _handle(spanner: Spanner) -> list[Piece]:
    """The bar, and at its end a hole to hang it by or, of a combination spanner, the ring."""
    y, z, length = spanner.wide / 2, spanner.thick / 2, spanner.length
    if spanner.style == "combination":
        radius = 0.74 * spanner.jaw
        ring = _ring(spanner, radius, -length + radius)
        start = -length + (2 - 0.107) * radius
    else:
        radius = 1.12 * y
        eye = shapely.Point(-length + radius, 0.0)
        outline = _polygon(eye.buffer(radius, quad_segs=8).difference(eye.buffer(0.52 * radius, 8)))
        coarse = _polygon(eye.buffer(radius, quad_segs=4).difference(eye.buffer(0.52 * radius, 2)))
        ring = panel(outline, -z, z, rgba=spanner.body, density=STEEL, coarse=coarse)
        start = -length + 1.75 * radius
    table = [(start, 0.86 * y, z), (0.5 * start, 0.86 * y, z), (0.003, y, z)]
    bar = handle(table, [(0.0, spanner.body)], density=STEEL, outline=superellipse(5.0))
    return [ring, bar]


def _ring(spanner: Spanner, radius: float, x: float) -> Piece:
    """A ring head with twelve notches about (x, 0)."""
    centre = shapely.Point(x, 0.0)
    angles = np.arange(24) * (np.pi / 12)
    notches = spanner.jaw / 2 * np.where(np.arange(24) % 2, 1.0, 1.11)
    hole = shapely.Polygon(
        np.column_stack([x + notches * np.cos(angles), notches * np.sin(angles)])
    )
    inner = centre.buffer(0.525 * spanner.jaw, quad_segs=4)
    half = 0.75 * spanner.thick
    return panel(
        _polygon(centre.buffer(radius, quad_segs=10).difference(hole)),
        -half,
        half,
        rgba=spanner.polish,
        density=STEEL,
        coarse=_polygon(centre.buffer(radius, quad_segs=4).difference(inner)),
    )


def _single_ring(spanner: Spanner) -> list[Piece]:
    radius = 0.80 * spanner.jaw
    return [_ring(spanner, radius, NECK * radius)]


def _open(spanner: Spanner) -> list[Piece]:
    """Round jaws, slanted about the neck; the slot ends in a half circle."""
    radius, jaw = 1.10 * spanner.jaw, spanner.jaw
    centre = NECK * radius
    half = 0.68 * spanner.thick

    def outline(fine: int) -> shapely.Polygon:
        head = shapely.Point(centre, 0.0).buffer(radius, quad_segs=fine)
        head = head.intersection(
            shapely.box(centre - radius, -radius, centre + 0.78 * radius, radius)
        )
        slot = shapely.Point(centre - 0.02 * jaw, 0.0).buffer(jaw / 2, quad_segs=fine)
        slot = slot.union(shapely.box(centre - 0.02 * jaw, -jaw / 2, centre + radius, jaw / 2))
        jaws = _polygon(head.difference(slot))
        return affinity.rotate(jaws, spanner.slant, origin=(0.0, 0.0), use_radians=True)

    return [panel(outline(10), -half, half, rgba=spanner.polish, density=STEEL, coarse=outline(4))]


# Outlines of an adjustable spanner's fixed and sliding jaw at the neck, in widths of the handle.
_FIXED = np.array(
    [[-0.1, -0.5], [0.35, -1.02], [0.9, -1.22], [1.75, -1.22], [1.92, -1.0], [1.92, 0.42]]
    + [[2.95, 0.48], [3.0, 0.85], [2.65, 1.22], [1.9, 1.42], [1.2, 1.36], [0.4, 0.95], [-0.1, 0.5]]
)
_SLIDING = np.array([[1.94, -1.26], [2.6, -1.12], [2.95, -0.80], [2.92, -0.42], [1.94, -0.36]])


def _adjustable(spanner: Spanner) -> list[Piece]:
    unit, half = 0.92 * spanner.wide, 0.80 * spanner.thick
    slant = compose(rotation_about(np.array([0.0, 0.0, 1.0]), spanner.slant), np.zeros(3))
    worm_radius = 1.10 * half
    worm = handle(
        [(-0.42 * unit, worm_radius, worm_radius), (0.42 * unit, worm_radius, worm_radius)],
        [(0.0, (0.45, 0.45, 0.46, 1.0))],
        density=1000.0,  # mostly inside the head, which is counted whole
        outline=superellipse(2.0, 32),
        rounding=(0.001, 0.001),
    )
    across = compose(
        rotation_about(np.array([0.0, 0.0, 1.0]), np.pi / 2), np.array([1.45, -0.5, 0]) * unit
    )
    jaws = [
        panel(shapely.Polygon(unit * shape), -h, h, rgba=spanner.polish, density=STEEL)
        for shape, h in ((_FIXED, half), (_SLIDING, 0.92 * half))
    ]
    return [placed(piece, slant) for piece in (*jaws, placed(worm, across))]


_HEADS = {
    "open": _open,
    "combination": _open,
    "ring": _single_ring,
    "adjustable": _adjustable,
}
