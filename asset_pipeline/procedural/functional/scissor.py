"""A pair of scissors, shut or a little open.

Typical sizes, from general knowledge and not from a data sheet: school scissors are 130 mm long,
office scissors 150-210 mm, dressmaker's shears to 240 mm; blades are a little more than half of it,
1.5-2 mm thick each. Ours are 75-115 mm across the two loops, which are 10-15 mm thick, so that a
hand can take them from a table. X runs from the loops to the points; the origin is where the blades
leave the handles, midway between them. The two halves are half-turned copies of each other where
both loops are alike, and half a turn about X is then in the group; else Z points to the larger
loop, which reaches farther.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from jaxtyping import Float
from shapely import affinity

from asset_pipeline.procedural.extruded import panel
from asset_pipeline.procedural.pieces import Piece, placed, solid_piece
from asset_pipeline.procedural.solids import loft
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar_loops
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, loop_hulls, superellipse
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

STEEL, PLASTIC = 7800.0, 1250.0  # [kg/m^3]
BLADE: Colour = (0.78, 0.79, 0.81, 1.0)
SCREW: Colour = (0.48, 0.49, 0.51, 1.0)
UP = np.array([0.0, 0.0, 1.0])
OTHER_HALF = compose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
RING_STATIONS = 48
RING_STRIDE = 4  # stations of what is seen for one of what collides

_COLOURS: tuple[Colour, ...] = (
    (0.92, 0.42, 0.10, 1.0),
    (0.14, 0.14, 0.15, 1.0),
    (0.75, 0.14, 0.14, 1.0),
    (0.16, 0.33, 0.62, 1.0),
    (0.20, 0.52, 0.33, 1.0),
    (0.52, 0.25, 0.55, 1.0),
    (0.93, 0.72, 0.15, 1.0),
)


@dataclass(frozen=True)
class Loop:
    """A finger loop: half lengths of its opening along x and y [m]."""

    long: float
    wide: float


@dataclass(frozen=True)
class Scissor:
    """Sizes [m] and colours.

    Attributes: blade, length beyond the handles; broad, width of the shut blades; sheet, thickness of
    one; thumb and fingers, the loops; bar, width of the loops' bar; thick, of the handles; shank, length
    from the loops to the blades; opening, angle between the blades [rad]; grip, colour; density of
    the handles [kg/m^3].
    """

    blade: float = 0.098
    broad: float = 0.019
    sheet: float = 0.0018
    thumb: Loop = Loop(0.017, 0.0115)
    fingers: Loop = Loop(0.022, 0.0150)
    bar: float = 0.0085
    thick: float = 0.0145
    shank: float = 0.026
    opening: float = 0.0
    grip: Colour = (0.92, 0.42, 0.10, 1.0)
    density: float = PLASTIC

    @property
    def alike(self) -> bool:
        """Whether the two loops are."""
        return self.thumb == self.fingers


def design(index: int) -> Scissor:
    """The sizes of instance `index`; 0 is a pair of office scissors, every other has loops alike."""
    if index == 0:
        return Scissor()
    rng = specimen_rng("scissor", index)
    size = rng.uniform(0.88, 1.36)
    # Loops do not shrink with the blades as much: fingers do not.
    hand = size**0.5
    wide = rng.uniform(0.0105, 0.0120) * hand
    alike = index % 2 == 1
    small = Loop(*(round(float(v), 4) for v in (wide * rng.uniform(1.2, 1.6), wide)))
    large = replace(small, long=round(1.75 * wide, 4), wide=round(1.36 * wide, 4))
    metal = rng.uniform() < 0.2
    return Scissor(
        blade=round(float(size * rng.uniform(0.085, 0.105)), 4),
        broad=round(float(size * rng.uniform(0.0165, 0.0195)), 4),
        sheet=uniform(rng, 0.0015, 0.0020),
        thumb=small,
        fingers=small if alike else large,
        bar=round(float(hand * rng.uniform(0.0075, 0.0095) * (0.8 if metal else 1.0)), 4),
        thick=round(float(hand * rng.uniform(0.0130, 0.0150) * (0.75 if metal else 1.0)), 4),
        shank=round(float(size * rng.uniform(0.022, 0.028)), 4),
        opening=np.deg2rad(round(float(rng.choice((0.0, 0.0, 5.0, 9.0, 13.0))), 1)),
        grip=BLADE if metal else in_turn(index, _COLOURS),
        density=0.8 * STEEL if metal else PLASTIC,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying flat, its points towards +x, the larger loop on the side of +y."""
    scissor = design(index)
    pivot = np.array([0.65 * scissor.broad, 0.0, 0.0])
    # One half opens one way, its copy the other; a loop on +y belongs to the blade on -y.
    turn = rotation_about(UP, -scissor.opening / 2)
    open_pose = compose(turn, pivot - turn @ pivot)
    pieces = [placed(piece, open_pose) for piece in _half(scissor, scissor.fingers)]
    other = OTHER_HALF @ open_pose
    pieces += [placed(piece, other) for piece in _half(scissor, scissor.thumb)]
    return tool_specimen(
        "scissor",
        [*pieces, _screw(scissor, pivot)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.two_planes() if scissor.alike else None,
    )


def _half(scissor: Scissor, loop: Loop) -> list[Piece]:
    """The half whose loop is on +y; its blade lies below the other's and cuts towards +y."""
    return [_blade(scissor), *_handle(scissor, loop)]


def _blade(scissor: Scissor) -> Piece:
    """Straight along its edge, which runs along the middle, and tapered to the point."""
    n, half = scissor.blade, scissor.broad / 2
    outline = shapely.Polygon(
        [
            (-0.012, -0.45 * half),
            (-0.012, 0.5 * half),
            (0.0, 0.62 * half),
            (1.3 * half, 0.85 * half),
        ]
        + [(2.4 * half, 0.42 * half), (0.95 * n, 0.0008), (n, -0.0002), (0.985 * n, -0.0016)]
        + [(0.55 * n, -0.62 * half), (0.22 * n, -0.96 * half), (1.1 * half, -half)]
        + [(0.0, -0.80 * half)]
    )
    return panel(outline, -scissor.sheet, 0.0, rgba=BLADE, density=STEEL)


def _handle(scissor: Scissor, loop: Loop) -> list[Piece]:
    """The loop, and the shank from there to the blades."""
    bar, half = scissor.bar / 2, scissor.thick / 2
    # Both loops end alike at the back.
    front = -scissor.shank - 2 * (scissor.fingers.long - loop.long)
    width = 0.56 * scissor.broad
    centre = np.array([front - loop.long, 0.0012 + loop.wide + 2 * bar])
    ring = _ring(centre, (loop.long + bar, loop.wide + bar), bar, half, scissor)
    neck = front - 0.05 * loop.long
    shank = shapely.Polygon(
        [(0.0, 0.0006), (0.0, width), (0.55 * neck, 1.15 * width)]
        + [(neck - 0.5 * loop.long, centre[1] + 0.87 * loop.wide + bar)]
        + [(neck - 0.5 * loop.long, centre[1] - 0.87 * loop.wide - bar), (0.9 * neck, 0.0006)]
    )

    def solid(fine: int) -> shapely.Polygon:
        """The shank without what would fill the loop."""
        hole = affinity.scale(
            shapely.Point(*centre).buffer(1.0, quad_segs=fine),
            loop.long + 0.6 * bar,
            loop.wide + 0.6 * bar,
        )
        rest = shank.difference(hole)
        parts = rest.geoms if isinstance(rest, shapely.MultiPolygon) else [rest]
        return max((p for p in parts if isinstance(p, shapely.Polygon)), key=lambda p: p.area)

    panel_piece = panel(
        solid(8),
        -0.86 * half,
        0.86 * half,
        rgba=scissor.grip,
        density=scissor.density,
        coarse=solid(2),
    )
    return [ring, panel_piece]


def _ring(
    centre: Float[np.ndarray, "2"],
    radii: tuple[float, float],
    bar: float,
    half: float,
    scissor: Scissor,
) -> Piece:
    """A closed loop of bar about an ellipse in the xy plane."""
    angles = np.arange(-1, RING_STATIONS + 2) * (2 * np.pi / RING_STATIONS)
    line = np.column_stack(
        [
            centre[0] + radii[0] * np.cos(angles),
            centre[1] + radii[1] * np.sin(angles),
            np.zeros(len(angles)),
        ]
    )
    sections = np.tile([bar, half], (len(line), 1))
    # The stations past both ends only serve the tangents.
    loops = bar_loops(line, sections, sideways=tuple(UP), power=2.6, points=16)[1:-1]
    mesh = loft(loops, caps=(False, False))
    mesh.merge_vertices()
    if mesh.volume < 0:
        mesh.invert()
    parts = loop_hulls(loops[::RING_STRIDE])
    return solid_piece(mesh, parts, rgba=scissor.grip, density=scissor.density)


def _screw(scissor: Scissor, pivot: Float[np.ndarray, "3"]) -> Piece:
    half, radius = 1.45 * scissor.sheet, 0.30 * scissor.broad
    screw = handle(
        [(-half, radius, radius), (half, radius, radius)],
        [(0.0, SCREW)],
        density=STEEL,
        outline=superellipse(2.0, 32),
        rounding=(0.0005, 0.0005),
    )
    return placed(screw, compose(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), pivot))
