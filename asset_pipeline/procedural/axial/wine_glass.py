"""A stemmed glass: for red or white wine, or a flute.

Real sizes. The tasting glass of ISO 3591 is 155 mm tall with a bowl 65 mm and a foot 65 mm wide and a stem of 9 mm; the
YCB wine glass 89 mm wide, 137 mm tall, 133 g (Calli et al. 2015); glasses on sale are 140-235 mm tall. Walls
are drawn 1.8-2.2 mm, real ones are 0.8-1.5 mm; ours weigh 90-220 g like them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.revolution import curve_through
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import Glaze, Wall, joints, rings, vessel
from manipose_mj.poses import SymmetryGroup

GLASS = 2500.0  # [kg/m^3]
POINTS = 20

# Outlines of the bowl from the stem to the rim: shares of half the width and of its height.
_BOWLS: dict[str, tuple[tuple[float, float], ...]] = {
    "red": ((0.0, 0.0), (0.36, 0.03), (0.72, 0.16), (0.94, 0.34), (1.0, 0.48), (0.95, 0.70))
    + ((0.80, 1.0),),
    "white": ((0.0, 0.0), (0.30, 0.03), (0.62, 0.15), (0.88, 0.33), (1.0, 0.55), (0.97, 0.75))
    + ((0.86, 1.0),),
    "flute": ((0.0, 0.0), (0.28, 0.02), (0.58, 0.10), (0.82, 0.26), (0.97, 0.50), (1.0, 0.66))
    + ((0.90, 1.0),),
}
_WIDTHS = {"red": (0.066, 0.076), "white": (0.058, 0.070), "flute": (0.046, 0.054)}
_SLIMNESS = {"red": (1.10, 1.30), "white": (1.25, 1.45), "flute": (2.3, 2.9)}


@dataclass(frozen=True)
class WineGlass:
    """Sizes [m] and colours.

    Attributes: shape of the bowl; width and bowl, its width and height; stem, length of foot and stem;
    foot, width of the foot; thickness of the stem; wall; glass and stem colours.
    """

    shape: str = "red"
    width: float = 0.070
    bowl: float = 0.084
    stem: float = 0.088
    foot: float = 0.068
    thickness: float = 0.0085
    wall: float = 0.0020
    glass: Colour = (0.86, 0.92, 0.94, 0.40)
    tint: Colour = (0.86, 0.92, 0.94, 0.55)


_TINTS: tuple[tuple[Colour, Colour], ...] = (
    ((0.86, 0.92, 0.94, 0.40), (0.30, 0.52, 0.36, 0.70)),
    ((0.88, 0.92, 0.92, 0.40), (0.88, 0.92, 0.92, 0.55)),
    ((0.60, 0.74, 0.84, 0.50), (0.60, 0.74, 0.84, 0.60)),
    ((0.88, 0.78, 0.70, 0.50), (0.88, 0.78, 0.70, 0.60)),
    ((0.80, 0.86, 0.88, 0.45), (0.14, 0.14, 0.16, 0.95)),
)


def design(index: int) -> WineGlass:
    """The sizes of instance `index`; 0 is for red wine."""
    if index == 0:
        return WineGlass()
    rng = specimen_rng("wine_glass", index)
    shape = in_turn(index, ("white", "flute", "red"))
    glass, tint = in_turn(index, _TINTS)
    width = uniform(rng, *_WIDTHS[shape])
    bowl = round(width * uniform(rng, *_SLIMNESS[shape]), 4)
    return WineGlass(
        shape=shape,
        width=width,
        bowl=bowl,
        stem=uniform(rng, 0.070, min(0.105, 0.230 - bowl)),
        foot=uniform(rng, 0.062, 0.074),
        thickness=uniform(rng, 0.0074, 0.0095),
        wall=uniform(rng, 0.0018, 0.0022),
        glass=glass,
        tint=tint,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    glass = design(index)
    curve = curve_through(np.array(_BOWLS[glass.shape]), POINTS)
    bottom = 0.004  # of the bowl, where it is thickest
    half, stem = glass.width / 2, glass.thickness / 2
    outer = curve * [half, glass.bowl] + [0.0, glass.stem]
    outer[:, 0] = np.maximum(outer[:, 0], stem)
    inner = curve * [half - glass.wall, glass.bowl - bottom] + [0.0, glass.stem + bottom]
    wall = Wall(outer, inner)
    bowl = vessel(
        np.array([[0.0, glass.stem]]),
        wall,
        base=(),
        rings=rings(wall, joints(wall, 3)),
        glaze=Glaze.plain(glass.glass),
        density=GLASS,
        lip=0.4 * glass.wall,
        sections=56,
    )
    foot = glass.foot / 2
    profile = [[0, 0], [foot, 0], [foot, 0.0014], [0.55 * foot, 0.0036], [stem + 0.0045, 0.0065]]
    profile += [[stem + 0.001, 0.012], [0.92 * stem, 0.022], [0.92 * stem, 0.8 * glass.stem]]
    profile += [[stem, glass.stem], [0, glass.stem]]
    section = np.array(profile)
    stand = filled(
        section,
        density=GLASS,
        bands=[(glass.stem, glass.tint)],
        tolerance=0.0004,
        sections=56,
    )
    return rigid_specimen(
        "wine_glass", [stand, bowl], object_type="axial", symmetry=SymmetryGroup.about_x()
    )
