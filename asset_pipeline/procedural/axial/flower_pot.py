"""A flower pot with a drain hole: terracotta with its collar, or a glazed planter.

Real sizes. Standard clay pots are about as tall as wide, 8-15 cm over the rim for those one lifts with a hand, with
a foot two thirds as wide, walls of 5-6 mm and a collar a quarter of the height (makers' tables of the 9 to 15 cm
sizes; a 11 cm pot weighs about 350 g).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.solids import ellipse, print_on_face
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import Glaze, Wall, disc, rings, upright_wall, vessel
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

CLAY = 1850.0  # porous earthenware [kg/m^3]
FLOOR, RECESS = 0.007, 0.0012
HOLE: Colour = (0.10, 0.07, 0.05, 1.0)
TERRACOTTA: Colour = (0.74, 0.40, 0.25, 1.0)


@dataclass(frozen=True)
class FlowerPot:
    """Sizes [m] and colours.

    Attributes: width, over the rim; height; foot, the foot's width as a share of the rim's; wall;
    collar, its height as a share; ledge, how far it stands out; body, collar and inside colours.
    """

    width: float = 0.110
    height: float = 0.100
    foot: float = 0.66
    wall: float = 0.005
    collar: float = 0.26
    ledge: float = 0.0032
    body: Colour = TERRACOTTA
    rim: Colour = TERRACOTTA
    inside: Colour = (0.62, 0.33, 0.20, 1.0)


_GLAZES: tuple[tuple[Colour, Colour], ...] = (
    ((0.70, 0.36, 0.22, 1.0), (0.70, 0.36, 0.22, 1.0)),
    ((0.80, 0.52, 0.38, 1.0), (0.80, 0.52, 0.38, 1.0)),
    ((0.22, 0.42, 0.46, 1.0), (0.16, 0.32, 0.36, 1.0)),
    ((0.66, 0.34, 0.20, 1.0), (0.90, 0.88, 0.82, 1.0)),
    ((0.88, 0.86, 0.80, 1.0), (0.74, 0.40, 0.25, 1.0)),
    ((0.40, 0.26, 0.18, 1.0), (0.32, 0.20, 0.14, 1.0)),
)


def design(index: int) -> FlowerPot:
    """The sizes of instance `index`; 0 is an 11 cm clay pot; every fourth is a low bowl pot."""
    if index == 0:
        return FlowerPot()
    rng = specimen_rng("flower_pot", index)
    body, rim = in_turn(index, _GLAZES)
    width = uniform(rng, 0.080, 0.140)
    low = index % 4 == 3
    return FlowerPot(
        width=width,
        height=uniform(rng, 0.66 * width, 0.74 * width)
        if low
        else uniform(rng, 0.84 * width, 1.02 * width),
        foot=uniform(rng, 0.60, 0.72),
        wall=uniform(rng, 0.0042, 0.0054),
        collar=uniform(rng, 0.20, 0.32),
        ledge=uniform(rng, 0.0024, 0.0040),
        body=body,
        rim=rim,
        inside=(0.62, 0.33, 0.20, 1.0) if index % 3 else rim,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    pot = design(index)
    wall, seat = _wall(pot), pot.height * (1 - pot.collar)
    foot = wall.outer[0, 0]
    piece = vessel(
        np.array([[0, RECESS], [foot - 0.008, RECESS], [foot - 0.007, 0]]),
        wall,
        base=[disc(foot, 0.0, FLOOR)],
        rings=rings(wall, (1, 3)),
        glaze=Glaze(((seat - 1e-5, pot.body), (np.inf, pot.rim)), pot.rim, pot.inside),
        density=CLAY,
        lip=0.0018,
        rounding={3: 0.002, 5: 0.0012},
        sections=64,
    )
    piece = Piece((*piece.visual, *_drain()), piece.collision, piece.mass)
    return rigid_specimen(
        "flower_pot", [piece], object_type="axial", symmetry=SymmetryGroup.about_x()
    )


def _wall(pot: FlowerPot) -> Wall:
    foot, rim = pot.foot * pot.width / 2, pot.width / 2
    seat = pot.height * (1 - pot.collar)
    lower = rim - pot.ledge - 0.08 * pot.collar * pot.height
    outer = np.array(
        [[foot, 0.0], [lower, seat], [lower + pot.ledge, seat], [rim, pot.height]], float
    )
    slope = (lower - foot) / seat
    inner = np.array(
        [[foot + slope * FLOOR - pot.wall, FLOOR], [lower - pot.wall, seat], [0.0, pot.height]]
    )
    inner[2, 0] = lower - pot.wall + 0.08 * pot.collar * pot.height
    return upright_wall(outer, inner)


def _drain() -> tuple[Shape, ...]:
    """The hole as prints on the floor and under it."""
    above, below = np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0])
    above[2, 3], below[2, 3] = FLOOR, RECESS
    return tuple(
        Shape("mesh", mesh=print_on_face(ellipse((0.006, 0.006), 24), pose), rgba=HOLE)
        for pose in (above, below)
    )
