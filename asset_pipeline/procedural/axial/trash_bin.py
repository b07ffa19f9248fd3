"""A desktop or bathroom bin: open with a rolled rim, with a bag folded over it, or with a funnel lid.

Real sizes, of things on sale: desktop bins of 1.5-2 l are 120-150 mm wide and 140-180 mm tall, small waste paper
baskets of 4-6 l 190-220 mm wide and 220-290 mm tall, of polypropylene 1.5-3 mm thick; 100-400 g. Held by the rim.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.vessel import Glaze, Wall, disc, rings, upright_wall, vessel
from manipose_mj.poses import SymmetryGroup

POLYPROPYLENE = 900.0  # [kg/m^3]
FLOOR, RECESS = 0.004, 0.0012
BAG: Colour = (0.93, 0.93, 0.95, 1.0)


Kind = Literal["rim", "bag", "lid"]


@dataclass(frozen=True)
class TrashBin:
    """Sizes [m] and colours.

    Attributes: kind; width, over the rim; height; foot, the foot's width as a share of the rim's;
    wall; top, height of the rim, the bag's fold or the lid; body, upper part and inside colours.
    """

    kind: Kind = "rim"
    width: float = 0.150
    height: float = 0.180
    foot: float = 0.78
    wall: float = 0.0026
    top: float = 0.009
    body: Colour = (0.24, 0.27, 0.31, 1.0)
    upper: Colour = (0.24, 0.27, 0.31, 1.0)
    inside: Colour = (0.18, 0.20, 0.23, 1.0)


_KINDS: tuple[Kind, ...] = ("bag", "lid", "rim")
_COLOURS: tuple[Colour, ...] = (
    (0.70, 0.71, 0.73, 1.0),
    (0.16, 0.38, 0.60, 1.0),
    (0.20, 0.20, 0.21, 1.0),
    (0.28, 0.48, 0.30, 1.0),
    (0.88, 0.86, 0.80, 1.0),
    (0.70, 0.20, 0.18, 1.0),
    (0.55, 0.48, 0.42, 1.0),
)


def design(index: int) -> TrashBin:
    """The sizes of instance `index`; 0 is a grey desktop bin with a rolled rim."""
    if index == 0:
        return TrashBin()
    rng = specimen_rng("trash_bin", index)
    kind: Kind = in_turn(index, _KINDS)
    body = in_turn(index, _COLOURS)
    red, green, blue, _ = (0.72 * np.array(body)).tolist()
    dark = (red, green, blue, 1.0)
    width = uniform(rng, 0.115, 0.200)
    return TrashBin(
        kind,
        width=width,
        height=uniform(rng, 1.14 * width, min(1.42 * width, 0.265)),
        foot=uniform(rng, 0.70, 0.86),
        wall=uniform(rng, 0.0024, 0.0030),
        top={
            "rim": uniform(rng, 0.007, 0.012),
            "bag": uniform(rng, 0.030, 0.050),
            "lid": uniform(rng, 0.030, 0.042),
        }[kind],
        body=body,
        upper={"rim": body, "bag": BAG, "lid": dark}[kind],
        inside=BAG if kind == "bag" else dark,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    bin_ = design(index)
    wall, seat = _wall(bin_), bin_.height - bin_.top
    foot = wall.outer[0, 0]
    piece = vessel(
        np.array([[0, RECESS], [foot - 0.009, RECESS], [foot - 0.008, 0]]),
        wall,
        base=[disc(foot, 0.0, FLOOR)],
        rings=rings(wall, (1, len(wall.outer) - 1)),
        glaze=Glaze(((seat - 1e-5, bin_.body), (np.inf, bin_.upper)), bin_.upper, bin_.inside),
        density=POLYPROPYLENE,
        lip=0.42 * bin_.wall,
        rounding={3: 0.003},
        sections=80,
    )
    return rigid_specimen(
        "trash_bin", [piece], object_type="axial", symmetry=SymmetryGroup.about_x()
    )


def _wall(bin_: TrashBin) -> Wall:
    foot, rim, seat = bin_.foot * bin_.width / 2, bin_.width / 2, bin_.height - bin_.top
    out = {"rim": 0.0042, "bag": 0.0012, "lid": 0.0030}[bin_.kind]
    lower = rim - out
    outer = [[foot, 0.0], [lower, seat], [rim, seat]]
    inner = [[foot - bin_.wall + (lower - foot) * FLOOR / seat, FLOOR], [lower - bin_.wall, seat]]
    if bin_.kind == "lid":  # a cone that leaves an opening
        opening = 0.84 * rim
        outer += [[rim, seat + 0.005], [opening + 1.2 * bin_.wall, bin_.height]]
        inner += [[lower - bin_.wall, seat + 0.003], [opening, bin_.height]]
    else:
        outer.append([rim, bin_.height])
        inner.append([lower - bin_.wall, bin_.height])
    return upright_wall(np.array(outer), np.array(inner))
