"""A frying pan: flared, straight-walled (saute) or shallow (crepe).

Pans are sold by their diameter at the rim, from 160 mm and mostly 200-280 mm, and good ones have
walls and floors of 3 mm and more (e-catalog.com, guide to frying pans). Ours are light ones of
aluminium, 158-230 mm wide with walls of 2.7-3.1 mm, so that a Panda can lift them; handles and
depths are from general knowledge. X runs along the handle towards the pan; the origin is where the
handle's line meets the rim. Y points up: the pan's body hangs below its handle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.pieces import Piece, placed
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, superellipse
from asset_pipeline.procedural.vessel import Glaze, bent_wall, disc, rings, vessel
from manipose_mj.poses import compose

ALUMINIUM, STEEL = 2700.0, 7850.0  # [kg/m^3]
BAKELITE, WOOD = 1100.0, 700.0  # [kg/m^3], with the hollows of a moulded handle
BLACK: Colour = (0.13, 0.13, 0.14, 1.0)
METAL: Colour = (0.72, 0.73, 0.75, 1.0)
RIM_ABOVE = 0.0025  # the rim above the handle's line [m]
BRACKET = 0.030  # length of the steel between handle and rim [m]

Style = Literal["flared", "straight", "shallow"]
_STYLES: tuple[Style, ...] = ("flared", "straight", "flared", "shallow")
# Depth and foot as shares of the diameter, and the two shares of where the wall bends upwards.
_SHAPES: dict[Style, tuple[tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "flared": ((0.17, 0.21), (0.68, 0.75), (0.62, 0.08)),
    "straight": ((0.22, 0.27), (0.90, 0.93), (0.95, 0.15)),
    "shallow": ((0.105, 0.13), (0.80, 0.86), (0.70, 0.10)),
}
# Outside, inside, handle, and whether the handle is of wood.
_COLOURS: tuple[tuple[Colour, Colour, Colour, bool], ...] = (
    ((0.72, 0.13, 0.12, 1.0), (0.20, 0.20, 0.21, 1.0), BLACK, False),
    ((0.66, 0.67, 0.69, 1.0), (0.74, 0.75, 0.77, 1.0), BLACK, False),
    ((0.45, 0.60, 0.52, 1.0), (0.93, 0.90, 0.82, 1.0), (0.72, 0.52, 0.33, 1.0), True),
    ((0.16, 0.17, 0.18, 1.0), (0.24, 0.24, 0.25, 1.0), (0.55, 0.35, 0.20, 1.0), True),
    ((0.72, 0.45, 0.28, 1.0), (0.72, 0.73, 0.75, 1.0), BLACK, False),
    ((0.18, 0.28, 0.50, 1.0), (0.22, 0.22, 0.24, 1.0), BLACK, False),
)


@dataclass(frozen=True)
class Pan:
    """Sizes [m], style and colours.

    Attributes: style of the wall; diameter at the rim; depth; foot, diameter of the flat bottom; bend,
    where the wall turns up (two shares, as in `bent_wall`'s control point); wall, thickness; grip, the
    handle's length without its bracket; wide, its width; outside, inside and handle, colours; wooden,
    the handle.
    """

    style: Style = "flared"
    diameter: float = 0.200
    depth: float = 0.038
    foot: float = 0.142
    bend: tuple[float, float] = (0.62, 0.08)
    wall: float = 0.0030
    grip: float = 0.145
    wide: float = 0.0250
    outside: Colour = (0.20, 0.20, 0.21, 1.0)
    inside: Colour = (0.28, 0.28, 0.29, 1.0)
    handle: Colour = BLACK
    wooden: bool = False


def design(index: int) -> Pan:
    """The sizes of instance `index`; 0 is a coated frying pan of 200 mm, the styles take turns."""
    if index == 0:
        return Pan()
    rng = specimen_rng("pan", index)
    style = _STYLES[index % 4]
    depth, foot, bend = _SHAPES[style]
    diameter = rng.uniform(0.158, 0.210 if style == "straight" else 0.230)
    outside, inside, colour, wooden = in_turn(index, _COLOURS)
    return Pan(
        style,
        diameter=round(float(diameter), 4),
        depth=round(float(diameter * rng.uniform(*depth)), 4),
        foot=round(float(diameter * rng.uniform(*foot)), 4),
        bend=bend,
        wall=uniform(rng, 0.0027, 0.0031),
        grip=uniform(rng, 0.132, 0.165),
        wide=uniform(rng, 0.022, 0.027),
        outside=outside,
        inside=inside,
        handle=colour,
        wooden=wooden,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, upright, its handle along x and the pan at the far end."""
    pan = design(index)
    return tool_specimen(
        "pan",
        [_body(pan), *_handle(pan)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="y",
    )


def _body(pan: Pan) -> Piece:
    start, end = np.array([pan.foot / 2, 0.0]), np.array([pan.diameter / 2, pan.depth])
    wall = bent_wall(start, start + (end - start) * pan.bend, end, pan.wall, points=15)
    body = vessel(
        np.array([[0.0, 0.0], [pan.foot / 2 - 0.001, 0.0]]),
        wall,
        base=[disc(pan.foot / 2, 0.0, float(wall.inner[0, 1]))],
        rings=rings(wall, (len(wall.outer) // 2, len(wall.outer) - 1)),
        glaze=Glaze.plain(pan.outside, METAL, pan.inside),
        density=ALUMINIUM,
        lip=0.42 * pan.wall,
        sections=64,
    )
    at = np.array([pan.diameter / 2, 0.0, RIM_ABOVE - pan.depth])
    return placed(body, compose(np.eye(3), at))


def _handle(pan: Pan) -> list[Piece]:
    """The grip and the steel bracket that holds the pan."""
    n, y, z = pan.grip + BRACKET, pan.wide / 2, 0.34 * pan.wide
    table = [(-n, 0.84 * y, 0.92 * z), (-0.90 * n, y, z), (-0.62 * n, 0.92 * y, 1.04 * z)]
    table += [(-0.34 * n, 0.72 * y, 0.92 * z), (-BRACKET, 0.74 * y, 0.86 * z)]
    grip = handle(
        table,
        [(-0.93 * n, METAL if not pan.wooden else pan.handle), (0.0, pan.handle)],
        density=WOOD if pan.wooden else BAKELITE,
        outline=superellipse(2.8),
        rounding=(0.0055, 0.0015),
    )
    bracket = handle(
        [
            (-BRACKET - 0.004, 0.58 * y, 0.0024),
            (-0.012, 0.62 * y, 0.0022),
            (0.0022, 1.2 * y, 0.0019),
        ],
        [(0.0, METAL)],
        density=STEEL,
        outline=superellipse(6.0),
    )
    return [grip, bracket]
