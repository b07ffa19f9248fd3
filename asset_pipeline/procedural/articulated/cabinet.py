"""Cabinets: chests of drawers, cupboards and what combines them, that stand on a table or on the floor.

Real sizes. Sold desk-top drawer cabinets are 250-400 mm deep and 300-450 mm tall, of boards of
12-18 mm; drawer units for desks 280-360 mm wide and 690-700 mm tall (IKEA's HELMER is 28 x 43 x 69 cm,
ALEX 36 x 58 x 70), night stands 370-460 mm wide and 450-700 mm tall (KULLEN 35 x 40 x 49, TARVA
48 x 39 x 62), kitchen wall cupboards 300-600 mm wide and 370-390 mm deep (METOD), cupboards with two
doors 800 x 300 x 830 mm (IVAR); none here is taller or wider than 0.90 m, what an arm of 0.85 m can
serve. Bar handles stand 30-40 mm off the front. The drawers run on full-extension slides, so that a drawer
comes out by nearly its own depth; they shut by the slides' friction.

Index 0 is a column of three drawers and, beside it, a column behind a door on the +y side.
"""

from __future__ import annotations

from dataclasses import replace

from asset_pipeline.procedural.articulated.assembly.furniture import furniture
from asset_pipeline.procedural.articulated.cabinets.kinds import KINDS, beside_a_door
from asset_pipeline.procedural.articulated.cabinets.sizes import Cabinet
from asset_pipeline.procedural.articulated.handles.pulls import Pull, bar, bow, edge, knob
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform

# Carcass, fronts, inside, handles.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    ((0.93, 0.92, 0.90, 1), (0.80, 0.84, 0.86, 1), (0.95, 0.94, 0.92, 1), (0.20, 0.20, 0.21, 1)),
    ((0.50, 0.34, 0.22, 1), (0.58, 0.40, 0.26, 1), (0.70, 0.55, 0.39, 1), (0.72, 0.58, 0.30, 1)),
    ((0.85, 0.76, 0.62, 1), (0.42, 0.55, 0.48, 1), (0.90, 0.84, 0.73, 1), (0.17, 0.16, 0.15, 1)),
    ((0.78, 0.62, 0.43, 1), (0.90, 0.88, 0.83, 1), (0.86, 0.75, 0.58, 1), (0.25, 0.23, 0.22, 1)),
    ((0.88, 0.78, 0.60, 1), (0.30, 0.38, 0.50, 1), (0.92, 0.85, 0.72, 1), (0.75, 0.76, 0.77, 1)),
    ((0.95, 0.95, 0.94, 1), (0.97, 0.97, 0.96, 1), (0.93, 0.93, 0.92, 1), (0.66, 0.67, 0.69, 1)),
    ((0.28, 0.28, 0.30, 1), (0.34, 0.34, 0.36, 1), (0.55, 0.54, 0.53, 1), (0.78, 0.64, 0.36, 1)),
    ((0.67, 0.47, 0.29, 1), (0.72, 0.52, 0.33, 1), (0.82, 0.68, 0.49, 1), (0.14, 0.13, 0.12, 1)),
    ((0.72, 0.16, 0.15, 1), (0.78, 0.20, 0.18, 1), (0.86, 0.84, 0.82, 1), (0.80, 0.80, 0.81, 1)),
)
# 14 kinds, 11 pulls and 9 sets of colours have no factor in common, so all combinations come in turn.
_SHORT = bar((0.120, 0.140), standoff=(0.035, 0.040), inset=(0.014, 0.014), rounding=0.002)
_LONG = bar((0.160, 0.220), inset=(0.025, 0.040))
_BOW = bow((0.096, 0.160))
_EDGE = edge((0.10, 0.20))
_PULLS: tuple[Pull, ...] = (
    *(_LONG, _BOW, knob, _SHORT, _EDGE, _BOW),
    *(knob, _LONG, _EDGE, knob, _BOW),
)


def design(index: int) -> Cabinet:
    """The sizes of instance `index`."""
    if index == 0:
        return Cabinet(beside_a_door((0.356, 0.248), (0.124,) * 3))
    rng = specimen_rng("cabinet", index)
    wood, front, inside, metal = in_turn(index, _COLOURS)
    plain = KINDS[index % len(KINDS)](rng)
    return replace(
        plain,
        drawer_friction=uniform(rng, 1.5, 3.0),
        drawer_damping=uniform(rng, 5.0, 10.0),
        handle=_PULLS[index % len(_PULLS)](rng, metal),
        wood=wood,
        front_rgba=front,
        inside=inside,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, everything shut."""
    return furniture(design(index))
