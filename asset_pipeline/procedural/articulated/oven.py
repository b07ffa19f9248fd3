"""Ovens: table-top ones with dials beside the door, and built-in ones with dials above it.

Real sizes. Built-in ovens are 590-600 mm wide, 590-600 mm high (compact ones 380-455 mm) and 550 mm deep, and
weigh 26-35 kg; table-top ones hold 18-35 litres in cases 450-550 mm wide, 280-350 mm high and 330-400 mm
deep that weigh 6-12 kg. Doors turn about their lower edge until they lie level, where a stop bears what is put
on them; springs in the hinges carry a door's weight, and friction holds it wherever it is left, so that it
neither slams nor springs back. Handles run along the upper edge. Below the door is a sill with vents, high
enough for the handle of the open door to stay off the table.
"""

from __future__ import annotations

import numpy as np

from asset_pipeline.procedural.articulated.handles.mounted import Handle
from asset_pipeline.procedural.articulated.handles.pulls import bar, bow
from asset_pipeline.procedural.articulated.ovens.oven_body import Oven, oven_specimen
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform

# Case, door, panel, lining, handle.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour, Colour], ...] = (
    ((0.70, 0.71, 0.72, 1), (0.74, 0.75, 0.76, 1), (0.74, 0.75, 0.76, 1), (0.26, 0.27, 0.30, 1), (0.60, 0.61, 0.62, 1)),
    ((0.15, 0.15, 0.16, 1), (0.09, 0.09, 0.10, 1), (0.11, 0.11, 0.12, 1), (0.36, 0.36, 0.37, 1), (0.76, 0.76, 0.77, 1)),
    ((0.93, 0.93, 0.92, 1), (0.95, 0.95, 0.94, 1), (0.95, 0.95, 0.94, 1), (0.40, 0.40, 0.42, 1), (0.84, 0.84, 0.84, 1)),
    ((0.55, 0.56, 0.57, 1), (0.10, 0.10, 0.11, 1), (0.72, 0.73, 0.74, 1), (0.24, 0.25, 0.28, 1), (0.74, 0.75, 0.76, 1)),
    ((0.66, 0.13, 0.12, 1), (0.70, 0.14, 0.13, 1), (0.18, 0.18, 0.19, 1), (0.40, 0.40, 0.41, 1), (0.80, 0.80, 0.81, 1)),
    ((0.88, 0.84, 0.72, 1), (0.90, 0.87, 0.76, 1), (0.90, 0.87, 0.76, 1), (0.30, 0.30, 0.33, 1), (0.72, 0.58, 0.32, 1)),
    ((0.28, 0.36, 0.42, 1), (0.31, 0.40, 0.46, 1), (0.80, 0.80, 0.81, 1), (0.36, 0.36, 0.38, 1), (0.82, 0.82, 0.83, 1)),
)  # fmt: skip


def design(index: int) -> Oven:
    """The sizes of instance `index`; five of nine are table-top ovens."""
    if index == 0:
        return Oven()
    rng = specimen_rng("oven", index)
    table_top = index % 9 in (0, 2, 4, 6, 7)
    case, front, panel, lining, metal = in_turn(index, _COLOURS)
    sized = _table_top(rng, metal) if table_top else _built_in(rng, metal)
    return Oven(
        **sized,
        bars=uniform(rng, 0.020, 0.030),
        case_rgba=case,
        front_rgba=front,
        panel_rgba=panel,
        lining=lining,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, shut."""
    return oven_specimen(design(index))


def _table_top(rng: np.random.Generator, metal: Colour) -> dict:
    width = uniform(rng, 0.452, 0.550)
    height = uniform(rng, 0.285, 0.310 + 0.35 * (width - 0.452))
    panel = uniform(rng, 0.095, 0.130) if rng.random() < 0.75 else 0.0
    return {
        "width": width,
        "height": height,
        "depth": uniform(rng, 0.310, 0.390),
        "feet": uniform(rng, 0.012, 0.020),
        "door": uniform(rng, 0.020, 0.024),
        "sill": uniform(rng, 0.064, 0.070),
        "top": uniform(rng, 0.018, 0.026) if panel else uniform(rng, 0.050, 0.058),
        "panel": panel,
        "rail": uniform(rng, 0.022, 0.034),
        "rack": uniform(rng, 0.030, 0.044),
        "heaters": True,
        "dials": int(rng.integers(2, 4 + bool(panel))),
        "friction": uniform(rng, 0.30, 0.45),
        "damping": uniform(rng, 0.5, 0.8),
        "mass": round(6.5 + 5.0 * (width - 0.452) / 0.098 + float(rng.uniform(-0.4, 0.4)), 2),
        "handle": _pull(rng, round((width - panel) * uniform(rng, 0.62, 0.82), 4), 0.026, metal),
    }


def _built_in(rng: np.random.Generator, metal: Colour) -> dict:
    compact = rng.random() < 0.35
    height = uniform(rng, 0.440, 0.456) if compact else uniform(rng, 0.585, 0.600)
    width = uniform(rng, 0.555, 0.600)
    return {
        "width": width,
        "height": height,
        "depth": uniform(rng, 0.480, 0.545),
        "feet": 0.0,
        "door": uniform(rng, 0.030, 0.036),
        "sill": uniform(rng, 0.092, 0.100),
        "top": uniform(rng, 0.085, 0.105),
        "panel": 0.0,
        "side": uniform(rng, 0.045, 0.060),
        "back": uniform(rng, 0.060, 0.090),
        "rail": uniform(rng, 0.045, 0.060),
        "rack": uniform(rng, 0.075, 0.110),
        "heaters": False,
        "dials": int(rng.integers(2, 5)),
        "time": f"{rng.integers(10, 24):02d}:{rng.integers(0, 60):02d}",
        "friction": uniform(rng, 0.6, 1.0),
        "damping": uniform(rng, 1.2, 1.8),
        "mass": round((22.0 if compact else 26.0) + float(rng.uniform(0, 4)), 2),
        "handle": _pull(rng, round(width * uniform(rng, 0.66, 0.84), 4), 0.032, metal),
    }


def _pull(rng: np.random.Generator, length: float, standoff: float, metal: Colour) -> Handle:
    """A bar or, nearly as often, a flat bow."""
    off = standoff, standoff + 0.003
    if rng.random() < 0.45:
        return bow((length, length), standoff=off, power=(5.0, 7.0))(rng, metal)
    return bar((length, length), thickness=(0.011, 0.013), standoff=off)(rng, metal)
