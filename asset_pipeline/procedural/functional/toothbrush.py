"""A manual toothbrush: a straight handle with grip inlays, a slim neck, a head with tufts of bristles.

Real sizes. Adults' toothbrushes are 175-195 mm long, children's 150-170 mm; handles 11-14 mm thick, necks
5-6 mm, heads 24-32 x 10-13 mm and 4-5 mm thick with bristles of 10-12 mm in 3-4 rows of 7-11 tufts; they weigh
12-18 g. Bamboo ones have a plain, flatter handle.

X runs to the head; the origin is where the handle narrows to the neck. The bristles reach farthest from the
axis: the label's Z points where they do, and Y out of the plane that mirrors the brush.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
import trimesh

from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, superellipse
from manipose_mj.assets.geometry import Shape

PLASTIC, BAMBOO, BRISTLES = 1050.0, 700.0, 480.0  # [kg/m^3]
THIN = 0.0024  # half the head's thickness [m]
SUNK = 0.0005  # of the tufts in the head [m]
WHITE: Colour = (0.95, 0.95, 0.94, 1.0)
WOOD: Colour = (0.82, 0.68, 0.46, 1.0)


@dataclass(frozen=True)
class Toothbrush:
    """Sizes [m] and colours.

    Attributes: handle, its length; wide and deep, its section; swell, how much thinner it is at its
    waist, as a share; neck, from the handle to the head, and slim, its diameter; head, length; broad,
    the head's width; rows of tufts and columns in each; bristle, their length; inlays, rings of rubber; bamboo; body, inlay and
    tuft colours.
    """

    handle: float = 0.108
    wide: float = 0.0125
    deep: float = 0.0115
    swell: float = 0.14
    neck: float = 0.046
    slim: float = 0.0054
    head: float = 0.029
    broad: float = 0.0118
    rows: int = 4
    columns: int = 9
    bristle: float = 0.0115
    inlays: int = 1
    bamboo: bool = False
    body: Colour = WHITE
    inlay: Colour = (0.12, 0.42, 0.74, 1.0)
    tuft: Colour = (0.35, 0.62, 0.86, 1.0)


_COLOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.16, 0.58, 0.46, 1.0), WHITE, (0.40, 0.78, 0.66, 1.0)),
    (WHITE, (0.84, 0.22, 0.34, 1.0), (0.92, 0.50, 0.58, 1.0)),
    ((0.24, 0.30, 0.62, 1.0), (0.92, 0.62, 0.16, 1.0), (0.95, 0.75, 0.30, 1.0)),
    ((0.94, 0.48, 0.18, 1.0), WHITE, (0.35, 0.62, 0.86, 1.0)),
    ((0.20, 0.21, 0.23, 1.0), (0.45, 0.78, 0.30, 1.0), (0.25, 0.26, 0.28, 1.0)),
    ((0.52, 0.34, 0.66, 1.0), (0.86, 0.80, 0.92, 1.0), (0.70, 0.56, 0.82, 1.0)),
)


def design(index: int) -> Toothbrush:
    """The sizes of instance `index`; 0 is an adult's, every sixth is of bamboo, every seventh a child's."""
    if index == 0:
        return Toothbrush()
    rng = specimen_rng("toothbrush", index)
    bamboo, child = index % 6 == 2, index % 7 == 5
    body, inlay, tuft = in_turn(index, _COLOURS)
    wide = rng.uniform(0.0116, 0.0134)
    rows, columns = (
        (3, int(rng.integers(6, 8)))
        if child
        else (
            int(rng.choice((3, 4))),
            int(rng.integers(8, 11)),
        )
    )
    broad = 0.0030 * rows + rng.uniform(-0.0003, 0.0006)
    return Toothbrush(
        handle=round(float(rng.uniform(0.094, 0.100) if child else rng.uniform(0.102, 0.114)), 4),
        wide=round(float(wide), 4),
        deep=round(
            float(rng.uniform(0.0090, 0.0100) if bamboo else wide * rng.uniform(0.85, 1.0)), 4
        ),
        swell=0.0 if bamboo else round(float(rng.uniform(0.0, 0.2)), 3),
        neck=round(float(rng.uniform(0.040, 0.044) if child else rng.uniform(0.042, 0.050)), 4),
        slim=uniform(rng, 0.0050, 0.0060),
        head=round(0.0031 * columns + 0.0025, 4),
        broad=round(float(broad), 4),
        rows=rows,
        columns=columns,
        bristle=uniform(rng, 0.0104, 0.0124),
        inlays=1 + index % 2,
        bamboo=bamboo,
        body=WOOD if bamboo else body,
        inlay=WOOD if bamboo else inlay,
        tuft=tuft,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: the head towards +x, the bristles up."""
    brush = design(index)
    low = brush.neck + 0.001
    return tool_specimen(
        "toothbrush",
        [_handle(brush), _neck(brush), _tufts(brush)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="y",
        functional=(low, brush.neck + brush.head),
    )


def _handle(brush: Toothbrush) -> Piece:
    """Straight, thinner at its waist, with the inlays where fingers and thumb are."""
    length = brush.handle
    wide, deep, waist = brush.wide / 2, brush.deep / 2, 1 - brush.swell
    rows = ((1.0, 0.94), (0.72, 1.0), (0.42, waist), (0.16, 1.0), (0.0, 0.96))
    table = [(-s * length, r * wide, r * deep) for s, r in rows]
    table = [*table[:-1], (-0.001, *table[-1][1:]), (0.0, 0.86 * wide, 0.86 * deep)]
    edges = (-0.80, -0.52, -0.34, -0.10)[4 - 2 * brush.inlays :]
    bands = [(s * length, (brush.body, brush.inlay)[k % 2]) for k, s in enumerate(edges)]
    bands.append((0.0, brush.body))
    density = BAMBOO if brush.bamboo else PLASTIC
    outline = superellipse(3.2 if brush.bamboo else 2.5)
    return handle(table, bands, density=density, outline=outline, rounding=(0.004, 0.0))


def _neck(brush: Toothbrush) -> Piece:
    """From the handle, within 8 mm, down to the slim neck, and on to the flat head."""
    wide, deep, slim, broad = brush.wide / 2, brush.deep / 2, brush.slim / 2, brush.broad / 2
    start, end = brush.neck, brush.neck + brush.head
    table = [
        (0.0, 0.86 * wide, 0.86 * deep),
        (0.004, 0.5 * (slim + 0.86 * wide), 0.5 * (slim + 0.86 * deep)),
        (0.009, 1.05 * slim, 1.05 * slim),
        (start - 0.008, slim, slim),
        (start, 0.9 * broad, THIN),
        (start + 0.003, broad, THIN),
        (end, broad, THIN),
    ]
    density = BAMBOO if brush.bamboo else PLASTIC
    outline = superellipse(2.6)
    bands = [(np.inf, brush.body)]
    return handle(table, bands, density=density, outline=outline, rounding=(0.0, 0.0022))


def _tufts(brush: Toothbrush) -> Piece:
    """Prisms in a grid, the outer columns in colour; together one block to the touch."""
    low = np.array([brush.neck + 0.0008, -brush.broad / 2 + 0.0006, THIN - SUNK])
    high = np.array([brush.neck + brush.head - 0.0012, -low[1], THIN + brush.bristle])
    radius = min(0.46 * (high[0] - low[0]) / brush.columns, 0.46 * (high[1] - low[1]) / brush.rows)
    x = np.linspace(low[0] + radius, high[0] - radius, brush.columns)
    y = np.linspace(low[1] + radius, high[1] - radius, brush.rows)
    coloured: list[trimesh.Trimesh] = []
    plain: list[trimesh.Trimesh] = []
    height = high[2] - low[2]
    for column, at in enumerate(x):
        for across in y:
            tuft = trimesh.creation.cylinder(radius, height, sections=8)
            tuft.apply_translation([at, across, low[2] + height / 2])
            end = min(column, brush.columns - 1 - column)
            (coloured if end < 2 or end % 3 == 0 else plain).append(tuft)
    visual = tuple(
        Shape("mesh", mesh=cast(trimesh.Trimesh, trimesh.util.concatenate(tufts)), rgba=rgba)
        for tufts, rgba in ((coloured, brush.tuft), (plain, WHITE))
    )
    block = box(low, high)
    return Piece(visual, (block,), shape_mass_properties([block], BRISTLES))
