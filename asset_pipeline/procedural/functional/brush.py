"""A flat paint brush: wall, sash and chip brushes, pastry brushes, artists' flats.

Real sizes. House painters' brushes are 25-75 mm wide and 8-20 mm thick at the ferrule with bristles of 35-60 mm,
170-240 mm long over all; chip brushes are thin with flat wooden handles; a pastry brush is 170-215 mm long and 25-45 mm
wide; artists' flats are 200-300 mm long on round handles of 8-13 mm with bristles of 12-28 mm width. Weights 10-110 g.

Two planes mirror it, so half a turn about X is in the group. X runs to the bristles, Y across the flat
side; the origin is where the handle enters the ferrule.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, superellipse
from manipose_mj.poses import SymmetryGroup

WOOD, FERRULE, BRISTLES = 620.0, 1800.0, 600.0  # [kg/m^3]; bristles are packed, ferrules hollow
STEEL: Colour = (0.76, 0.77, 0.79, 1.0)
BRASS: Colour = (0.80, 0.64, 0.32, 1.0)
COPPER: Colour = (0.76, 0.48, 0.34, 1.0)

Style = Literal["wall", "sash", "chip", "pastry", "artist"]
_STYLES: tuple[Style, ...] = ("sash", "wall", "chip", "pastry", "artist")
# Handle's length, ferrule's width, thickness and length, bristles' length [m].
_SIZES: dict[Style, tuple[tuple[float, float], ...]] = {
    "wall": ((0.112, 0.130), (0.056, 0.072), (0.0145, 0.0190), (0.030, 0.038), (0.050, 0.060)),
    "sash": ((0.105, 0.135), (0.030, 0.052), (0.0110, 0.0145), (0.026, 0.034), (0.042, 0.055)),
    "chip": ((0.095, 0.115), (0.032, 0.062), (0.0085, 0.0105), (0.024, 0.030), (0.036, 0.046)),
    "pastry": ((0.105, 0.125), (0.030, 0.044), (0.0090, 0.0110), (0.022, 0.028), (0.040, 0.050)),
    "artist": ((0.150, 0.205), (0.021, 0.028), (0.0068, 0.0080), (0.024, 0.032), (0.024, 0.032)),
}
# Half width and half thickness of the handle's section along it, from its rear, as shares of `broad`
# and of `thick`.
_HANDLES: dict[Style, tuple[tuple[float, float, float], ...]] = {
    "wall": ((1.0, 0.78, 0.72), (0.80, 0.92, 0.85), (0.45, 0.74, 0.95), (0.12, 1.0, 1.0)),
    "sash": ((1.0, 0.84, 0.72), (0.70, 0.86, 0.92), (0.35, 0.84, 1.0), (0.10, 1.0, 1.0)),
    "chip": ((1.0, 0.90, 1.0), (0.75, 0.98, 1.0), (0.40, 0.82, 1.0), (0.10, 1.0, 1.0)),
    "pastry": ((1.0, 0.80, 1.0), (0.72, 1.0, 1.0), (0.35, 0.88, 1.0), (0.10, 0.94, 1.0)),
    "artist": ((1.0, 0.64, 0.64), (0.50, 0.84, 0.84), (0.22, 1.0, 1.0), (0.06, 0.92, 0.92)),
}


@dataclass(frozen=True)
class Brush:
    """Sizes [m], style and colours.

    Attributes: style; handle, its length; width, thick and ferrule, width, thickness and length of the
    ferrule; bristle, length; broad and deep, width and thickness of the handle; dip, a coloured
    share at the handle's rear; wood, rear, metal and bristle colours, and that of the bristles' tips.
    """

    style: Style = "wall"
    handle: float = 0.122
    width: float = 0.062
    thick: float = 0.0165
    ferrule: float = 0.034
    bristle: float = 0.054
    broad: float = 0.031
    deep: float = 0.0150
    dip: float = 0.25
    wood: Colour = (0.82, 0.63, 0.38, 1.0)
    rear: Colour = (0.76, 0.16, 0.13, 1.0)
    metal: Colour = STEEL
    hair: Colour = (0.16, 0.14, 0.13, 1.0)
    tips: Colour = (0.28, 0.24, 0.21, 1.0)


# Handle, its rear end, ferrule, bristles and their tips.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour, Colour], ...] = (
    (
        (0.84, 0.67, 0.42, 1.0),
        (0.84, 0.67, 0.42, 1.0),
        STEEL,
        (0.88, 0.82, 0.68, 1.0),
        (0.93, 0.89, 0.78, 1.0),
    ),
    (
        (0.16, 0.32, 0.60, 1.0),
        (0.95, 0.95, 0.93, 1.0),
        STEEL,
        (0.93, 0.91, 0.86, 1.0),
        (0.96, 0.95, 0.92, 1.0),
    ),
    (
        (0.60, 0.20, 0.14, 1.0),
        (0.15, 0.14, 0.14, 1.0),
        BRASS,
        (0.20, 0.16, 0.13, 1.0),
        (0.34, 0.27, 0.21, 1.0),
    ),
    (
        (0.93, 0.72, 0.16, 1.0),
        (0.18, 0.18, 0.19, 1.0),
        STEEL,
        (0.62, 0.42, 0.24, 1.0),
        (0.72, 0.52, 0.32, 1.0),
    ),
    (
        (0.15, 0.16, 0.17, 1.0),
        (0.82, 0.40, 0.14, 1.0),
        COPPER,
        (0.80, 0.58, 0.34, 1.0),
        (0.88, 0.70, 0.48, 1.0),
    ),
    (
        (0.22, 0.46, 0.34, 1.0),
        (0.88, 0.84, 0.70, 1.0),
        COPPER,
        (0.90, 0.86, 0.76, 1.0),
        (0.95, 0.92, 0.86, 1.0),
    ),
)


def design(index: int) -> Brush:
    """The sizes of instance `index`; 0 is a 60 mm wall brush, the kinds take turns after it."""
    if index == 0:
        return Brush()
    rng = specimen_rng("brush", index)
    style = _STYLES[mixed(index) % len(_STYLES)]
    length, width, thick, ferrule, bristle = (uniform(rng, *r) for r in _SIZES[style])
    if style == "artist":
        broad = deep = rng.uniform(0.0104, 0.0122)
    else:
        broad = np.clip(width * rng.uniform(0.50, 0.60), 0.017, 0.034)
        deep = thick * rng.uniform(0.80, 0.95)
    wood, rear, metal, hair, tips = in_turn(index, _COLOURS)
    return Brush(
        style,
        length,
        width,
        thick,
        ferrule,
        bristle,
        broad=round(float(broad), 4),
        deep=round(float(deep), 4),
        dip=round(float(rng.uniform(0.08, 0.34)), 3),
        wood=wood,
        rear=rear,
        metal=metal,
        hair=hair,
        tips=tips,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: the bristles towards +x, flat in the xy plane."""
    brush = design(index)
    return tool_specimen(
        "brush",
        [_handle(brush), _ferrule(brush), _bristles(brush)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.two_planes(),
        functional=(brush.ferrule, np.inf),
    )


def _handle(brush: Brush) -> Piece:
    length, wide, deep = brush.handle, brush.broad / 2, brush.deep / 2
    table = [(-s * length, y * wide, z * deep) for s, y, z in _HANDLES[brush.style]]
    table.append((0.0, *table[-1][1:]))
    bands = [((brush.dip - 1) * length, brush.rear), (0.0, brush.wood)]
    power = {"chip": 6.0, "pastry": 5.0, "artist": 2.0}.get(brush.style, 3.0)
    rounding = 0.7 * min(table[0][1:])
    outline = superellipse(power)
    return handle(table, bands, density=WOOD, outline=outline, rounding=(rounding, 0.0))


def _ferrule(brush: Brush) -> Piece:
    """A flat tube with two beads; an artist's is drawn from a round one."""
    length, wide, thick = brush.ferrule, brush.width / 2, brush.thick / 2
    bead, raised = 0.03 * length, 0.0005
    table = [(0.0, wide, thick)]
    for middle in (0.16, 0.30):
        at = middle * length
        table += [(at - 2 * bead, wide, thick), (at, wide + raised, thick + raised)]
    table += [(0.30 * length + 2 * bead, wide, thick), (length, wide, thick)]
    if brush.style == "artist":
        neck = brush.deep / 2
        table = [(0.0, 1.08 * neck, 1.08 * neck), (0.10 * length, 1.1 * neck, 1.08 * neck)]
        table += [(0.62 * length, wide, thick), (length, wide, thick)]
    outline = _flat(brush)
    return handle(table, [(np.inf, brush.metal)], density=FERRULE, outline=outline)


def _bristles(brush: Brush) -> Piece:
    """A little broader towards the middle, thinning out to a chisel edge."""
    start, length = brush.ferrule, brush.bristle
    wide, thick = brush.width / 2 - 0.0010, brush.thick / 2 - 0.0006
    spread = 1.03 if brush.style != "artist" else 1.0
    rows = ((0.0, 1.0, 1.0), (0.45, spread, 0.98), (0.8, 0.99 * spread, 0.74), (1.0, 0.96, 0.30))
    table = [(start + s * length, y * wide, z * thick) for s, y, z in rows]
    bands = [(start + 0.78 * length, brush.hair), (np.inf, brush.tips)]
    return handle(table, bands, density=BRISTLES, outline=_flat(brush))


def _flat(brush: Brush) -> Float[np.ndarray, "points 2"]:
    """The section of ferrule and bristles."""
    return superellipse(3.0 if brush.style == "artist" else 7.0)
