"""A spoon: tea, dessert, table and serving spoons of steel, plastic spoons, wooden cooking spoons.

Real sizes. Tea spoons are 130-145 mm long with bowls of 28-32 x 42-46 mm, dessert spoons 175-185 mm,
table spoons 190-210 mm with bowls of 40-45 x 60-68 mm, serving spoons 220-250 mm; makers' steel is 1.5-4 mm
thick and a table spoon weighs 40-70 g. Wooden cooking spoons are 250-300 mm long, the handle 10-13 mm
across, the bowl 45-60 mm wide and 5-8 mm thick. (The YCB spoon: 14.5 x 31.5 x 198 mm; Calli et al. 2015.)

The bowl hangs below the handle's axis, so the label's Y points up, out of its mouth's side.
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
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from asset_pipeline.procedural.swept import bar
from asset_pipeline.procedural.tool import tool_specimen

BEECH = 680.0  # [kg/m^3]
BOWL = (across(13) + np.linspace(-1, 1, 13)) / 2  # places across the bowl


@dataclass(frozen=True)
class Spoon:
    """Sizes [m], material and colour.

    Attributes: handle, whose `thick` and `neck` are the diameters of a wooden one; bowl, its length;
    width; depth, inside; wall; slope of the bowl's rim against the handle; wooden; density
    [kg/m^3]; rgba.
    """

    handle: FlatHandle = FlatHandle(length=0.128, end=0.020, neck=0.0085)
    bowl: float = 0.064
    width: float = 0.043
    depth: float = 0.0075
    wall: float = 0.0020
    slope: float = 0.20
    wooden: bool = False
    density: float = STEEL
    rgba: Colour = STEEL_GREY


# Whole length, the bowl's length and width, and the handle's end and neck [m].
_SIZES = (
    ((0.192, 0.212), (0.060, 0.068), (0.040, 0.045), (0.017, 0.022), (0.0078, 0.0092)),  # table
    ((0.132, 0.146), (0.042, 0.047), (0.028, 0.032), (0.012, 0.015), (0.0062, 0.0072)),  # tea
    ((0.174, 0.186), (0.054, 0.059), (0.036, 0.040), (0.015, 0.019), (0.0072, 0.0082)),  # dessert
    ((0.220, 0.250), (0.074, 0.086), (0.052, 0.060), (0.021, 0.025), (0.0090, 0.0105)),  # serving
)
_METALS = (STEEL_GREY, STEEL_GREY, BRASS, STEEL_GREY, BLACK_STEEL)
_PLASTICS: tuple[Colour, ...] = (
    (0.93, 0.93, 0.92, 1.0),
    (0.20, 0.55, 0.72, 1.0),
    (0.89, 0.36, 0.30, 1.0),
    (0.45, 0.68, 0.36, 1.0),
    (0.96, 0.77, 0.25, 1.0),
)
_WOODS: tuple[Colour, ...] = (
    (0.83, 0.66, 0.44, 1.0),
    (0.66, 0.46, 0.28, 1.0),
    (0.48, 0.31, 0.19, 1.0),
)


def design(index: int) -> Spoon:
    """The sizes of instance `index`; 0 is a steel table spoon, every fifth is wood, every eighth plastic."""
    if index == 0:
        return Spoon()
    rng = specimen_rng("spoon", index)
    if mixed(index) % 5 == 3:
        return _cooking_spoon(rng, in_turn(index // 5 + 1, _WOODS))
    whole, bowl, width, end, neck = (uniform(rng, *r) for r in _SIZES[index % len(_SIZES)])
    slim = index % 3 == 2  # modern: hardly wider at its end
    handle = sample_handle(
        rng,
        length=round(whole - bowl, 4),
        end=round(0.72 * end, 4) if slim else end,
        neck=neck,
        thick=(0.0023, 0.0030),
    )
    spoon = Spoon(
        handle,
        bowl,
        width,
        depth=round(float(rng.uniform(0.16, 0.20)) * width, 4),
        slope=round(float(rng.uniform(0.16, 0.25)), 3),
        rgba=in_turn(index, _METALS),
    )
    if index % 8 == 6:
        return in_plastic(spoon, in_turn(index // 8 + 1, _PLASTICS))
    return spoon


def _cooking_spoon(rng: np.random.Generator, wood: Colour) -> Spoon:
    bowl = rng.uniform(0.070, 0.088)
    thick = rng.uniform(0.0105, 0.013)
    return Spoon(
        FlatHandle(
            length=round(float(rng.uniform(0.25, 0.295) - bowl), 4),
            neck=round(float(thick * rng.uniform(0.86, 1.0)), 4),
            thick=round(float(thick), 4),
        ),
        bowl=round(float(bowl), 4),
        width=uniform(rng, 0.046, 0.058),
        depth=uniform(rng, 0.007, 0.009),
        wall=uniform(rng, 0.0055, 0.007),
        slope=round(float(rng.uniform(0.16, 0.22)), 3),
        wooden=True,
        density=BEECH,
        rgba=wood,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: bowl towards +x, its mouth up."""
    spoon = design(index)
    handle = (
        _round_handle(spoon)
        if spoon.wooden
        else flat_handle(spoon.handle, rgba=spoon.rgba, density=spoon.density)
    )
    return tool_specimen("spoon", [handle, _bowl(spoon)], joint=(0.0, 0.0, 0.0), mirror_normal="y")


def _round_handle(spoon: Spoon) -> Piece:
    """Thickest in the middle of its rear half, its end rounded."""
    handle = spoon.handle
    turn = np.linspace(0.2, np.pi / 2, 6)
    rounding = handle.thick / 2
    x = np.concatenate([rounding * (1 - np.cos(turn)), np.linspace(rounding, handle.length, 9)[1:]])
    radius = (
        np.interp(x / handle.length, (0, 0.45, 1), (handle.thick, handle.thick, handle.neck)) / 2
    )
    radius[:6] *= np.sin(turn)
    line = np.column_stack([x - handle.length, np.zeros_like(x), np.zeros_like(x)])
    half = np.column_stack([radius, radius])
    return bar(line, half, parts=(2, 5, 9), rgba=spoon.rgba, density=spoon.density)


def _bowl(spoon: Spoon) -> Piece:
    """An egg, broadest before its middle, from the joint to the tip; as wide as the handle at the joint."""
    turn = np.concatenate([np.linspace(0, 0.5, 5)[:-1], np.linspace(0.5, np.pi - 0.10, 16)])
    share = (1 - np.cos(turn)) / 2
    x = spoon.bowl * share
    egg = np.sqrt(np.clip(1 - (2 * share**0.88 - 1) ** 2, 0, 1)) * spoon.width / 2
    half = np.hypot(egg, spoon.handle.neck / 2 * (1 - share) ** 6)
    rim = dip(x, spoon.slope, 0.3 * spoon.bowl)
    surface = spread(np.column_stack([x, rim]), half, BOWL)
    deep = spoon.depth * (egg / egg.max()) ** 1.5
    surface[..., 2] -= deep[:, None] * (1 - BOWL**2)
    # The neck is as thick as the handle; the wall thins out from there.
    neck = np.clip(1 - x / (0.3 * spoon.bowl), 0, 1) ** 2
    thick = spoon.wall + (spoon.handle.thick - spoon.wall) * neck
    profile = side_profile(BOWL)
    if spoon.wooden:
        # From the round section of the handle.
        profile = profile + neck[:, None] * (np.sqrt(np.clip(1 - BOWL**2, 0.01, 1)) - profile)
    cuts = ((0, 3, 1), (3, 6, 2), (6, 9, 4), (9, 12, 4), (12, 16, 4), (16, len(x) - 1, 4))
    return sheet(
        surface, thick[:, None] * profile, cuts=cuts, rgba=spoon.rgba, density=spoon.density
    )
