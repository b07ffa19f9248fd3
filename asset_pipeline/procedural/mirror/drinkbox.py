"""A drink carton: a small brick with a straw, a gable-top milk carton, or a carton with a sloping top and a cap.

Real sizes: 0.2 l bricks are 47 x 38 x 116 mm or 63 x 40 x 85 mm with a straw of 4-6 mm; gable-top cartons of 0.25-1 l have
bases of 57-75 mm and are 105-235 mm tall (Elopak, SIG and Tetra Pak's data sheets), ours oblong so that their ridge is
along the longer side; cartons with a slanted top 60-70 x 75-90 x 165-210 mm, their caps 28-38 mm wide. Full ones would
weigh up to 1 kg; the large ones here are partly drunk. Up is X. Straw and cap lie in the one mirror plane that is left and
reach out of the carton's outline, so by the rule of the bulge they are on Y's side; of a gable top Y lies along the ridge,
and half a turn maps it onto itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.moulded import (
    facing,
    moulded,
    printed,
    rectangle,
    slab_loops,
)
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen, solid_piece
from asset_pipeline.procedural.solids import box, ellipse, rounded_box
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

WHITE: Colour = (0.96, 0.96, 0.95, 1.0)
FOIL: Colour = (0.80, 0.82, 0.84, 1.0)
FIN = 0.0032  # thickness of a gable's seam, folded over [m]
EDGE = 0.0012
Style = Literal["brick", "gable", "slanted"]


@dataclass(frozen=True)
class DrinkBox:
    """Sizes [m] and colours.

    Attributes: style; length and width of the base; height up to the top, the eaves or the upper end of the
    slope; roof, rise of the gable or fall of the slope; fin, height of a gable's seam; straw or cap, radius;
    out, length of the straw above the top or height of the cap; reach, length of the straw's bent end; density
    [kg/m^3]; carton's, band's, print's, and straw's or cap's colours.
    """

    style: Style = "brick"
    length: float = 0.062
    width: float = 0.040
    height: float = 0.090
    roof: float = 0.0
    fin: float = 0.0
    radius: float = 0.0026
    out: float = 0.028
    reach: float = 0.026
    density: float = 1000.0
    carton: Colour = (0.93, 0.55, 0.12, 1.0)
    band: Colour = (0.98, 0.93, 0.80, 1.0)
    ink: Colour = (0.24, 0.50, 0.20, 1.0)
    extra: Colour = (0.95, 0.95, 0.95, 1.0)


# Carton, band, print, straw or cap.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    (WHITE, (0.22, 0.48, 0.78, 1.0), (0.14, 0.30, 0.58, 1.0), (0.16, 0.36, 0.66, 1.0)),
    ((0.72, 0.12, 0.20, 1.0), (0.95, 0.80, 0.78, 1.0), (0.94, 0.90, 0.84, 1.0), WHITE),
    (
        (0.60, 0.76, 0.30, 1.0),
        (0.95, 0.96, 0.88, 1.0),
        (0.26, 0.44, 0.16, 1.0),
        (0.24, 0.54, 0.24, 1.0),
    ),
    (WHITE, (0.78, 0.22, 0.20, 1.0), (0.94, 0.74, 0.20, 1.0), (0.78, 0.18, 0.16, 1.0)),
    (
        (0.40, 0.24, 0.14, 1.0),
        (0.90, 0.80, 0.62, 1.0),
        (0.80, 0.60, 0.30, 1.0),
        (0.90, 0.86, 0.78, 1.0),
    ),
    (
        (0.48, 0.30, 0.58, 1.0),
        (0.90, 0.86, 0.95, 1.0),
        (0.96, 0.80, 0.26, 1.0),
        (0.94, 0.76, 0.22, 1.0),
    ),
    (
        (0.97, 0.80, 0.22, 1.0),
        (0.97, 0.95, 0.88, 1.0),
        (0.86, 0.36, 0.10, 1.0),
        (0.88, 0.40, 0.12, 1.0),
    ),
)
_STYLES: tuple[Style, ...] = ("gable", "slanted", "brick")


def design(index: int) -> DrinkBox:
    """The sizes of instance `index`; 0 is a brick of 0.2 l with a straw, the styles take turns after it."""
    if index == 0:
        return DrinkBox()
    rng = specimen_rng("drinkbox", index)
    style: Style = in_turn(index, _STYLES)
    colours = dict(zip(("carton", "band", "ink", "extra"), in_turn(index, _COLOURS), strict=True))
    if style == "brick":
        length = uniform(rng, 0.046, 0.066)
        volume = float(rng.choice((0.125e-3, 0.2e-3, 0.25e-3)))
        width = round(length * float(rng.uniform(0.62, 0.80)), 4)
        height = round(float(np.clip(volume / (length * width), 0.074, 0.118)), 4)
        radius, out, reach = (
            uniform(rng, 0.0022, 0.0030),
            uniform(rng, 0.020, 0.034),
            uniform(rng, 0.024, 0.030),
        )
        return DrinkBox(style, length, width, height, 0.0, 0.0, radius, out, reach, **colours)
    if style == "gable":
        width = uniform(rng, 0.052, 0.064)
        length = round(width * float(rng.uniform(1.13, 1.24)), 4)
        height = uniform(rng, 0.075, 0.165)
        roof, fin = (
            round(width * float(rng.uniform(0.40, 0.50)), 4),
            uniform(rng, 0.011, 0.016),
        )
        density = float(rng.uniform(550.0, 950.0)) * min(1.0, 0.11 / height)
        return DrinkBox(
            style, length, width, height, roof, fin, density=round(density, 0), **colours
        )
    width = uniform(rng, 0.056, 0.066)
    length = round(width * float(rng.uniform(1.14, 1.26)), 4)
    height, roof = (
        uniform(rng, 0.145, 0.195),
        round(length * float(rng.uniform(0.46, 0.56)), 4),
    )
    density = round(float(rng.uniform(400.0, 650.0)), 0)
    radius, cap = uniform(rng, 0.0145, 0.0175), uniform(rng, 0.016, 0.020)
    return DrinkBox(style, length, width, height, roof, 0.0, radius, cap, 0.0, density, **colours)


def generate(index: int = 0) -> Specimen:
    """Instance `index`: straw, cap or ridge along x, standing on z = 0."""
    item = design(index)
    x, y = item.length / 2, item.width / 2
    extra = {"brick": _straw, "gable": _gable, "slanted": _cap}[item.style]
    upright = item.height - (item.roof if item.style == "slanted" else 0.0)
    return rigid_specimen(
        "drinkbox",
        [_carton(item), *extra(item)],
        object_type="mirror",
        symmetry=SymmetryGroup.two_planes() if item.style == "gable" else SymmetryGroup.identity(),
        areas=(AreaBox("grip", (-x, -y, 0.0), (x, y, upright)),),
    )


def _carton(item: DrinkBox) -> Piece:
    """The filled part with flat sides; its top slopes where the style says so."""
    x, y, z = item.length / 2, item.width / 2, item.height
    low, high = 0.10, 0.58 if item.style == "slanted" else 0.74
    edges = (EDGE, EDGE if item.style == "brick" else 0.0)
    loops = slab_loops(
        rectangle(x, y), EDGE, 0.0, z, edges=edges, cuts=(low * z, 0.26 * z, high * z)
    )
    if item.style == "slanted":
        top = loops[-1]
        top[:, 2] -= item.roof * (top[:, 0] / item.length + 0.5)
    bands = ((low, item.band), (0.26, item.ink), (high, item.band), (1.0, item.carton))
    return moulded(loops, bands, density=item.density, prints=_pictures(item, low, high))


def _pictures(item: DrinkBox, low: float, high: float) -> list[Shape]:
    """A round fruit or splash on each side."""
    shapes = []
    middle = (0.26 + high) / 2 * item.height
    for normal, reach, half in (
        ((1, 0, 0), item.length, item.width),
        ((0, 1, 0), item.width, item.length),
    ):
        radius = min(0.36 * half, 0.40 * (high - 0.26) * item.height)
        for side in (-1.0, 1.0):
            direction = side * np.array(normal, float)
            face = facing(direction, reach / 2 * direction + [0, 0, middle])
            shapes.append(printed(ellipse((radius, radius), 32), face, item.carton, 1))
            shapes.append(printed(ellipse((0.62 * radius, 0.62 * radius), 24), face, item.ink, 2))
    return shapes


def _straw(item: DrinkBox) -> list[Piece]:
    """A bent straw out of a foil disc in the top, towards +x and past the edge."""
    x, z = item.length / 2, item.height
    root = 0.46 * x
    bend = 0.008
    turn = np.linspace(0, np.deg2rad(62.0), 6)
    curve = np.column_stack(
        [root + bend * (1 - np.cos(turn)), 0 * turn, z + item.out - bend + bend * np.sin(turn)]
    )
    ahead = np.array([np.sin(turn[-1]), 0.0, np.cos(turn[-1])])
    line = np.concatenate(
        [[[root, 0, z - 0.004], [root, 0, z]], curve, [curve[-1] + item.reach * ahead]]
    )
    half = np.full((len(line), 2), item.radius)
    straw = bar(line, half, parts=(1, 2, 4, 7), rgba=item.extra, density=300.0)
    foil = printed(ellipse((0.007, 0.007), 24), facing((0, 0, 1), (root, 0, z), up=(0, 1, 0)), FOIL)
    return [Piece((*straw.visual, foil), straw.collision, straw.mass)]


def _gable(item: DrinkBox) -> list[Piece]:
    """Two slopes up to a seam along x; the ends are folded in."""
    x, y, z, top = item.length / 2, item.width / 2, item.height, item.height + item.roof
    rows = []
    for height, half_x, half_y in ((z, x, y), (top, 0.97 * x, FIN / 2 + 0.0008)):
        rows.append(np.column_stack([rectangle(half_x, half_y), np.full(4, height)]))
    roof = moulded(np.stack(rows), ((1.0, item.carton),), density=0.25 * item.density)
    folds = []
    for side in (-1.0, 1.0):
        tilt = np.array([item.roof, 0.0, 0.03 * x])
        face = facing(tilt * [side, 1, 1], (side * (x - 0.3 * 0.03 * x), 0.0, z + 0.30 * item.roof))
        corners = np.array([[0.9 * y, -0.26], [0.0, 0.55], [-0.9 * y, -0.26]]) * [1.0, item.roof]
        folds.append(printed(corners, face, item.band))
    mesh = rounded_box(
        np.array([-0.97 * x, -FIN / 2, top - 0.002]),
        np.array([0.97 * x, FIN / 2, top + item.fin]),
        0.0008,
    ).surface()
    block = box((-0.97 * x, -FIN / 2, top - 0.002), (0.97 * x, FIN / 2, top + item.fin))
    seam = solid_piece(mesh, (block,), rgba=item.carton, density=700.0)
    return [Piece((*roof.visual, *folds), roof.collision, roof.mass), seam]


def _cap(item: DrinkBox) -> list[Piece]:
    """A ribbed screw cap low on the slope, over its lower edge."""
    r, h = item.radius, item.out
    slope = np.array([item.length, 0.0, -item.roof]) / np.hypot(item.length, item.roof)
    normal = np.array([-slope[2], 0.0, slope[0]])
    edge = np.array([item.length / 2, 0.0, item.height - item.roof])
    face = facing(normal, edge - 0.96 * r * slope, up=(0.0, 1.0, 0.0))
    ribs = [(r - 0.0006 * (k % 2), z) for k, z in enumerate(np.linspace(0.22, 0.80, 9) * h)]
    profile = np.array(
        [
            (0, -0.001),
            (r, -0.001),
            (r, 0.18 * h),
            *ribs,
            (r, 0.88 * h),
            (0.88 * r, h),
            (0, h + 1e-6),
        ]
    )
    bands = ((0.20 * h, WHITE), (1.0, item.extra))
    cap = turned(profile, (-0.001, 0.88 * h, h), bands=bands, density=350.0, sections=36)
    return [placed(cap, face)]
