"""A pear: a bulb, a neck and a stalk.

Real sizes. Pears on sale are 55-75 mm wide (UNECE standard FFV-51: at least 55 mm, 100 g) and 1.2-1.7 times as
tall; the YCB pear is 66 mm wide and 100 mm tall (Calli et al. 2015). Flesh weighs about 950 kg/m^3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.revolution import curve_through
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.poses import SymmetryGroup

FLESH, WOOD = 950.0, 600.0  # [kg/m^3]
BROWN: Colour = (0.36, 0.25, 0.14, 1.0)


@dataclass(frozen=True)
class Pear:
    """Sizes [m] and colours.

    Attributes: width; slimness, height without the stalk over it; neck, the neck's width as a share
    of the bulb's; stalk, its length above the top; skin; crown, the colour round the stalk.
    """

    width: float = 0.066
    slimness: float = 1.36
    neck: float = 0.50
    stalk: float = 0.014
    skin: Colour = (0.72, 0.74, 0.28, 1.0)
    crown: Colour = (0.62, 0.62, 0.24, 1.0)


_SORTS: tuple[tuple[Colour, Colour], ...] = (
    ((0.64, 0.48, 0.24, 1.0), (0.55, 0.42, 0.22, 1.0)),
    ((0.52, 0.66, 0.26, 1.0), (0.45, 0.58, 0.24, 1.0)),
    ((0.88, 0.76, 0.32, 1.0), (0.80, 0.62, 0.26, 1.0)),
    ((0.60, 0.20, 0.16, 1.0), (0.50, 0.26, 0.15, 1.0)),
)


def design(index: int) -> Pear:
    """The sizes of instance `index`; 0 is a green dessert pear."""
    if index == 0:
        return Pear()
    rng = specimen_rng("pear", index)
    skin, crown = in_turn(index, _SORTS)
    return Pear(
        width=uniform(rng, 0.056, 0.072),
        slimness=uniform(rng, 1.22, 1.52),
        neck=uniform(rng, 0.42, 0.58),
        stalk=uniform(rng, 0.010, 0.016),
        skin=skin,
        crown=crown,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    pear = design(index)
    height = pear.width * pear.slimness
    neck = pear.neck / 2
    shares = np.array(
        [[0, 0.012], [0.09, 0.008], [0.17, 0], [0.32, 0.04], [0.455, 0.17], [0.5, 0.32]]
        + [[0.465, 0.46], [0.35, 0.62], [neck + 0.02, 0.77], [neck - 0.02, 0.88]]
        + [[0.7 * neck, 0.96], [0.35 * neck, 0.99], [0, 1]]
    )
    profile = curve_through(shares * pear.width * [1, pear.slimness], 44)
    flesh = filled(
        profile,
        density=FLESH,
        bands=[(0.9 * height, pear.skin), (height, pear.crown)],
    )
    foot, top = 0.97 * height, height + pear.stalk
    stalk = np.array([[0, foot], [0.0016, foot], [0.0016, top - 0.003], [0.0024, top], [0, top]])
    calyx = np.array([[0, -0.0008], [0.004, 0.0], [0.0055, 0.0022], [0, 0.0022]]) * [1, 0.5]
    pieces = [
        flesh,
        filled(stalk, density=WOOD, bands=[(top, BROWN)], sections=16),
        filled(calyx + [0, 0.0009], density=WOOD, bands=[(top, BROWN)], sections=24),
    ]
    return rigid_specimen("pear", pieces, object_type="axial", symmetry=SymmetryGroup.about_x())
