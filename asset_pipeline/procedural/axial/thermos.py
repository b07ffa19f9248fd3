"""A vacuum flask with its cup screwed on, or a travel flask with a narrow lid.

Real sizes, of things on sale: flasks of 0.35-1.0 l are 65-85 mm wide and 170-320 mm tall and weigh 250-500 g
empty (0.5 l: 70 mm, 250 mm, 350 g). Ours are narrow enough for a hand that opens 80 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.revolution import fillet
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.poses import SymmetryGroup

DOUBLE_WALL, CUP = 400.0, 380.0  # mean densities of empty flask and hollow cup [kg/m^3]
STEEL: Colour = (0.74, 0.75, 0.77, 1.0)
DARK: Colour = (0.16, 0.16, 0.18, 1.0)


@dataclass(frozen=True)
class Thermos:
    """Sizes [m] and colours.

    Attributes: diameter; height, over all; cup, its width at its lower end; cover, its height; taper, how
    much narrower its upper end is; shoulder, height of the body's; body and lid colours.
    """

    diameter: float = 0.070
    height: float = 0.250
    cup: float = 0.062
    cover: float = 0.060
    taper: float = 0.008
    shoulder: float = 0.022
    body: Colour = (0.14, 0.30, 0.24, 1.0)
    lid: Colour = STEEL


_COLOURS: tuple[tuple[Colour, Colour], ...] = (
    ((0.72, 0.73, 0.75, 1.0), DARK),
    ((0.12, 0.22, 0.42, 1.0), STEEL),
    ((0.66, 0.12, 0.12, 1.0), DARK),
    ((0.17, 0.17, 0.19, 1.0), STEEL),
    ((0.88, 0.82, 0.72, 1.0), (0.62, 0.44, 0.27, 1.0)),
    ((0.42, 0.62, 0.62, 1.0), (0.92, 0.92, 0.90, 1.0)),
)


def design(index: int) -> Thermos:
    """The sizes of instance `index`; 0 is a half-litre flask; every third has a narrow lid."""
    if index == 0:
        return Thermos()
    rng = specimen_rng("thermos", index)
    body, lid = in_turn(index + index // 6, _COLOURS)
    diameter = uniform(rng, 0.062, 0.0735)
    narrow = index % 3 == 2
    return Thermos(
        diameter=diameter,
        height=uniform(rng, 2.75 * diameter, min(0.315, 4.4 * diameter)),
        cup=uniform(rng, 0.040, 0.048) if narrow else diameter - uniform(rng, 0.005, 0.012),
        cover=uniform(rng, 0.026, 0.040) if narrow else uniform(rng, 0.048, 0.072),
        taper=uniform(rng, 0.001, 0.004) if narrow else uniform(rng, 0.005, 0.012),
        shoulder=uniform(rng, 0.020, 0.032),
        body=body,
        lid=lid,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    flask = design(index)
    r, cup, seat = flask.diameter / 2, flask.cup / 2, flask.height - flask.cover
    base, side = 0.012, seat - flask.shoulder
    corners = [[0, 0.001], [r - 0.009, 0.001], [r - 0.008, 0], [r - 0.0015, 0], [r - 0.0015, base]]
    corners += [[r, base + 0.001], [r, side], [cup - 0.001, seat - 0.006], [cup - 0.001, seat]]
    body = fillet(np.array([*corners, [0, seat]]), {3: 0.003, 6: 0.014, 7: 0.003}, 6)
    bands = [(base, STEEL), (seat - 0.006, flask.body), (seat, STEEL)]
    top = flask.height
    cover = [[0, seat], [cup + 0.0005, seat], [cup + 0.0005, seat + 0.008], [cup, seat + 0.009]]
    cover += [[cup - flask.taper / 2, top], [0, top]]
    lid = fillet(np.array(cover), {4: 0.005}, 6)
    pieces = [
        filled(body, density=DOUBLE_WALL, bands=bands),
        filled(lid, density=CUP, bands=[(top, flask.lid)]),
    ]
    return rigid_specimen("thermos", pieces, object_type="axial", symmetry=SymmetryGroup.about_x())
