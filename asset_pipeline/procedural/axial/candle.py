"""A candle with its wick: pillar, taper, votive, or wax in a glass.

Real sizes, of things on sale: pillars are 45-80 mm wide and 70-160 mm tall, taper candles 21-24 mm at the foot and
up to 250 mm tall, votives 40-50 mm wide and 45-65 mm tall, glasses 65-80 mm wide and 80-100 mm tall. Paraffin weighs
900 kg/m^3. Wicks stand 8-12 mm out of the wax.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.revolution import fillet
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from asset_pipeline.procedural.vessel import Glaze, disc, rings, upright_wall, vessel, wall_rings
from manipose_mj.poses import SymmetryGroup

WAX, GLASS = 900.0, 2500.0  # [kg/m^3]
POOL = 0.0018  # depth of the hollow round the wick [m]
SOOT: Colour = (0.13, 0.12, 0.11, 1.0)
CLEAR: Colour = (0.84, 0.90, 0.92, 0.35)


Kind = Literal["pillar", "taper", "votive", "glass"]


@dataclass(frozen=True)
class Candle:
    """Sizes [m] and colours.

    Attributes: kind; diameter, of the wax at its widest or of the glass; height, without the wick;
    edge, rounding of the wax's upper edge; wick, how far it stands out; wax; band, round a pillar or
    the foot of another (None has none).
    """

    kind: Kind = "pillar"
    diameter: float = 0.060
    height: float = 0.110
    edge: float = 0.006
    wick: float = 0.010
    wax: Colour = (0.93, 0.88, 0.76, 1.0)
    band: Colour | None = None


_WAXES: tuple[Colour, ...] = (
    (0.70, 0.10, 0.12, 1.0),
    (0.94, 0.92, 0.86, 1.0),
    (0.18, 0.34, 0.24, 1.0),
    (0.88, 0.66, 0.24, 1.0),
    (0.60, 0.52, 0.68, 1.0),
    (0.86, 0.62, 0.56, 1.0),
    (0.30, 0.42, 0.56, 1.0),
)
_BANDS: tuple[Colour | None, ...] = (None, (0.84, 0.70, 0.30, 1.0), None, (0.55, 0.35, 0.20, 1.0))


def design(index: int) -> Candle:
    """The sizes of instance `index`; 0 is an ivory pillar."""
    if index == 0:
        return Candle()
    rng = specimen_rng("candle", index)
    kind: Kind = in_turn(mixed(index), ("taper", "glass", "pillar", "votive", "pillar"))
    wide, tall = {
        "pillar": ((0.045, 0.072), (1.25, 2.3)),
        "taper": ((0.0205, 0.024), (6.6, 8.0)),
        "votive": ((0.042, 0.054), (1.05, 1.35)),
        "glass": ((0.064, 0.074), (1.15, 1.40)),
    }[kind]
    diameter = uniform(rng, *wide)
    return Candle(
        kind=kind,
        diameter=diameter,
        height=round(min(diameter * uniform(rng, *tall), 0.186), 4),
        edge=uniform(rng, 0.004, 0.008),
        wick=uniform(rng, 0.0085, 0.012),
        wax=in_turn(index, _WAXES),
        band=in_turn(index, _BANDS) if kind in ("pillar", "votive") else None,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    candle = design(index)
    pieces = _glass(candle) if candle.kind == "glass" else [_wax(candle)]
    wax_top = 0.72 * candle.height if candle.kind == "glass" else candle.height
    low, top = wax_top - 0.004, wax_top + candle.wick
    wick = np.array([[0, low], [0.0013, low], [0.0013, top - 0.001], [0.0008, top], [0, top]])
    pieces.append(filled(wick, density=WAX, bands=[(top, SOOT)], sections=12))
    return rigid_specimen("candle", pieces, object_type="axial", symmetry=SymmetryGroup.about_x())


def _wax(candle: Candle) -> Piece:
    r, h = candle.diameter / 2, candle.height
    if candle.kind == "taper":
        corners = [[0, 0], [r, 0], [r, 0.018], [0.93 * r, 0.020], [0.80 * r, 0.90 * h]]
        corners += [[0.55 * r, 0.965 * h], [0.0016, h], [0, h]]
        profile = fillet(np.array(corners), {1: 0.0008, 4: 0.02, 5: 0.01}, 6)
    else:
        foot = 0.86 * r if candle.kind == "votive" else r
        corners = [[0, 0], [foot, 0], [r, h], [0.45 * r, h], [0.30 * r, h - POOL], [0, h - POOL]]
        profile = fillet(np.array(corners), {1: 0.001, 2: candle.edge, 3: 0.002}, 6)
    bands = [(h, candle.wax)]
    if candle.band:
        low, high = 0.30 * h, (0.42 if candle.kind == "votive" else 0.55) * h
        bands = [(low, candle.wax), (high, candle.band), (h, candle.wax)]
    return filled(profile, density=WAX, bands=bands)


def _glass(candle: Candle) -> list[Piece]:
    """A straight glass, and the wax in it."""
    r, h, wall, floor = candle.diameter / 2, candle.height, 0.0030, 0.006
    wax = 0.72 * h
    outer = np.array([[r, 0.0], [r, wax], [r, h]])
    inner = np.array([[r - wall, floor], [r - wall, h]])
    side = upright_wall(outer, inner)
    glass = vessel(
        np.array([[0, 0.0012], [0.74 * r, 0.0012], [0.80 * r, 0]]),
        side,
        base=(),
        rings=(),
        glaze=Glaze.plain(CLEAR),
        density=GLASS,
        lip=0.0012,
        rounding={3: 0.003},
        sections=64,
    )
    inside = r - wall
    block = np.array([[0, floor], [inside, floor], [inside, wax], [0, wax]])
    content = filled(block, density=WAX, bands=[(h, candle.wax)])
    above = upright_wall(outer[1:], np.array([[inside, wax], [inside, h]]))
    collision = (disc(r, 0.0, wax), *wall_rings(above, rings(above, [1])))
    return [Piece(glass.visual, collision, glass.mass), Piece(content.visual, (), content.mass)]
