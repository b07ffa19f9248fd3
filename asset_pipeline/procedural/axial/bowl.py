"""A stoneware bowl on a foot ring.

Real sizes. Cereal and rice bowls are 120-170 mm wide and 45-75 mm tall with walls of 3-5 mm (the YCB bowl:
159 mm wide, 53 mm tall, Calli et al. 2015; the Akita bowl of Google Scanned Objects, measured: 159 mm
wide, 75 mm tall, wall 4.5-5.5 mm, foot ring 69 mm wide outside and 61 mm inside).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import CURVE_POINTS, Glaze, bent_wall, disc, vessel
from manipose_mj.poses import SymmetryGroup

STONEWARE = 2300.0  # [kg/m^3]
WEDGES = 16  # of each of two rings of wall
JOINT = 11  # the curve's point between the rings: there the parts' errors are alike
RECESS = 0.0013  # under the foot [m]; its collision disc is flat


@dataclass(frozen=True)
class Bowl:
    """Sizes [m] and colours.

    Attributes: diameter, before the lip is rounded; height, over all; wall; foot, outer diameter of the foot ring; ring, its
    height; bend, where the wall's curve turns up (two shares; 1, 0 would be an edge); colours of
    the outside, the inside and the rim.
    """

    diameter: float = 0.150
    height: float = 0.060
    wall: float = 0.0042
    foot: float = 0.068
    ring: float = 0.006
    bend: tuple[float, float] = (0.66, 0.22)
    outside: Colour = (0.20, 0.40, 0.55, 1.0)
    inside: Colour = (0.94, 0.93, 0.89, 1.0)
    rim: Colour = (0.45, 0.30, 0.20, 1.0)


_GLAZES: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.93, 0.92, 0.88, 1.0), (0.93, 0.92, 0.88, 1.0), (0.20, 0.33, 0.58, 1.0)),
    ((0.72, 0.20, 0.15, 1.0), (0.95, 0.90, 0.80, 1.0), (0.95, 0.90, 0.80, 1.0)),
    ((0.18, 0.19, 0.21, 1.0), (0.30, 0.32, 0.35, 1.0), (0.55, 0.40, 0.25, 1.0)),
    ((0.50, 0.66, 0.48, 1.0), (0.90, 0.92, 0.84, 1.0), (0.32, 0.45, 0.32, 1.0)),
    ((0.92, 0.72, 0.28, 1.0), (0.98, 0.95, 0.88, 1.0), (0.92, 0.72, 0.28, 1.0)),
)


def design(index: int) -> Bowl:
    """The sizes of instance `index`; 0 is a cereal bowl."""
    if index == 0:
        return Bowl()
    rng = specimen_rng("bowl", index)
    diameter = rng.uniform(0.120, 0.170)
    outside, inside, rim = in_turn(index, _GLAZES)
    return Bowl(
        diameter=round(float(diameter), 4),
        height=round(float(np.clip(diameter * rng.uniform(0.36, 0.50), 0.045, 0.075)), 4),
        wall=uniform(rng, 0.0034, 0.005),
        foot=round(float(diameter * rng.uniform(0.42, 0.50)), 4),
        ring=uniform(rng, 0.005, 0.007),
        bend=(round(float(rng.uniform(0.58, 0.70)), 3), round(float(rng.uniform(0.19, 0.30)), 3)),
        outside=outside,
        inside=inside,
        rim=rim,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    bowl = design(index)
    start = np.array([bowl.foot / 2, bowl.ring])
    end = np.array([bowl.diameter / 2, bowl.height])
    wall = bent_wall(start, start + (end - start) * bowl.bend, end, bowl.wall, CURVE_POINTS)
    foot = bowl.foot / 2
    piece = vessel(
        np.array([[0, RECESS], [foot - 0.0055, RECESS], [foot - 0.0045, 0], [foot, 0]]),
        wall,
        base=[disc(foot, 0.0, wall.inner[0, 1])],  # fills the recess as well
        rings=[(JOINT, WEDGES), (CURVE_POINTS - 1, WEDGES)],
        glaze=Glaze.plain(bowl.outside, bowl.rim, bowl.inside),
        density=STONEWARE,
        lip=0.4 * bowl.wall,
        rounding={2: 0.0008, 3: 0.001},
        sections=60,
    )
    return rigid_specimen("bowl", [piece], object_type="axial", symmetry=SymmetryGroup.about_x())
