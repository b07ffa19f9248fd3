"""A plate with an upturned rim: a coupe plate, or a deep one for pasta.

Real sizes, of things on sale: dessert plates 160-210 mm, coupe plates 200-250 mm wide and 22-42 mm tall, porcelain
3-4 mm (the YCB plate: 258 mm wide, 24 mm tall, 279 g of plastic, Calli et al. 2015); melamine ones 3 mm at
1,500 kg/m^3. The flat is two thirds as wide as the rim, unlike a bowl's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.revolution import lathe
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import Glaze, bent_wall, disc, joints, rings, vessel
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

PORCELAIN, MELAMINE = 2350.0, 1500.0  # [kg/m^3]
POINTS = 16
RECESS = 0.0012
STRIPE = 0.00015  # how far the painted ring stands off [m]


@dataclass(frozen=True)
class Plate:
    """Sizes [m] and colours.

    Attributes: diameter; height; wall; foot, outer width of the foot ring as a share of the
    diameter; bend, where the curve turns up (two shares); density [kg/m^3]; glaze and the colour of
    the painted ring; ring, where that lies on the wall (two points of the curve).
    """

    diameter: float = 0.205
    height: float = 0.033
    wall: float = 0.0036
    foot: float = 0.64
    bend: tuple[float, float] = (0.74, 0.08)
    density: float = PORCELAIN
    glaze: Colour = (0.94, 0.94, 0.92, 1.0)
    paint: Colour = (0.18, 0.32, 0.58, 1.0)
    ring: tuple[int, int] = (11, 13)


_GLAZES: tuple[tuple[Colour, Colour], ...] = (
    ((0.93, 0.91, 0.85, 1.0), (0.52, 0.34, 0.20, 1.0)),
    ((0.86, 0.32, 0.24, 1.0), (0.95, 0.90, 0.78, 1.0)),
    ((0.34, 0.44, 0.46, 1.0), (0.22, 0.28, 0.30, 1.0)),
    ((0.62, 0.74, 0.60, 1.0), (0.94, 0.93, 0.86, 1.0)),
    ((0.94, 0.93, 0.90, 1.0), (0.72, 0.18, 0.20, 1.0)),
    ((0.92, 0.80, 0.42, 1.0), (0.60, 0.38, 0.16, 1.0)),
)


def design(index: int) -> Plate:
    """The sizes of instance `index`; 0 is a porcelain coupe plate."""
    if index == 0:
        return Plate()
    rng = specimen_rng("plate", index)
    glaze, paint = in_turn(index + index // 6, _GLAZES)
    light = index % 3 == 0
    diameter = uniform(rng, 0.165, 0.240)
    first = int(rng.integers(8, 13))
    return Plate(
        diameter=diameter,
        height=uniform(rng, max(0.030, 0.145 * diameter), 0.185 * diameter),
        wall=uniform(rng, 0.0028, 0.0034) if light else uniform(rng, 0.0030, 0.0040),
        foot=uniform(rng, 0.58, 0.68),
        bend=(uniform(rng, 0.70, 0.84), uniform(rng, 0.05, 0.14)),
        density=MELAMINE if light else PORCELAIN,
        glaze=glaze,
        paint=paint,
        ring=(first, min(first + int(rng.integers(1, 4)), POINTS - 2)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    plate = design(index)
    foot = plate.foot * plate.diameter / 2
    start = np.array([foot, 0.0030])
    end = np.array([plate.diameter / 2, plate.height])
    wall = bent_wall(start, start + (end - start) * plate.bend, end, plate.wall, POINTS)
    piece = vessel(
        np.array([[0, RECESS], [foot - 0.0050, RECESS], [foot - 0.0040, 0], [foot, 0]]),
        wall,
        base=[disc(foot, 0.0, wall.inner[0, 1])],
        rings=rings(wall, joints(wall, 2)),
        glaze=Glaze.plain(plate.glaze),
        density=plate.density,
        lip=0.42 * plate.wall,
        rounding={2: 0.0008, 3: 0.0008},
        sections=72,
    )
    first, last = plate.ring
    painted = wall.inner[first : last + 1][::-1] + [-STRIPE, STRIPE]
    ring = Shape("mesh", mesh=lathe(painted, 72), rgba=plate.paint)
    piece = Piece((*piece.visual, ring), piece.collision, piece.mass)
    return rigid_specimen("plate", [piece], object_type="axial", symmetry=SymmetryGroup.about_x())
