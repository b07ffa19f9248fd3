"""A ball pen with a clip: click pens with a button, twist pens of metal, stick pens with a plug.

Real sizes. Click pens are 138-148 mm long and 10-12 mm thick, over the clip 14-17 mm, and weigh 9-12 g; metal
twist pens weigh 18-26 g. Clips are 35-50 mm long and 4-8 mm wide: ours are the broad ones of give-away pens, which
carry print. The cone at the tip is 12-20 mm long.

X runs to the tip; the origin is where the cone begins. The clip reaches farther from the axis than anything else:
the label's Z points to it, Y out of the plane that mirrors the pen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle

METAL: Colour = (0.78, 0.79, 0.81, 1.0)
GOLD: Colour = (0.84, 0.70, 0.40, 1.0)
BLACK: Colour = (0.14, 0.14, 0.15, 1.0)
WHITE: Colour = (0.94, 0.94, 0.93, 1.0)
TIP = 0.0011  # radius of the writing point [m]
BUTTON = 0.009  # how far it stands out [m]

Style = Literal["click", "twist", "stick"]
_STYLES: tuple[Style, ...] = ("click", "twist", "click", "stick")
# Body, grip, and fittings.
_COLOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    (WHITE, (0.14, 0.32, 0.68, 1.0), (0.14, 0.32, 0.68, 1.0)),
    ((0.12, 0.16, 0.30, 1.0), (0.12, 0.16, 0.30, 1.0), GOLD),
    ((0.80, 0.14, 0.14, 1.0), BLACK, METAL),
    ((0.16, 0.52, 0.44, 1.0), WHITE, METAL),
    (METAL, BLACK, METAL),
    ((0.95, 0.72, 0.16, 1.0), BLACK, BLACK),
    ((0.48, 0.30, 0.56, 1.0), (0.48, 0.30, 0.56, 1.0), METAL),
)


@dataclass(frozen=True)
class Pen:
    """Sizes [m], style and colours.

    Attributes: style; thick, the barrel's diameter; barrel, its length; cone, the tip's; clip, length;
    off, how far the clip reaches beyond the barrel; wide, of the clip; rubber, the coloured front of
    the barrel, a share of it; body, front and fitting (clip, ring, button) colours.
    """

    style: Style = "click"
    thick: float = 0.0106
    barrel: float = 0.117
    cone: float = 0.0165
    clip: float = 0.045
    off: float = 0.0050
    wide: float = 0.0066
    rubber: float = 0.32
    body: Colour = (0.13, 0.30, 0.62, 1.0)
    front: Colour = BLACK
    fitting: Colour = METAL


def design(index: int) -> Pen:
    """The sizes of instance `index`; 0 is a blue click pen, the kinds take turns after it."""
    if index == 0:
        return Pen()
    rng = specimen_rng("pen", index)
    style = _STYLES[index % len(_STYLES)]
    body, front, fitting = in_turn(index, _COLOURS)
    cone = rng.uniform(0.013, 0.019)
    button = BUTTON if style == "click" else 0.0
    return Pen(
        style,
        thick=uniform(rng, 0.0098, 0.0112),
        barrel=round(float(rng.uniform(0.137, 0.148) - cone - button), 4),
        cone=round(float(cone), 4),
        clip=uniform(rng, 0.043, 0.049),
        off=uniform(rng, 0.0048, 0.0055),
        wide=uniform(rng, 0.0060, 0.0074),
        rubber=round(float(rng.uniform(0.26, 0.48)), 3),
        body=body,
        front=front,
        fitting=fitting,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: the tip towards +x, the clip up."""
    pen = design(index)
    pieces = [_barrel(pen), _cone(pen), _clip(pen)]
    if pen.style == "click":
        low, radius = -pen.barrel - BUTTON, 0.30 * pen.thick
        table = [(low, radius, radius), (-pen.barrel, radius, radius)]
        pieces.append(_one(table, pen.fitting, 900.0, (0.45 * radius, 0.0)))
    return tool_specimen("pen", pieces, joint=(0.0, 0.0, 0.0), mirror_normal="y")


def _one(
    table: list[tuple[float, float, float]],
    rgba: Colour,
    density: float,
    rounding: tuple[float, float] = (0.0, 0.0),
) -> Piece:
    return handle(table, [(np.inf, rgba)], density=density, rounding=rounding)


def _barrel(pen: Pen) -> Piece:
    """Hollow but for the refill; the density makes up for it."""
    radius, length = pen.thick / 2, pen.barrel
    split = -pen.rubber * length
    ring = 0.0035
    bands: list[tuple[float, Colour]] = {
        "click": [(split, pen.body), (0.0, pen.front)],
        "twist": [
            (0.004 - length, pen.fitting),
            (-0.5 * length - ring, pen.body),
            (-0.5 * length, pen.fitting),
            (0.0, pen.body),
        ],
        "stick": [(0.012 - length, pen.fitting), (split, pen.body), (0.0, pen.front)],
    }[pen.style]
    density = 1500.0 if pen.style == "twist" else 800.0
    end = {"click": 0.0012, "twist": 0.45 * radius, "stick": 0.0008}[pen.style]
    table = [(-length, 0.94 * radius, 0.94 * radius), (-0.6 * length, radius, radius)]
    table.append((0.0, radius, radius))
    return handle(table, bands, density=density, rounding=(end, 0.0006))


def _cone(pen: Pen) -> Piece:
    """Set back a little from the barrel, slightly convex; the writing point stands out of it."""
    radius, cone = 0.88 * pen.thick / 2, pen.cone
    profile = ((0.0, 1.0), (0.45, 0.72), (0.82, 0.38), (0.825, TIP / radius), (1.0, TIP / radius))
    table = [(share * cone, r * radius, r * radius) for share, r in profile]
    tip: Colour = METAL if pen.fitting != GOLD else GOLD
    bands = [(0.82 * cone, tip if pen.style != "stick" else pen.front), (cone, tip)]
    density = 2500.0 if pen.style == "twist" else 1200.0
    return handle(table, bands, density=density, rounding=(0.0, 0.0007))


def _clip(pen: Pen) -> Piece:
    """A strip that rises from the rear of the barrel, runs along it and ends in a bead near it."""
    radius, thin = pen.thick / 2, 0.0011  # half its thickness
    high = radius + pen.off - thin
    start = -pen.barrel + 0.004
    x = start + pen.clip * np.array([0.0, 0.012, 0.04, 0.10, 0.3, 0.5, 0.7, 0.90, 0.95, 1.0])
    low = radius + 0.0012 + thin
    z = np.array([0.8 * radius, radius, 0.75 * high + 0.25 * radius, high, high, high, high])
    z = np.append(z, [0.8 * high + 0.2 * low, low, 0.3 * high + 0.7 * low])
    half = np.column_stack([np.full(len(x), thin), np.full(len(x), pen.wide / 2)])
    half[1:, 1] *= np.linspace(1.0, 0.9, len(x) - 1)
    line = np.column_stack([x, np.zeros_like(x), z])
    density = 4000.0 if pen.style == "twist" else 1200.0
    return bar(line, half, parts=(2, 3, 6, 8), rgba=pen.fitting, density=density, power=8.0)
