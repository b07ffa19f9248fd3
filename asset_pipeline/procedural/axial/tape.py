"""A roll of adhesive tape on its core; both ends alike.

Real sizes, of things on sale: office tape 12-19 mm wide on a 25 mm (1 inch) core, 40-60 mm over all; insulating tape
15-19 mm wide on a 32-38 mm core, 55-70 mm over all; masking, parcel and duct tape 19-50 mm wide on the 76 mm (3
inch) core, 88-120 mm over all. Cores are paper or plastic rings 2.5-4 mm thick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.revolution import fillet, lathe, revolved_mass, wall_wedges
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

WOUND, CARDBOARD = 950.0, 700.0  # [kg/m^3]
WEDGES = 16
PAPER: Colour = (0.78, 0.68, 0.53, 1.0)
WHITE: Colour = (0.92, 0.92, 0.90, 1.0)


@dataclass(frozen=True)
class Tape:
    """Sizes [m] and colours.

    Attributes: diameter, over all; core, inside the core; width; ring, the core's thickness; tape;
    cardboard, the core's colour.
    """

    diameter: float = 0.105
    core: float = 0.076
    width: float = 0.048
    ring: float = 0.0035
    tape: Colour = (0.72, 0.53, 0.30, 1.0)
    cardboard: Colour = PAPER


@dataclass(frozen=True)
class _Kind:
    core: tuple[float, float]
    diameter: tuple[float, float]
    width: tuple[float, float]
    colours: tuple[tuple[Colour, Colour], ...]


_KINDS = (
    _Kind(  # masking
        (0.076, 0.076),
        (0.090, 0.115),
        (0.019, 0.038),
        (((0.90, 0.82, 0.58, 1.0), PAPER), ((0.16, 0.42, 0.72, 1.0), PAPER)),
    ),
    _Kind(  # insulating
        (0.034, 0.038),
        (0.058, 0.070),
        (0.015, 0.019),
        (((0.08, 0.08, 0.09, 1.0), WHITE), ((0.72, 0.10, 0.10, 1.0), WHITE)),
    ),
    _Kind(  # duct
        (0.076, 0.076),
        (0.100, 0.119),
        (0.044, 0.050),
        (((0.60, 0.61, 0.63, 1.0), PAPER), ((0.10, 0.10, 0.11, 1.0), PAPER)),
    ),
    _Kind(  # office
        (0.0254, 0.0254),
        (0.046, 0.060),
        (0.012, 0.019),
        (((0.86, 0.83, 0.70, 1.0), (0.75, 0.16, 0.14, 1.0)), ((0.84, 0.88, 0.86, 1.0), WHITE)),
    ),
    _Kind(  # parcel
        (0.076, 0.076),
        (0.092, 0.112),
        (0.044, 0.050),
        (((0.86, 0.82, 0.68, 1.0), PAPER), ((0.62, 0.42, 0.22, 1.0), PAPER)),
    ),
)


def design(index: int) -> Tape:
    """The sizes of instance `index`; 0 is a roll of brown parcel tape."""
    if index == 0:
        return Tape()
    rng = specimen_rng("tape", index)
    kind = in_turn(mixed(index), _KINDS)
    tape, cardboard = in_turn(index // len(_KINDS) + 1, kind.colours)
    return Tape(
        diameter=uniform(rng, *kind.diameter),
        core=uniform(rng, *kind.core),
        width=uniform(rng, *kind.width),
        ring=uniform(rng, 0.0028, 0.004),
        tape=tape,
        cardboard=cardboard,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying on its side, with its frame at its centre."""
    roll = design(index)
    outer, inner, half = roll.diameter / 2, roll.core / 2, roll.width / 2
    middle = inner + roll.ring
    # The core shows on the sides: it stands back by what the tape's winding leaves.
    wound = np.array([[middle, -half], [outer, -half], [outer, half], [middle, half]])
    wound = fillet(wound, {1: 0.0007, 2: 0.0007}, 3)
    core = np.array([[middle, half - 0.0005], [inner, half - 0.0005], [inner, 0.0005 - half]])
    core = np.concatenate([wound[-1:], core, [[middle, 0.0005 - half]], wound[:1]])
    side = np.array([[0.0, -half], [0.0, half]])
    section = np.array([[inner, -half], [middle, -half], [middle, half], [inner, half]])
    pieces = [
        Piece(
            (Shape("mesh", mesh=lathe(wound, 96), rgba=roll.tape),),
            wall_wedges(side + [outer, 0], side + [inner, 0], WEDGES),
            revolved_mass(wound, WOUND),
        ),
        Piece(
            (Shape("mesh", mesh=lathe(core, 96), rgba=roll.cardboard),),
            (),
            revolved_mass(section, CARDBOARD),
        ),
    ]
    symmetry = SymmetryGroup.about_x(ends_alike=True)
    return rigid_specimen("tape", pieces, object_type="axial", symmetry=symmetry)
