"""A vase: baluster, solitaire with a long neck, trumpet, or a belly with a short neck.

Real sizes, of things on sale: table vases are 120-280 mm tall and 70-110 mm wide with walls of 3-5 mm, necks of
25-60 mm, and weigh 200-700 g. Ours have a neck or a foot that a hand which opens 80 mm goes round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.revolution import curve_through
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import Glaze, disc, joints, rings, upright_wall, vessel
from manipose_mj.poses import SymmetryGroup

CERAMIC = 1900.0  # a glazed, somewhat porous body [kg/m^3]
FLOOR, RECESS = 0.006, 0.0012
POINTS = 23
RINGS = 4

# Outlines from the foot to the rim: shares of half the width and of the height.
_OUTLINES: dict[str, tuple[tuple[float, float], ...]] = {
    "baluster": ((0.56, 0.0), (0.66, 0.12), (0.86, 0.34), (1.0, 0.58), (0.90, 0.74))
    + ((0.52, 0.86), (0.44, 0.92), (0.52, 1.0)),
    "solitaire": ((0.62, 0.0), (0.84, 0.08), (1.0, 0.24), (0.84, 0.40), (0.46, 0.54))
    + ((0.36, 0.70), (0.34, 0.88), (0.42, 1.0)),
    "trumpet": ((0.60, 0.0), (0.56, 0.10), (0.52, 0.30), (0.56, 0.55), (0.68, 0.78), (1.0, 1.0)),
    "belly": ((0.58, 0.0), (0.84, 0.16), (1.0, 0.40), (0.92, 0.60), (0.62, 0.76))
    + ((0.54, 0.86), (0.64, 1.0)),
}
_WIDTHS = {
    "baluster": (0.082, 0.103),
    "solitaire": (0.080, 0.105),
    "trumpet": (0.075, 0.100),
    "belly": (0.086, 0.103),
}
_SLIMNESS = {
    "baluster": (1.7, 2.2),
    "solitaire": (1.9, 2.5),
    "trumpet": (1.9, 2.6),
    "belly": (1.35, 1.6),
}


@dataclass(frozen=True)
class Vase:
    """Sizes [m] and colours.

    Attributes: shape, its outline; width, where it is widest; height; wall; throat, how much wider than
    its outline's the neck is (a share of half the width); glaze, band and inside colours; bands, where
    the band begins and ends (shares of the height).
    """

    shape: str = "baluster"
    width: float = 0.100
    height: float = 0.200
    wall: float = 0.0038
    throat: float = 0.0
    glaze: Colour = (0.16, 0.34, 0.58, 1.0)
    band: Colour = (0.93, 0.93, 0.90, 1.0)
    inside: Colour = (0.88, 0.88, 0.85, 1.0)
    bands: tuple[float, float] = (0.50, 0.60)


_GLAZES: tuple[tuple[Colour, Colour], ...] = (
    ((0.92, 0.90, 0.85, 1.0), (0.18, 0.34, 0.60, 1.0)),
    ((0.38, 0.54, 0.44, 1.0), (0.30, 0.44, 0.36, 1.0)),
    ((0.66, 0.30, 0.20, 1.0), (0.18, 0.14, 0.12, 1.0)),
    ((0.16, 0.17, 0.19, 1.0), (0.78, 0.62, 0.26, 1.0)),
    ((0.86, 0.68, 0.60, 1.0), (0.94, 0.90, 0.86, 1.0)),
    ((0.50, 0.66, 0.74, 1.0), (0.86, 0.90, 0.92, 1.0)),
    ((0.84, 0.66, 0.26, 1.0), (0.62, 0.42, 0.16, 1.0)),
)


def design(index: int) -> Vase:
    """The sizes of instance `index`; 0 is a blue baluster vase."""
    if index == 0:
        return Vase()
    rng = specimen_rng("vase", index)
    shape = in_turn(index, ("solitaire", "trumpet", "belly", "baluster"))
    glaze, band = in_turn(index, _GLAZES)
    width = uniform(rng, *_WIDTHS[shape])
    start = uniform(rng, 0.15, 0.75)
    return Vase(
        shape=shape,
        width=width,
        height=round(width * uniform(rng, *_SLIMNESS[shape]), 4),
        wall=uniform(rng, 0.0032, 0.0042),
        throat=uniform(rng, -0.02, 0.08),
        glaze=glaze,
        band=band,
        inside=in_turn(index, (glaze, band)),
        bands=(start, start + uniform(rng, 0.04, 0.16)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    vase = design(index)
    shares = np.array(_OUTLINES[vase.shape])
    upper = shares[:, 1] > 0.5
    # What is not widest above the middle is neck.
    shares[upper, 0] += vase.throat * (1 - shares[upper, 0]) / 0.5
    outer = curve_through(shares * [vase.width / 2, vase.height], POINTS)
    slope = np.gradient(outer[:, 0], outer[:, 1])
    inner = outer - np.outer(vase.wall * np.hypot(1.0, slope), [1.0, 0.0])
    floor = [np.interp(FLOOR, inner[:, 1], inner[:, 0]), FLOOR]
    wall = upright_wall(outer, np.vstack([floor, inner[inner[:, 1] > FLOOR]]))
    foot = outer[0, 0]
    low, high = np.array(vase.bands) * vase.height
    piece = vessel(
        np.array([[0, RECESS], [foot - 0.008, RECESS], [foot - 0.007, 0]]),
        wall,
        base=[disc(foot, 0.0, FLOOR)],
        rings=rings(wall, joints(wall, RINGS)),
        glaze=Glaze(
            ((low, vase.glaze), (high, vase.band), (np.inf, vase.glaze)), vase.glaze, vase.inside
        ),
        density=CERAMIC,
        lip=0.4 * vase.wall,
        rounding={3: 0.0015},
        sections=56,
    )
    return rigid_specimen("vase", [piece], object_type="axial", symmetry=SymmetryGroup.about_x())
