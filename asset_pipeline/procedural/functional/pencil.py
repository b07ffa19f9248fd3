"""A sharpened pencil, hexagonal or round, with or without an eraser in a ferrule.

Real sizes. Pencils are 7.0-7.5 mm across the flats (jumbo ones for small hands 9.5-10.5 mm) and new ones
175 mm long, with an eraser 190 mm; a sharpened cone is 18-25 mm long. They weigh 4-6 g (cedar, 400 kg/m^3;
a graphite lead of 2 mm).

A hexagonal pencil differs from a round one by at most 0.25 mm (its edges are rounded), less than the millimetre
to which symmetries are taken, and nothing about a pencil tells its sides apart: every turn about X is in the
group. X runs to the point; the origin is where the cone begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.solids import loft
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

CEDAR = 520.0  # [kg/m^3], with its lead
POINTS = 48
LEAD, TIP = 0.0011, 0.0003  # radii of the lead where the wood ends, and of its point [m]
WOOD: Colour = (0.86, 0.70, 0.48, 1.0)
ERASER: Colour = (0.90, 0.52, 0.52, 1.0)
FERRULE: Colour = (0.80, 0.72, 0.46, 1.0)


@dataclass(frozen=True)
class Pencil:
    """Sizes [m] and colours.

    Attributes: body, from its rear to the cone; thick, across the flats; hexagonal; cone, length;
    eraser, length of ferrule and eraser, 0 for none; paint; end, of a band at the rear; lead.
    """

    body: float = 0.150
    thick: float = 0.0074
    hexagonal: bool = True
    cone: float = 0.021
    eraser: float = 0.016
    paint: Colour = (0.96, 0.70, 0.10, 1.0)
    end: Colour = (0.96, 0.70, 0.10, 1.0)
    lead: Colour = (0.20, 0.20, 0.22, 1.0)


_GRAPHITE: Colour = (0.20, 0.20, 0.22, 1.0)
_PAINTS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.10, 0.30, 0.22, 1.0), (0.85, 0.72, 0.35, 1.0), _GRAPHITE),
    ((0.76, 0.12, 0.13, 1.0), (0.13, 0.13, 0.14, 1.0), _GRAPHITE),
    ((0.14, 0.30, 0.66, 1.0), (0.14, 0.30, 0.66, 1.0), (0.14, 0.30, 0.66, 1.0)),
    ((0.96, 0.70, 0.10, 1.0), (0.76, 0.12, 0.13, 1.0), _GRAPHITE),
    ((0.16, 0.16, 0.17, 1.0), (0.92, 0.92, 0.90, 1.0), _GRAPHITE),
    ((0.84, 0.30, 0.50, 1.0), (0.84, 0.30, 0.50, 1.0), (0.84, 0.30, 0.50, 1.0)),
    ((0.80, 0.64, 0.42, 1.0), (0.20, 0.48, 0.34, 1.0), _GRAPHITE),
    ((0.22, 0.58, 0.34, 1.0), (0.22, 0.58, 0.34, 1.0), (0.22, 0.58, 0.34, 1.0)),
)


def design(index: int) -> Pencil:
    """The sizes of instance `index`; 0 is a yellow school pencil, every fourth is round, every ninth jumbo."""
    if index == 0:
        return Pencil()
    rng = specimen_rng("pencil", index)
    paint, end, lead = in_turn(index, _PAINTS)
    jumbo = index % 9 == 4
    eraser = rng.uniform(0.014, 0.020) if lead == _GRAPHITE and index % 2 else 0.0
    cone = rng.uniform(0.018, 0.024) * (1.25 if jumbo else 1.0)
    whole = rng.uniform(0.132, 0.178) + eraser  # they get shorter with use
    return Pencil(
        body=round(float(whole - cone), 4),
        thick=round(
            float(rng.uniform(0.0095, 0.0105) if jumbo else rng.uniform(0.0070, 0.0078)), 4
        ),
        hexagonal=index % 4 != 2,
        cone=round(float(cone), 4),
        eraser=round(float(eraser), 4),
        paint=paint,
        end=end,
        lead=lead,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: the point towards +x."""
    pencil = design(index)
    return tool_specimen(
        "pencil",
        [_stick(pencil), *_eraser(pencil)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.about_x(),
    )


def _section(pencil: Pencil, points: int) -> Float[np.ndarray, "points"]:
    """The body's radius around: a hexagon whose edges are cut by a circle."""
    flat = pencil.thick / 2
    if not pencil.hexagonal:
        return np.full(points, flat)
    angles = (np.arange(points) + 0.5) * (2 * np.pi / points)
    hexagon = flat / np.cos((angles + np.pi / 6) % (np.pi / 3) - np.pi / 6)
    return np.minimum(hexagon, 1.07 * flat)


def _loop(
    x: Float[np.ndarray, "points"] | float, radius: Float[np.ndarray, "points"]
) -> Float[np.ndarray, "points 3"]:
    angles = (np.arange(len(radius)) + 0.5) * (2 * np.pi / len(radius))
    along = np.broadcast_to(x, radius.shape)
    return np.column_stack([along, radius * np.cos(angles), radius * np.sin(angles)])


def _stick(pencil: Pencil) -> Piece:
    """Body and point; the cone cuts the flats of the hexagon farther back than its edges."""
    body, around = _section(pencil, POINTS), np.ones(POINTS)
    widest = float(body.max())
    rear = pencil.eraser - pencil.body
    slope = (widest - TIP) / pencil.cone
    ends = (widest - body) / slope  # where the paint ends, from the joint on
    bare = (widest - LEAD) / slope  # and the wood
    chamfer = 0.0005
    band = rear + 0.012
    loops = [
        _loop(rear, body - chamfer),
        _loop(rear + chamfer, body),
        _loop(band, body),
        _loop(ends, body),
        _loop(bare, LEAD * around),
        _loop(pencil.cone, TIP * around),
    ]
    rear_end, painted, wood, lead = (
        loft(np.stack(loops[a:b]), caps)
        for a, b, caps in (
            (0, 3, (True, False)),
            (2, 4, (False, False)),
            (3, 5, (False, False)),
            (4, 6, (False, True)),
        )
    )
    visual = tuple(
        Shape("mesh", mesh=mesh, rgba=rgba)
        for mesh, rgba in (
            (rear_end, pencil.end),
            (painted, pencil.paint),
            (wood, WOOD),
            (lead, pencil.lead),
        )
    )
    whole = loft(np.stack(loops))
    corners = 12
    part, point = _section(pencil, corners), np.full(corners, TIP)
    collision = (
        convex_part(np.concatenate([_loop(rear, part), _loop(0.0, part)])),
        convex_part(np.concatenate([_loop(0.0, part), _loop(pencil.cone, point)])),
    )
    return Piece(visual, collision, solid_mass_properties(whole, CEDAR * float(whole.volume)))


def _eraser(pencil: Pencil) -> list[Piece]:
    """The ferrule, with two grooves, and the eraser in it."""
    if pencil.eraser == 0.0:
        return []
    rear, rubber = -pencil.body, 0.45 * pencil.eraser
    radius = 1.03 * pencil.thick / 2
    edge, groove = rear + rubber, 0.93 * radius
    shares = ((0.0, radius), (0.25, radius), (0.32, groove), (0.39, radius))
    shares += ((0.55, radius), (0.62, groove), (0.69, radius), (1.0, radius))
    table = [(edge + s * (pencil.eraser - rubber), r, r) for s, r in shares]
    soft = 0.95 * radius
    return [
        handle(
            [(rear, soft, soft), (edge, soft, soft)],
            [(np.inf, ERASER)],
            density=1200.0,
            rounding=(0.0012, 0.0),
        ),
        handle(table, [(np.inf, FERRULE)], density=1300.0),
    ]
