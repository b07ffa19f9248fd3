"""A box cutter: a utility knife with a trapezoid blade, or one with a long blade to snap off.

Typical sizes, from general knowledge and not from a data sheet: a utility knife is 140-150 mm long,
33 mm high and 17 mm thick, its blade 19 mm high; a large snap-off cutter is 150 mm long, 25 mm high
and 15 mm thick, its blade 18 mm wide. X runs from the handle to the blade; the origin is where the
nose begins, at the finger guard. Z points to the guard, on the edge's side; the slider is on the
back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from asset_pipeline.procedural.extruded import panel
from asset_pipeline.procedural.pieces import Piece, solid_piece
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import loft_outwards
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, loop_hulls, superellipse

STEEL = 7800.0  # [kg/m^3]
SHELL = 1500.0  # two shells of plastic or zinc about a channel, on average [kg/m^3]
BLADE: Colour = (0.80, 0.81, 0.83, 1.0)
GROOVE: Colour = (0.45, 0.46, 0.48, 1.0)
BLACK: Colour = (0.13, 0.13, 0.14, 1.0)

Style = Literal["trapezoid", "snap"]
_COLOURS: tuple[tuple[Colour, Colour], ...] = (
    ((0.93, 0.70, 0.10, 1.0), BLACK),
    ((0.78, 0.14, 0.12, 1.0), BLACK),
    ((0.62, 0.64, 0.67, 1.0), (0.93, 0.72, 0.12, 1.0)),
    ((0.15, 0.32, 0.62, 1.0), (0.85, 0.86, 0.88, 1.0)),
    ((0.92, 0.45, 0.10, 1.0), BLACK),
    ((0.20, 0.21, 0.23, 1.0), (0.80, 0.16, 0.13, 1.0)),
    ((0.22, 0.55, 0.35, 1.0), BLACK),
)


@dataclass(frozen=True)
class Cutter:
    """Sizes [m], style and colours.

    Attributes: style; grip, length of the handle; half, its half height; thick, half its thickness;
    guard, how far the finger guard stands below the handle; nose, its length; blade, how far it
    is out; broad, its width; body and accent (slider, guard), colours.
    """

    style: Style = "trapezoid"
    grip: float = 0.112
    half: float = 0.0135
    thick: float = 0.0085
    guard: float = 0.0060
    nose: float = 0.022
    blade: float = 0.017
    broad: float = 0.018
    body: Colour = (0.62, 0.64, 0.67, 1.0)
    accent: Colour = (0.93, 0.72, 0.12, 1.0)


def design(index: int) -> Cutter:
    """The sizes of instance `index`; 0 is a utility knife, every other one has a blade to snap off."""
    if index == 0:
        return Cutter()
    rng = specimen_rng("cutter", index)
    snap = index % 2 == 1
    half = rng.uniform(0.0110, 0.0130) if snap else rng.uniform(0.0125, 0.0145)
    body, accent = in_turn(index, _COLOURS)
    return Cutter(
        "snap" if snap else "trapezoid",
        grip=uniform(rng, 0.098, 0.118),
        half=round(float(half), 4),
        thick=round(float(half * rng.uniform(0.58, 0.68)), 4),
        guard=uniform(rng, 0.0055, 0.0070),
        nose=round(float(rng.uniform(0.014, 0.019) if snap else rng.uniform(0.020, 0.026)), 4),
        blade=round(float(rng.uniform(0.020, 0.045) if snap else rng.uniform(0.012, 0.020)), 4),
        broad=round(float(half * rng.uniform(1.35, 1.50)), 4),
        body=body,
        accent=accent,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying on its side along x, its edge towards -y."""
    cutter = design(index)
    return tool_specimen(
        "cutter",
        [_body(cutter), _inlay(cutter), _nose(cutter), _slider(cutter), *_blade(cutter)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
    )


def _body(cutter: Cutter) -> Piece:
    n, y, z = cutter.grip, cutter.half, cutter.thick
    waist = 1.0 if cutter.style == "snap" else 0.94
    table = [(-n, 0.90 * y, 0.92 * z), (-0.85 * n, y, z), (-0.45 * n, waist * y, z), (0.0, y, z)]
    cap = (-0.90 * n, cutter.accent) if cutter.style == "snap" else (-0.97 * n, cutter.body)
    return handle(
        table,
        [cap, (0.0, cutter.body)],
        density=SHELL,
        outline=superellipse(4.5),
        rounding=(0.005, 0.0),
    )


def _nose(cutter: Cutter) -> Piece:
    """From the finger guard, which stands out below at once, to the mouth around the blade."""
    y, z, n = cutter.half, cutter.thick, cutter.nose
    mouth = (0.5 * cutter.broad + 0.002, -0.1 * y)
    rows = [  # x, upper and lower end, half thickness
        (-0.0005, y, -y - 0.85 * cutter.guard, 0.94 * z),
        (0.0020, y, -y - cutter.guard, 0.96 * z),
        (0.0065, 0.98 * y, -y - 0.75 * cutter.guard, 0.90 * z),
        (0.55 * n, 0.5 * y + 0.5 * (mouth[1] + mouth[0]), -y, 0.74 * z),
        (n, mouth[1] + mouth[0], mouth[1] - mouth[0], 0.45 * z),
    ]
    ring = superellipse(4.0, 16)
    loops = np.stack(
        [
            np.column_stack(
                [np.full(16, x), (up + low) / 2 + (up - low) / 2 * ring[:, 0], half * ring[:, 1]]
            )
            for x, up, low, half in rows
        ]
    )
    metal = cutter.style == "snap"
    return solid_piece(
        loft_outwards(loops),
        loop_hulls(loops),
        rgba=cutter.accent if metal else cutter.body,
        density=SHELL,
    )


def _inlay(cutter: Cutter) -> Piece:
    """A rubber patch, or the slot that shows the blade, on both faces."""
    trapezoid = cutter.style == "trapezoid"
    start, stop, half = (-0.88, -0.14, 0.52) if trapezoid else (-0.80, -0.08, 0.16)
    half *= cutter.half
    around = shapely.box(start * cutter.grip, -half, stop * cutter.grip, half)
    outline = around.buffer(-0.6 * half).buffer(0.6 * half, quad_segs=5)
    assert isinstance(outline, shapely.Polygon)
    out = cutter.thick + 0.0003
    colour = cutter.accent if trapezoid else GROOVE
    patch = panel(outline, -out, out, rgba=colour, density=1.0, coarse=around)
    return Piece(patch.visual, (), patch.mass)  # the body's own shape and mass stand for it


def _slider(cutter: Cutter) -> Piece:
    """A ribbed button on the back, low enough for the guard to reach clearly farther."""
    back, start = cutter.half, -0.52 * cutter.grip
    length, half = 0.20 * cutter.grip, 0.50 * cutter.thick
    rise = 0.0016
    ribs = [shapely.box(start, back - 0.004, start + length, back + 0.6 * rise)]
    pitch = length / 5
    ribs += [
        shapely.box(start + (k + 0.2) * pitch, back, start + (k + 0.7) * pitch, back + rise)
        for k in range(5)
    ]
    outline = shapely.unary_union(ribs)
    coarse = shapely.box(start, back - 0.004, start + length, back + rise)
    assert isinstance(outline, shapely.Polygon)
    return panel(outline, -half, half, rgba=cutter.accent, density=SHELL, coarse=coarse)


def _blade(cutter: Cutter) -> list[Piece]:
    """Its edge and point towards -y; the lines to snap it along are slanted like its end."""
    half, start, end = cutter.broad / 2, cutter.nose - 0.004, cutter.nose + cutter.blade
    middle = -0.1 * cutter.half
    low, high = middle - half, middle + half
    lean = 0.9 * cutter.broad if cutter.style == "trapezoid" else 0.45 * cutter.broad
    lean = min(lean, cutter.blade)
    sheet = 0.0006
    outline = shapely.Polygon([(start, low), (end, low), (end - lean, high), (start, high)])
    blade = panel(outline, -sheet, sheet, rgba=BLADE, density=STEEL)
    if cutter.style == "trapezoid":
        return [blade]
    lines = []
    for at in np.arange(end - 0.008, cutter.nose + 0.002, -0.008):
        line = shapely.Polygon(
            [(at - 0.0004, low), (at, low), (at - lean, high), (at - lean - 0.0004, high)]
        )
        mark = panel(line, -sheet - 1e-4, sheet + 1e-4, rgba=GROOVE, density=STEEL)
        lines.append(Piece(mark.visual, (), mark.mass))
    return [blade, *lines]
