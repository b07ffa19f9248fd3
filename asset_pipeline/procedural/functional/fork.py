"""A fork: table, dessert and serving forks of steel, plastic picnic forks.

Real sizes. Table forks are 190-210 mm long and 24-28 mm wide with four tines of 45-55 mm, dessert and cake
forks 150-185 mm with three or four, serving forks up to 220 mm with three; a table fork weighs 40-70 g.
(The YCB fork: 14 x 20 x 198 mm; Calli et al., "Benchmarking in Manipulation Research", IEEE RAM 2015.)

Palm and tines hang below the handle's axis, so the label's Y points up, out of their hollow side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.cutlery import (
    BLACK_STEEL,
    BRASS,
    STEEL,
    STEEL_GREY,
    FlatHandle,
    across,
    dip,
    flat_handle,
    in_plastic,
    sample_handle,
    side_profile,
    spread,
)
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.sheet import sheet
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.tool import tool_specimen

PALM = across(9)  # places across palm and tine
TINE = across(5)


@dataclass(frozen=True)
class Fork:
    """Sizes [m], material and colour.

    Attributes: handle; palm, from the joint to the roots of the tines; tine, their length; width of
    the palm; tines; gap between them; slope of the palm; curl of palm and tines up again [1/m]; wall,
    thickness of palm and tines; density [kg/m^3]; rgba.
    """

    handle: FlatHandle = FlatHandle(length=0.122, end=0.020, neck=0.0075)
    palm: float = 0.030
    tine: float = 0.048
    width: float = 0.026
    tines: int = 4
    gap: float = 0.0036
    slope: float = 0.38
    curl: float = 6.0
    wall: float = 0.0022
    density: float = STEEL
    rgba: Colour = STEEL_GREY


# Whole length, palm, tines and width [m], number of tines.
_SIZES = (
    ((0.190, 0.210), (0.028, 0.034), (0.044, 0.053), (0.024, 0.028), 4),  # table
    ((0.152, 0.162), (0.022, 0.026), (0.034, 0.040), (0.021, 0.024), 3),  # cake
    ((0.170, 0.185), (0.025, 0.030), (0.040, 0.046), (0.022, 0.025), 4),  # dessert
    ((0.205, 0.219), (0.032, 0.038), (0.050, 0.058), (0.028, 0.033), 3),  # serving
)
_METALS = (STEEL_GREY, BRASS, STEEL_GREY, BLACK_STEEL, STEEL_GREY)
_PLASTICS: tuple[Colour, ...] = (
    (0.93, 0.93, 0.92, 1.0),
    (0.30, 0.62, 0.60, 1.0),
    (0.88, 0.42, 0.28, 1.0),
    (0.35, 0.40, 0.68, 1.0),
)


def design(index: int) -> Fork:
    """The sizes of instance `index`; 0 is a steel table fork, every seventh is of plastic."""
    if index == 0:
        return Fork()
    rng = specimen_rng("fork", index)
    *ranges, tines = _SIZES[index % len(_SIZES)]
    whole, palm, tine, width = (uniform(rng, *r) for r in ranges)
    scale = whole / 0.20
    slim = index % 3 == 1  # modern: hardly wider at its end
    handle = sample_handle(
        rng,
        length=round(whole - palm - tine, 4),
        end=round(
            scale * float(rng.uniform(0.0125, 0.0145) if slim else rng.uniform(0.017, 0.022)), 4
        ),
        neck=round(scale * float(rng.uniform(0.0070, 0.0085)), 4),
        thick=(0.0024, 0.0031),
    )
    share = rng.uniform(0.135, 0.150)  # a gap's of the width
    fork = Fork(
        handle,
        palm,
        tine,
        width,
        tines,
        gap=round(float(share * width * (1.0 if tines == 4 else 1.25)), 4),
        slope=round(float(rng.uniform(0.36, 0.42)), 3),
        curl=round(float(rng.uniform(0.44, 0.50)) / (palm + tine), 2),
        rgba=in_turn(index, _METALS),
    )
    if index % 7 == 5:
        return in_plastic(fork, in_turn(index // 7 + 1, _PLASTICS))
    return fork


def generate(index: int = 0) -> Specimen:
    """Instance `index`: tines towards +x, their hollow side up."""
    fork = design(index)
    handle = flat_handle(fork.handle, rgba=fork.rgba, density=fork.density)
    pieces = [handle, _palm(fork), *(_tine(fork, number) for number in range(fork.tines))]
    return tool_specimen("fork", pieces, joint=(0.0, 0.0, 0.0), mirror_normal="y")


def _line(fork: Fork, x: np.ndarray) -> np.ndarray:
    return np.column_stack([x, dip(x, fork.slope, 0.5 * fork.palm, fork.curl)])


def _palm(fork: Fork) -> Piece:
    """From the neck over the shoulders to the roots of the tines."""
    share = np.concatenate([np.linspace(0, 0.6, 11), np.linspace(0.6, 1, 4)[1:]])
    shoulder = np.clip(share / 0.6, 0, 1)
    widening = np.sin(shoulder * np.pi / 2) ** 1.6
    half = (fork.handle.neck + (fork.width - fork.handle.neck) * widening) / 2
    neck = np.clip(1 - share / 0.5, 0, 1) ** 2
    thick = fork.wall + (fork.handle.thick - fork.wall) * neck
    cuts = ((0, 3, 1), (3, 6, 1), (6, 10, 1), (10, len(share) - 1, 1))
    return sheet(
        spread(_line(fork, share * fork.palm), half, PALM),
        thick[:, None] * side_profile(PALM),
        cuts=cuts,
        rgba=fork.rgba,
        density=fork.density,
    )


def _tine(fork: Fork, number: int) -> Piece:
    """Straight from its root, tapering over its last third to a blunt point."""
    pitch = (fork.width + fork.gap) / fork.tines
    middle = (number - (fork.tines - 1) / 2) * pitch
    share = np.concatenate([np.linspace(0, 0.7, 8), np.linspace(0.7, 1, 6)[1:]])
    point = np.clip((share - 0.7) / 0.3, 0, 1)
    half = (pitch - fork.gap) / 2 * (1 - 0.62 * point**1.7)
    surface = spread(_line(fork, fork.palm + share * fork.tine), half, TINE)
    surface[..., 1] += middle
    thick = fork.wall * (1 - 0.35 * point)
    return sheet(
        surface,
        thick[:, None] * side_profile(TINE),
        cuts=((0, 4, 1), (4, 7, 1), (7, len(share) - 1, 1)),
        rgba=fork.rgba,
        density=fork.density,
    )
