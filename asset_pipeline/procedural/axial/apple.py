"""An apple with its dents, calyx and stalk.

Real sizes. Apples on sale are 60-85 mm wide (UNECE standard FFV-50 for apples asks for 60 mm or 90 g); the YCB
apple is 75 mm wide (Calli et al. 2015). Flesh weighs 800-850 kg/m^3. Ours are narrow enough for a hand that
opens 80 mm, and of the flat round sorts: clearly wider than tall, stalk included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.revolution import curve_through, lathe, revolved_mass, wall_wedges
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

FLESH, WOOD = 820.0, 600.0  # [kg/m^3]
WEDGES = 10
OUTLINE = 41  # points of the profile
CALYX, BLUSH = 3, 34  # points where the skin's colour changes
BROWN: Colour = (0.33, 0.22, 0.12, 1.0)


@dataclass(frozen=True)
class Apple:
    """Sizes [m] and colours.

    Attributes: width; flatness, height without the stalk as a share of it; shoulder, where it is
    widest as a share of the height; stalk, how far it stands above the shoulders; skin; blush, round the
    stalk.
    """

    width: float = 0.072
    flatness: float = 0.82
    shoulder: float = 0.56
    stalk: float = 0.009
    skin: Colour = (0.72, 0.10, 0.11, 1.0)
    blush: Colour = (0.60, 0.42, 0.12, 1.0)


_SORTS: tuple[tuple[Colour, Colour], ...] = (
    ((0.55, 0.72, 0.20, 1.0), (0.62, 0.70, 0.22, 1.0)),
    ((0.86, 0.73, 0.24, 1.0), (0.72, 0.66, 0.22, 1.0)),
    ((0.62, 0.06, 0.10, 1.0), (0.44, 0.09, 0.08, 1.0)),
    ((0.84, 0.33, 0.20, 1.0), (0.78, 0.68, 0.28, 1.0)),
)


def design(index: int) -> Apple:
    """The sizes of instance `index`; 0 is a red dessert apple."""
    if index == 0:
        return Apple()
    rng = specimen_rng("apple", index)
    skin, blush = in_turn(index, _SORTS)
    return Apple(
        width=uniform(rng, 0.063, 0.0755),
        flatness=uniform(rng, 0.77, 0.83),
        shoulder=uniform(rng, 0.50, 0.62),
        stalk=uniform(rng, 0.008, 0.0105),
        skin=skin,
        blush=blush,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    apple = design(index)
    height = apple.width * apple.flatness
    profile = _profile(apple)
    flesh = Piece(
        tuple(
            Shape("mesh", mesh=lathe(part, 64), rgba=rgba)
            for part, rgba in (
                (profile[: CALYX + 1], BROWN),
                (profile[CALYX : BLUSH + 1], apple.skin),
                (profile[BLUSH:], apple.blush),
            )
        ),
        wall_wedges(profile[4:37:4], profile[[0, -1]], WEDGES, arc_steps=2),
        revolved_mass(profile, FLESH),
    )
    foot, top = 0.78 * height, height + apple.stalk
    stalk = np.array([[0, foot], [0.0014, foot], [0.0014, top - 0.002], [0.002, top], [0, top]])
    twig = filled(stalk, density=WOOD, bands=[(top, BROWN)], sections=16)
    return rigid_specimen(
        "apple", [flesh, twig], object_type="axial", symmetry=SymmetryGroup.about_x()
    )


def _profile(apple: Apple) -> np.ndarray:
    """From the calyx round the shoulders into the stalk's dent."""
    widest, rest = apple.shoulder, 1 - apple.shoulder
    shares = np.array(
        [[0, 0.075], [0.07, 0.045], [0.17, 0], [0.30, 0.06], [0.43, 0.42 * widest], [0.5, widest]]
        + [[0.465, widest + 0.52 * rest], [0.35, widest + 0.90 * rest], [0.22, 1], [0.11, 0.935]]
        + [[0.045, 0.86], [0, 0.83]]
    )
    return curve_through(shares * apple.width * [1, apple.flatness], OUTLINE)
