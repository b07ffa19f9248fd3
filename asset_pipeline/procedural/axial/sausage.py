"""A straight sausage in its casing; both ends alike.

Real sizes. Vienna sausages are 20-25 mm thick and 120-180 mm long, bratwursts 26-34 mm and 100-200 mm, cocktail
sausages 17-20 mm and 80 mm or less (the Leitsaetze of the German food book name the casings' calibres).
Sausage meat weighs 1,000-1,050 kg/m^3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.revolution import lathe, revolved_mass
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import disc
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

MEAT = 1030.0  # [kg/m^3]
ROUND = 9  # segments of each round end


@dataclass(frozen=True)
class Sausage:
    """Sizes [m] and colours.

    Attributes: diameter; length, over all; knot, length of the casing's twisted ends; meat; casing.
    """

    diameter: float = 0.026
    length: float = 0.140
    knot: float = 0.007
    meat: Colour = (0.66, 0.30, 0.18, 1.0)
    casing: Colour = (0.76, 0.52, 0.36, 1.0)


_SORTS: tuple[tuple[Colour, Colour], ...] = (
    ((0.80, 0.46, 0.32, 1.0), (0.86, 0.64, 0.50, 1.0)),
    ((0.52, 0.13, 0.09, 1.0), (0.66, 0.40, 0.30, 1.0)),
    ((0.87, 0.76, 0.64, 1.0), (0.92, 0.86, 0.76, 1.0)),
    ((0.55, 0.27, 0.13, 1.0), (0.40, 0.20, 0.11, 1.0)),
    ((0.35, 0.12, 0.10, 1.0), (0.55, 0.38, 0.30, 1.0)),
)


def design(index: int) -> Sausage:
    """The sizes of instance `index`; 0 is a grilled bratwurst."""
    if index == 0:
        return Sausage()
    rng = specimen_rng("sausage", index)
    meat, casing = in_turn(index, _SORTS)
    diameter = uniform(rng, 0.018, 0.034)
    return Sausage(
        diameter=diameter,
        length=uniform(rng, max(0.082, 4.2 * diameter), min(0.200, 7.5 * diameter)),
        knot=uniform(rng, 0.004, 0.009),
        meat=meat,
        casing=casing,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, standing on end, with its frame at its centre."""
    sausage = design(index)
    radius, tip = sausage.diameter / 2, sausage.length / 2
    twist = 0.13 * sausage.diameter
    # The round ends stop where the casing is twisted together.
    angles = np.linspace(0, np.arccos(twist / radius), ROUND + 1)
    centre = tip - sausage.knot - radius * np.sin(angles[-1])
    arc = np.column_stack([radius * np.cos(angles), centre + radius * np.sin(angles)])
    knot = [arc[-1][1], *np.array([0.3, 0.7, 0.9, 1, 1]) * sausage.knot + tip - sausage.knot]
    knot = np.column_stack([np.array([1, 0.8, 1.15, 1.25, 0.9, 0]) * twist, knot])
    upper = np.concatenate([arc, knot[1:]])
    profile = np.concatenate([upper[::-1] * [1, -1], upper])
    visuals = (
        (knot[::-1] * [1, -1], sausage.casing),
        (profile[len(knot) - 1 : 1 - len(knot)], sausage.meat),
        (knot, sausage.casing),
    )
    piece = Piece(
        tuple(Shape("mesh", mesh=lathe(part, 40), rgba=rgba) for part, rgba in visuals),
        (
            Shape("capsule", (radius, centre)),
            disc(1.1 * twist, -tip, -centre - 0.8 * radius),
            disc(1.1 * twist, centre + 0.8 * radius, tip),
        ),
        revolved_mass(profile, MEAT),
    )
    symmetry = SymmetryGroup.about_x(ends_alike=True)
    return rigid_specimen("sausage", [piece], object_type="axial", symmetry=symmetry)
