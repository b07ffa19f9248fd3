"""A screwdriver: a handle of revolution, a round steel shank, a slotted, cross or hexagon tip.

Typical sizes, from general knowledge and not from a data sheet: a 5.5 x 100 slotted driver is 205
mm long with a handle of 98 mm by 30 mm and a shank of 5.5 mm; drivers on sale have shanks of 4-8 mm
by 60-175 mm and handles of 80-120 mm by 24-36 mm. The handle's grooves are under 1 mm deep and the
tip is a hundredth of the surface, so the shape counts as one of revolution. X runs from the handle
to the tip; the origin is where the shank leaves the handle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece, solid_piece
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import loft_outwards
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import ROUND, handle, lobed, loop_hulls, superellipse
from manipose_mj.poses import SymmetryGroup

STEEL, PLASTIC, WOOD = 7850.0, 1200.0, 700.0  # [kg/m^3]
CHROME: Colour = (0.76, 0.77, 0.79, 1.0)
BLACK_TIP: Colour = (0.20, 0.20, 0.21, 1.0)
BRASS: Colour = (0.80, 0.63, 0.28, 1.0)
SUNK = 0.012  # of the shank in the handle [m]

Style = Literal["fluted", "ergonomic", "insulated", "wooden"]
Tip = Literal["slotted", "cross", "hexagon"]

# Radius along the handle as a share of the largest one, by the share of its length from the front.
_PROFILES: dict[Style, tuple[tuple[float, float], ...]] = {
    "fluted": ((1.0, 0.90), (0.85, 1.0), (0.35, 0.97), (0.15, 0.78), (0.0, 0.70)),
    "ergonomic": ((1.0, 0.80), (0.72, 1.0), (0.38, 0.84), (0.17, 0.66), (0.06, 0.80), (0.0, 0.78)),
    "insulated": ((1.0, 0.86), (0.75, 1.0), (0.34, 0.80), (0.16, 0.70), (0.05, 0.98), (0.0, 0.98)),
    "wooden": ((1.0, 0.78), (0.76, 1.0), (0.45, 0.90), (0.18, 0.66), (0.09, 0.64), (0.0, 0.64)),
}
_STYLES: tuple[Style, ...] = ("fluted", "ergonomic", "insulated", "wooden")
_TIPS: tuple[Tip, ...] = ("slotted", "cross", "hexagon")
_COLOURS: dict[Style, tuple[tuple[Colour, Colour], ...]] = {
    "fluted": (
        ((0.86, 0.62, 0.10, 1.0), (0.75, 0.12, 0.10, 1.0)),
        ((0.78, 0.13, 0.12, 1.0), (0.15, 0.15, 0.16, 1.0)),
        ((0.15, 0.42, 0.24, 1.0), (0.90, 0.88, 0.80, 1.0)),
        ((0.16, 0.28, 0.60, 1.0), (0.90, 0.88, 0.84, 1.0)),
    ),
    "ergonomic": (
        ((0.14, 0.14, 0.15, 1.0), (0.20, 0.55, 0.28, 1.0)),
        ((0.15, 0.15, 0.16, 1.0), (0.85, 0.15, 0.13, 1.0)),
        ((0.20, 0.21, 0.23, 1.0), (0.93, 0.72, 0.12, 1.0)),
        ((0.12, 0.20, 0.42, 1.0), (0.85, 0.86, 0.88, 1.0)),
    ),
    "insulated": (
        ((0.82, 0.12, 0.10, 1.0), (0.95, 0.78, 0.14, 1.0)),
        ((0.92, 0.45, 0.10, 1.0), (0.18, 0.18, 0.20, 1.0)),
    ),
    "wooden": (
        ((0.66, 0.43, 0.24, 1.0), BRASS),
        ((0.45, 0.24, 0.14, 1.0), BRASS),
        ((0.80, 0.62, 0.40, 1.0), (0.62, 0.64, 0.66, 1.0)),
    ),
}


@dataclass(frozen=True)
class Screwdriver:
    """Sizes [m], style and colours.

    Attributes: style of the handle; grip, its length; thick, its largest diameter; shank, its length;
    wire, its diameter; tip, its kind; width, of a slotted tip; body and accent, colours.
    """

    style: Style = "fluted"
    grip: float = 0.098
    thick: float = 0.031
    shank: float = 0.105
    wire: float = 0.0060
    tip: Tip = "slotted"
    width: float = 0.0075
    body: Colour = (0.86, 0.62, 0.10, 1.0)
    accent: Colour = (0.75, 0.12, 0.10, 1.0)


def design(index: int) -> Screwdriver:
    """The sizes of instance `index`; 0 is a 5.5 x 100 slotted driver with an acetate handle."""
    if index == 0:
        return Screwdriver()
    rng = specimen_rng("screwdriver", index)
    style, tip = _STYLES[index % 4], _TIPS[int(rng.choice(3, p=[0.4, 0.4, 0.2]))]
    wire = rng.uniform(0.0045, 0.0075)
    grip = rng.uniform(0.084, 0.116)
    body, accent = in_turn(1 + index // 4, _COLOURS[style])
    return Screwdriver(
        style,
        grip=round(float(grip), 4),
        thick=round(float(grip * rng.uniform(0.29, 0.33)), 4),
        shank=uniform(rng, 0.072, 0.172),
        wire=round(float(wire), 4),
        tip=tip,
        width=round(float(wire * rng.uniform(1.2, 1.45)), 4),
        body=body,
        accent=accent,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying along x, the tip at the far end."""
    driver = design(index)
    start = driver.shank - 3.2 * driver.wire
    rod = driver.wire / 2
    steel = handle(
        [(-SUNK, rod, rod), (start, rod, rod)],
        [(start, CHROME)],
        density=STEEL,
    )
    pieces = [_grip(driver), steel, _tip(driver, start)]
    if driver.style == "insulated":
        sleeve = rod + 0.0012
        table = [(-0.002, sleeve, sleeve), (start - 0.006, sleeve, sleeve)]
        pieces.append(handle(table, [(start, driver.body)], density=PLASTIC))
    return tool_specimen(
        "screwdriver",
        pieces,
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.about_x(),
    )


def _grip(driver: Screwdriver) -> Piece:
    length, radius = driver.grip, driver.thick / 2
    table = [(-length * s, radius * r, radius * r) for s, r in _PROFILES[driver.style]]
    outline = {
        "fluted": lobed(8, 0.06),
        "ergonomic": lobed(6, 0.05),
        "insulated": lobed(6, 0.05),
        "wooden": ROUND,
    }[driver.style]
    bands: list[tuple[float, Colour]] = {
        "fluted": [(-0.86 * length, driver.accent), (0.0, driver.body)],
        "ergonomic": [
            (-0.88 * length, driver.accent),
            (-0.20 * length, driver.body),
            (0.0, driver.accent),
        ],
        "insulated": [(-0.16 * length, driver.body), (0.0, driver.accent)],
        "wooden": [(-0.10 * length, driver.body), (0.0, driver.accent)],
    }[driver.style]
    density = WOOD if driver.style == "wooden" else PLASTIC
    rounding = (0.45 * radius, 0.002)
    return handle(table, bands, density=density, outline=outline, rounding=rounding)


def _tip(driver: Screwdriver, start: float) -> Piece:
    """From the shank's section at `start` to the end of the tool."""
    rod, end, reach = driver.wire / 2, driver.shank, driver.shank - start
    if driver.tip == "slotted":
        wide = driver.width / 2
        rows = [(0.0, rod, rod, 2.0), (0.55, wide, 0.42 * rod, 3.0), (1.0, wide, 0.0005, 8.0)]
        loops = [
            _section(start + s * reach, superellipse(power) * [half_y, half_z])
            for s, half_y, half_z, power in rows
        ]
    elif driver.tip == "cross":
        rows = [(0.0, 1.0, 0.0), (0.45, 1.0, 0.0), (0.62, 0.96, 0.2), (0.95, 0.45, 0.5)]
        loops = [_section(start + s * reach, r * rod * lobed(4, depth, 32)) for s, r, depth in rows]
        loops.append(_section(end, 0.22 * rod * ROUND))
    else:
        # A circle of radius r becomes a hexagon whose corners are on it.
        angles = np.arange(32) * (2 * np.pi / 32)
        flat = np.cos(np.pi / 6) / np.cos((angles % (np.pi / 3)) - np.pi / 6)
        rows = [(0.0, 0.0, 1.0), (0.2, 1.0, 1.0), (0.96, 1.0, 1.0), (1.0, 1.0, 0.85)]
        loops = [
            _section(start + s * reach, scale * rod * (1 - share * (1 - flat))[:, None] * ROUND)
            for s, share, scale in rows
        ]
    stack = np.stack(loops)
    return solid_piece(loft_outwards(stack), loop_hulls(stack), rgba=BLACK_TIP, density=STEEL)


def _section(x: float, outline: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 3"]:
    return np.column_stack([np.full(len(outline), x), outline])
