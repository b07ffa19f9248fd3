"""A turner: a handle, a cranked stem and a flat blade below the handle's axis, slotted or plain.

Real sizes. Turners are 280-360 mm long; blades 70-95 x 85-115 mm, of steel 1 mm thick (drawn 2 mm thick, for a
simulated hand to hold) or nylon and wood 2.5-5 mm; handles 100-135 mm long, 18-26 mm wide and 12-20 mm thick.
They weigh 70-150 g.

The blade hangs below the handle's axis: the label's Y points up, away from it. X runs along the handle to the
blade; the origin is where the handle ends and the stem begins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
import shapely.affinity
from jaxtyping import Float

from asset_pipeline.procedural.extruded import panel
from asset_pipeline.procedural.pieces import Piece, placed
from asset_pipeline.procedural.revolution import halves
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, superellipse
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose

STEEL, NYLON, PLASTIC, WOOD = 7850.0, 1150.0, 900.0, 680.0  # [kg/m^3]; plastic handles are hollow
THIN_STEEL = 4500.0  # of a blade drawn thicker than it is: its mass is right [kg/m^3]
STEEL_GREY: Colour = (0.76, 0.77, 0.79, 1.0)
BLACK: Colour = (0.15, 0.15, 0.16, 1.0)
BEECH: Colour = (0.80, 0.62, 0.40, 1.0)

Style = Literal["steel", "nylon", "wooden handle"]
Holes = Literal["slots", "none", "long slots", "round"]
_STYLES: tuple[Style, ...] = ("nylon", "steel", "wooden handle")
_HOLES: tuple[Holes, ...] = ("slots", "none", "long slots", "round")


@dataclass(frozen=True)
class Spatula:
    """Sizes [m], style and colours.

    Attributes: style; grip, the handle's length; wide and deep, its section; stem, from the handle to
    the blade along x, and rod, its width; drop of the blade below the axis; length, front and back
    width of the blade; wall, its thickness; tilt, how it slopes down to its edge [rad]; holes; body and
    ring, colours of the handle; metal, of stem and blade.
    """

    style: Style = "steel"
    grip: float = 0.120
    wide: float = 0.0225
    deep: float = 0.0165
    stem: float = 0.088
    rod: float = 0.0085
    drop: float = 0.029
    length: float = 0.100
    front: float = 0.080
    back: float = 0.062
    wall: float = 0.0020
    tilt: float = 0.10
    holes: Holes = "slots"
    body: Colour = BLACK
    ring: Colour = STEEL_GREY
    metal: Colour = STEEL_GREY


_COLOURS: dict[Style, tuple[tuple[Colour, Colour, Colour], ...]] = {
    "steel": (
        ((0.72, 0.14, 0.13, 1.0), STEEL_GREY, STEEL_GREY),
        ((0.18, 0.34, 0.56, 1.0), BLACK, STEEL_GREY),
        (BLACK, (0.80, 0.40, 0.14, 1.0), STEEL_GREY),
        ((0.88, 0.88, 0.86, 1.0), BLACK, STEEL_GREY),
    ),
    "nylon": (
        (BLACK, (0.55, 0.56, 0.58, 1.0), BLACK),
        ((0.22, 0.24, 0.27, 1.0), (0.35, 0.70, 0.40, 1.0), (0.22, 0.24, 0.27, 1.0)),
        ((0.20, 0.52, 0.56, 1.0), (0.92, 0.92, 0.90, 1.0), (0.20, 0.52, 0.56, 1.0)),
        ((0.80, 0.22, 0.18, 1.0), (0.92, 0.92, 0.90, 1.0), (0.80, 0.22, 0.18, 1.0)),
    ),
    "wooden handle": (
        (BEECH, STEEL_GREY, STEEL_GREY),
        ((0.56, 0.36, 0.21, 1.0), (0.80, 0.64, 0.32, 1.0), STEEL_GREY),
        ((0.38, 0.23, 0.15, 1.0), STEEL_GREY, (0.20, 0.20, 0.21, 1.0)),
    ),
}


def design(index: int) -> Spatula:
    """The sizes of instance `index`; 0 is a slotted steel turner, the kinds take turns after it."""
    if index == 0:
        return Spatula()
    rng = specimen_rng("spatula", index)
    style = _STYLES[index % len(_STYLES)]
    body, ring, metal = in_turn(1 + index // len(_STYLES), _COLOURS[style])
    front = rng.uniform(0.070, 0.092)
    nylon = style == "nylon"
    return Spatula(
        style,
        grip=uniform(rng, 0.104, 0.132),
        wide=uniform(rng, 0.0190, 0.0250),
        deep=uniform(rng, 0.0140, 0.0180),
        stem=uniform(rng, 0.072, 0.105),
        rod=round(float(rng.uniform(0.0100, 0.0125) if nylon else rng.uniform(0.0070, 0.0095)), 4),
        drop=uniform(rng, 0.022, 0.032),
        length=uniform(rng, 0.085, 0.110),
        front=round(float(front), 4),
        back=round(float(front * rng.uniform(0.62, 0.95)), 4),
        wall=round(float(rng.uniform(0.0026, 0.0034) if nylon else rng.uniform(0.0020, 0.0023)), 4),
        tilt=round(float(rng.uniform(0.04, 0.14)), 3),
        holes=_HOLES[(index + index // 4) % len(_HOLES)],
        body=body,
        ring=ring,
        metal=metal,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: the blade towards +x, hanging below the handle."""
    spatula = design(index)
    c, s = np.cos(spatula.tilt), np.sin(spatula.tilt)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    pose = compose(turn, np.array([spatula.stem, 0.0, -spatula.drop]))
    density = NYLON if spatula.style == "nylon" else THIN_STEEL
    half = spatula.wall / 2
    outline = _outline(spatula)
    blade = panel(outline, -half, half, rgba=spatula.metal, density=density)
    parts = [
        half for part in blade.collision for half in (halves(part) if _wide(part) else (part,))
    ]
    blade = replace(blade, collision=tuple(parts))
    return tool_specimen(
        "spatula",
        [_handle(spatula), _stem(spatula, pose), placed(blade, pose)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="y",
        functional=(spatula.stem, np.inf),
    )


def _wide(part: Shape) -> bool:
    """Whether a part of the blade reaches far to either side."""
    low, high = part.surface().bounds[:, 1]
    return low < -0.01 and high > 0.01


def _handle(spatula: Spatula) -> Piece:
    length, wide, deep = spatula.grip, spatula.wide / 2, spatula.deep / 2
    rows = (
        (1.0, 0.88, 0.80),
        (0.82, 1.0, 1.0),
        (0.50, 0.90, 0.96),
        (0.12, 0.86, 0.92),
        (0.0, 0.80, 0.88),
    )
    table = [(-s * length, y * wide, z * deep) for s, y, z in rows]
    bands = [
        (-0.93 * length, spatula.ring),
        (-0.08 * length, spatula.body),
        (0.0, spatula.ring),
    ]
    density = WOOD if spatula.style == "wooden handle" else PLASTIC
    outline = superellipse(2.0)
    return handle(table, bands, density=density, outline=outline, rounding=(0.5 * deep, 0.001))


def _stem(spatula: Spatula, pose: Float[np.ndarray, "4 4"]) -> Piece:
    """From inside the handle, cranked down to lie on the rear of the blade."""
    nylon = spatula.style == "nylon"
    thick = 0.0032 if nylon else 0.0019  # half of it
    foot = 0.020  # of its length on the blade
    share = np.linspace(0, 1, 13)
    # Eased by a cubic, which meets the blade's slope.
    slope = -np.tan(spatula.tilt) * spatula.stem
    top = (pose @ [0.0, 0.0, 0.3 * spatula.wall + thick, 1.0])[[0, 2]]
    z = top[1] * (3 * share**2 - 2 * share**3) + slope * (share**3 - share**2)
    line = np.column_stack([top[0] * share, np.zeros_like(share), z])
    end = (pose @ [foot, 0.0, 0.3 * spatula.wall + thick, 1.0])[:3]
    line = np.concatenate([[[-0.004, 0.0, 0.0]], line, [line[-1] + 0.6 * (end - line[-1]), end]])
    wide = np.concatenate([np.full(11, spatula.rod), np.linspace(1.0, 1.7, 5) * spatula.rod]) / 2
    half = np.column_stack([np.full(len(line), thick), wide])
    half[-1] *= 0.8
    stem = bar(
        line,
        half,
        parts=(3, 6, 9, 11, 13),
        rgba=spatula.metal,
        density=NYLON if nylon else STEEL,
        power=4.0,
    )
    *front, foot_part = stem.collision
    return replace(stem, collision=(*front, *halves(foot_part)))


def _outline(spatula: Spatula) -> shapely.Polygon:
    """The blade in its own plane, x from the stem to its edge, corners rounded, with its holes."""
    length, front, back = spatula.length, spatula.front / 2, spatula.back / 2
    plan = shapely.Polygon(
        [(0.0, -back), (0.94 * length, -front), (length, -0.94 * front), (length, 0.94 * front)]
        + [(0.94 * length, front), (0.0, back)]
    )
    round_back = 0.012
    plan = plan.buffer(-round_back).buffer(round_back, quad_segs=2)
    holes = shapely.MultiPolygon(_holes(spatula))
    cut = plan.difference(holes)
    assert isinstance(cut, shapely.Polygon)
    return cut


def _holes(spatula: Spatula) -> list[shapely.Polygon]:
    length, wide = spatula.length, spatula.back + 0.5 * (spatula.front - spatula.back)
    if spatula.holes == "none":
        return []
    if spatula.holes == "round":
        rows = ((0.42, 2), (0.60, 3), (0.78, 4))
        pitch = wide / 5.2
        return [
            shapely.Point(x * length, (k - (n - 1) / 2) * pitch).buffer(0.0036, quad_segs=1)
            for x, n in rows
            for k in range(n)
        ]
    count, start, stop = (4, 0.36, 0.74) if spatula.holes == "slots" else (3, 0.30, 0.86)
    half = 0.0034 if spatula.holes == "slots" else 0.0042
    pitch = wide / (count + 0.9)
    slots = []
    for k in range(count):
        y = (k - (count - 1) / 2) * pitch
        line = shapely.LineString([(start * length, 0.94 * y), (stop * length, 1.04 * y)])
        slots.append(line.buffer(half, quad_segs=1))
    return slots
