"""A filled jar with its lid: jam, honey, pickles, or a stoneware jar with a knob.

Real sizes, of things on sale: jam jars of 212-370 ml are 65-76 mm wide and 75-120 mm tall with the twist-off lids
TO 58 to TO 70, 8-17 mm high; spice jars 45-55 mm wide and 90-115 mm tall; coffee jars up to 76 mm and 165 mm.
They weigh 150-600 g as sold. The lid is narrower than the body, or has a knob.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.revolution import fillet
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.poses import SymmetryGroup

FULL, LID = 950.0, 450.0  # mean of glass, content and air; of a hollow lid [kg/m^3]
PUNT = 0.0015
SHOULDER = 0.012  # height of the glass between the straight side and the lid [m]


@dataclass(frozen=True)
class Jar:
    """Sizes [m] and colours.

    Attributes: diameter; height, over all, without the knob; lid, its width; cover, its height; knob,
    height of the one on it (0 has none); content, label and metal colours.
    """

    diameter: float = 0.070
    height: float = 0.098
    lid: float = 0.062
    cover: float = 0.014
    knob: float = 0.0
    content: Colour = (0.60, 0.10, 0.14, 0.95)
    label: Colour = (0.95, 0.92, 0.84, 1.0)
    metal: Colour = (0.82, 0.83, 0.85, 1.0)


_PRODUCTS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.86, 0.56, 0.10, 0.95), (0.98, 0.94, 0.80, 1.0), (0.86, 0.68, 0.22, 1.0)),
    ((0.42, 0.52, 0.20, 0.95), (0.90, 0.92, 0.86, 1.0), (0.20, 0.45, 0.22, 1.0)),
    ((0.36, 0.20, 0.10, 1.0), (0.72, 0.16, 0.12, 1.0), (0.94, 0.93, 0.90, 1.0)),
    ((0.84, 0.82, 0.76, 1.0), (0.30, 0.42, 0.58, 1.0), (0.68, 0.50, 0.30, 1.0)),
    ((0.90, 0.42, 0.08, 0.95), (0.98, 0.96, 0.92, 1.0), (0.92, 0.92, 0.90, 1.0)),
    ((0.30, 0.08, 0.24, 0.95), (0.94, 0.90, 0.92, 1.0), (0.16, 0.16, 0.18, 1.0)),
)


def design(index: int) -> Jar:
    """The sizes of instance `index`; 0 is a jam jar."""
    if index == 0:
        return Jar()
    rng = specimen_rng("jar", index)
    content, label, metal = in_turn(index, _PRODUCTS)
    diameter = uniform(rng, 0.048, 0.074)
    return Jar(
        diameter=diameter,
        height=uniform(rng, max(0.066, 1.08 * diameter), 2.1 * diameter),
        lid=diameter - uniform(rng, 0.006, min(0.016, 0.22 * diameter)),
        cover=uniform(rng, 0.010, 0.020),
        knob=uniform(rng, 0.012, 0.018) if index % 6 == 4 else 0.0,
        content=content,
        label=label,
        metal=metal,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    jar = design(index)
    r, lid, seat = jar.diameter / 2, jar.lid / 2, jar.height - jar.cover
    neck, side = lid - 0.0022, seat - SHOULDER
    corners = [[0, PUNT], [0.70 * r, PUNT], [0.78 * r, 0], [r, 0], [r, side]]
    corners += [[neck, seat - 0.0025], [neck, seat], [0, seat]]
    glass = fillet(np.array(corners), {3: 0.004, 4: 0.005, 5: 0.0015}, 5)
    low, high = 0.16 * side, 0.86 * side
    bands = [(low, jar.content), (high, jar.label), (jar.height, jar.content)]
    cap = np.array([[0, seat], [lid, seat], [lid, jar.height], [0, jar.height]])
    cap = fillet(cap, {1: 0.0008, 2: 0.002}, 4)
    pieces = [
        filled(glass, density=FULL, bands=bands),
        filled(cap, density=LID, bands=[(jar.height, jar.metal)]),
    ]
    if jar.knob:
        ball, top = 0.5 * jar.knob, jar.height + jar.knob
        stem = [[0, jar.height], [0.6 * ball, jar.height]]
        angles = np.linspace(-0.9, np.pi / 2, 12)
        sphere = np.column_stack([ball * np.cos(angles), top - ball + ball * np.sin(angles)])
        sphere[-1, 0] = 0.0
        knob = np.concatenate([stem, sphere])
        pieces.append(
            filled(
                knob,
                density=LID,
                bands=[(top, jar.metal)],
                tolerance=0.0005,
                sections=32,
            )
        )
    return rigid_specimen("jar", pieces, object_type="axial", symmetry=SymmetryGroup.about_x())
