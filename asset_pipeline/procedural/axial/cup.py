"""A cup without a handle: a stacking tumbler, a paper cup, or a stoneware beaker. All narrow downwards.

Real sizes. The YCB stacking cups are 55-95 mm wide and 60-75 mm tall (Calli et al. 2015); plastic tumblers of
200-400 ml are 70-88 mm wide and 95-145 mm tall; paper cups of 8-16 oz are 80-90 mm wide and 92-135 mm tall
(makers' data sheets); stoneware beakers 70-85 mm wide and 75-110 mm tall. Walls are drawn 2.2 mm at
least: thinner ones need no other physics.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import (
    Glaze,
    Wall,
    bent_wall,
    disc,
    joints,
    rings,
    upright_wall,
    vessel,
)
from manipose_mj.poses import SymmetryGroup

DENSITY = {"tumbler": 900.0, "paper": 380.0, "beaker": 2300.0}  # of what its walls are [kg/m^3]
RECESS = 0.0014  # under the foot [m]
FLOOR = 0.0045


Kind = Literal["tumbler", "paper", "beaker"]


@dataclass(frozen=True)
class Cup:
    """Sizes [m] and colours.

    Attributes: kind; width, over the rim; height; foot, the foot's width as a share of the rim's;
    wall; bead, how far the rim stands out; ledge, where stacked tumblers rest, as a share of the height
    (0 has none); body, band round the middle (the body's colour has none) and inside colours.
    """

    kind: Kind = "tumbler"
    width: float = 0.080
    height: float = 0.112
    foot: float = 0.70
    wall: float = 0.0024
    bead: float = 0.0014
    ledge: float = 0.72
    body: Colour = (0.85, 0.22, 0.18, 1.0)
    band: Colour = (0.85, 0.22, 0.18, 1.0)
    inside: Colour = (0.90, 0.32, 0.27, 1.0)


_KINDS: tuple[Kind, ...] = ("paper", "tumbler", "beaker", "tumbler")
_PLASTICS: tuple[Colour, ...] = (
    (0.15, 0.42, 0.72, 1.0),
    (0.96, 0.78, 0.16, 1.0),
    (0.32, 0.65, 0.32, 1.0),
    (0.92, 0.48, 0.16, 1.0),
    (0.55, 0.36, 0.64, 1.0),
    (0.20, 0.62, 0.64, 1.0),
)
_SLEEVES: tuple[Colour, ...] = (
    (0.55, 0.40, 0.26, 1.0),
    (0.20, 0.34, 0.26, 1.0),
    (0.72, 0.14, 0.14, 1.0),
)
_GLAZES: tuple[tuple[Colour, Colour], ...] = (
    ((0.24, 0.34, 0.42, 1.0), (0.86, 0.84, 0.78, 1.0)),
    ((0.86, 0.82, 0.74, 1.0), (0.42, 0.30, 0.22, 1.0)),
    ((0.46, 0.54, 0.40, 1.0), (0.90, 0.88, 0.80, 1.0)),
)
PAPER: Colour = (0.95, 0.94, 0.91, 1.0)


def design(index: int) -> Cup:
    """The sizes of instance `index`; 0 is a red tumbler; half of them stack on a ledge."""
    if index == 0:
        return Cup()
    rng = specimen_rng("cup", index)
    kind: Kind = in_turn(index, _KINDS)
    turn = index // 4 + 1
    if kind == "paper":
        width = uniform(rng, 0.076, 0.090)
        return Cup(
            kind,
            width=width,
            height=uniform(rng, 1.12 * width, 1.52 * width),
            foot=uniform(rng, 0.64, 0.70),
            wall=0.0022,
            bead=0.0018,
            ledge=0.0,
            body=PAPER,
            band=in_turn(turn, _SLEEVES),
            inside=PAPER,
        )
    if kind == "beaker":
        body, band = in_turn(turn, _GLAZES)
        width = uniform(rng, 0.066, 0.084)
        return Cup(
            kind,
            width=width,
            height=uniform(rng, 0.98 * width, 1.36 * width),
            foot=uniform(rng, 0.60, 0.72),
            wall=uniform(rng, 0.0036, 0.0046),
            bead=0.0,
            ledge=0.0,
            body=body,
            band=band,
            inside=band,
        )
    body = in_turn(turn + index % 4, _PLASTICS)
    width = uniform(rng, 0.062, 0.088)
    red, green, blue, _ = np.minimum(np.array(body) + 0.08, 1.0).tolist()
    return Cup(
        kind,
        width=width,
        height=uniform(rng, max(0.072, 1.02 * width), 1.6 * width),
        foot=uniform(rng, 0.64, 0.78),
        wall=uniform(rng, 0.0022, 0.0030),
        bead=uniform(rng, 0.0012, 0.0018),
        ledge=uniform(rng, 0.62, 0.80),
        body=body,
        band=body,
        inside=(red, green, blue, 1.0),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    cup = design(index)
    wall = _beaker_wall(cup) if cup.kind == "beaker" else _conical_wall(cup)
    foot = wall.outer[0, 0]
    under = np.array([[0, RECESS], [foot - 0.007, RECESS], [foot - 0.006, 0]])
    low, high = (0.62, 0.97) if cup.kind == "beaker" else (0.24, 0.74)
    bands = ((low * cup.height, cup.body), (high * cup.height, cup.band), (np.inf, cup.body))
    piece = vessel(
        under,
        wall,
        base=[disc(foot, 0.0, FLOOR)],
        rings=rings(wall, joints(wall, 2)),
        glaze=Glaze(bands if cup.band != cup.body else bands[2:], cup.body, cup.inside),
        density=DENSITY[cup.kind],
        lip=0.42 * cup.wall,
        rounding={3: 0.0015},
        sections=64,
    )
    return rigid_specimen("cup", [piece], object_type="axial", symmetry=SymmetryGroup.about_x())


def _conical_wall(cup: Cup) -> Wall:
    foot, rim = cup.foot * cup.width / 2, cup.width / 2 - cup.bead
    height, bead = cup.height, 0.0036
    corners = [[foot, 0.0], [rim, height - bead], [rim + cup.bead, height - bead]]
    corners += [[rim + cup.bead, height]]
    step = []
    if cup.ledge:  # above it, the cone is wider by a millimetre and a half
        at = cup.ledge * height
        radius = foot + (rim - foot) * cup.ledge
        step = [[radius - 0.0016, at], [radius, at + 0.0016]]
    outer = np.array([corners[0], *step, *corners[1:]])
    inner = np.array([[foot, 0.0], *step, [rim, height]]) - [cup.wall, 0.0]
    floor = [np.interp(FLOOR, inner[:, 1], inner[:, 0]), FLOOR]
    return upright_wall(outer, np.vstack([floor, inner[1:]]))


def _beaker_wall(cup: Cup) -> Wall:
    start, end = np.array([cup.foot * cup.width / 2, 0.0]), np.array([cup.width / 2, cup.height])
    curve = bent_wall(start, start + (end - start) * [0.95, 0.30], end, cup.wall, 18)
    inner = curve.inner[curve.inner[:, 1] > FLOOR]
    floor = [np.interp(FLOOR, curve.inner[:, 1], curve.inner[:, 0]) - 0.001, FLOOR]
    return upright_wall(curve.outer, np.vstack([floor, inner]))
