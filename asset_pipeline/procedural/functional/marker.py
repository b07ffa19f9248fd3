"""A felt-tip marker without its cap: permanent, whiteboard, paint and jumbo markers, highlighters.

Real sizes. A permanent marker is 12-13 mm thick and 125-138 mm long, a whiteboard marker 15-18 mm and
118-130 mm, a jumbo marker 18-22 mm (the YCB marker: 18 mm by 121 mm, 15.8 g; Calli et al., "Benchmarking
in Manipulation Research", IEEE RAM 2015). The nib's holder is two thirds as thick as the barrel and 18-26 mm
long; nibs are 2-6 mm thick, of bullet shape.

A shape of revolution. X runs to the nib; the origin is where the barrel ends and the nib's holder begins.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle
from manipose_mj.poses import SymmetryGroup

WHITE: Colour = (0.94, 0.94, 0.93, 1.0)
GREY: Colour = (0.66, 0.67, 0.69, 1.0)
BLACK: Colour = (0.13, 0.13, 0.14, 1.0)

Style = Literal["permanent", "whiteboard", "paint", "jumbo", "highlighter"]
_STYLES: tuple[Style, ...] = ("permanent", "whiteboard", "paint", "jumbo", "highlighter")
# Diameter, barrel and holder [m], and the nib's diameter as a share of the barrel's.
_SIZES: dict[Style, tuple[tuple[float, float], ...]] = {
    "permanent": ((0.0120, 0.0134), (0.096, 0.108), (0.018, 0.023), (0.20, 0.28)),
    "whiteboard": ((0.0150, 0.0176), (0.090, 0.102), (0.018, 0.022), (0.24, 0.32)),
    "paint": ((0.0135, 0.0152), (0.098, 0.110), (0.020, 0.024), (0.18, 0.26)),
    "jumbo": ((0.0180, 0.0215), (0.090, 0.103), (0.019, 0.024), (0.34, 0.44)),
    "highlighter": ((0.0142, 0.0162), (0.088, 0.098), (0.020, 0.025), (0.28, 0.36)),
}
_INKS: tuple[Colour, ...] = (
    (0.80, 0.12, 0.13, 1.0),
    (0.12, 0.28, 0.66, 1.0),
    (0.10, 0.50, 0.28, 1.0),
    BLACK,
    (0.88, 0.45, 0.10, 1.0),
    (0.45, 0.20, 0.56, 1.0),
)
_BRIGHT: tuple[Colour, ...] = (
    (0.93, 0.92, 0.20, 1.0),
    (0.98, 0.45, 0.62, 1.0),
    (0.45, 0.88, 0.38, 1.0),
    (0.98, 0.62, 0.18, 1.0),
)


@dataclass(frozen=True)
class Marker:
    """Sizes [m], style and colour.

    Attributes: style; thick, the barrel's diameter; barrel, its length; holder, length of the nib's
    holder; step, the holder's diameter and nib, the nib's, as shares of the barrel's; taper of the
    barrel towards its rear; plug, length of the coloured rear plug; ink.
    """

    style: Style = "permanent"
    thick: float = 0.0128
    barrel: float = 0.104
    holder: float = 0.021
    step: float = 0.66
    nib: float = 0.25
    taper: float = 0.03
    plug: float = 0.008
    ink: Colour = BLACK


def design(index: int) -> Marker:
    """The sizes of instance `index`; 0 is a black permanent marker, the kinds take turns after it."""
    if index == 0:
        return Marker()
    rng = specimen_rng("marker", index)
    style = _STYLES[mixed(index) % len(_STYLES)]
    thick, barrel, holder, nib = (uniform(rng, *r) for r in _SIZES[style])
    turn = 1 + index // len(_STYLES)
    return Marker(
        style,
        thick,
        barrel,
        holder,
        step=round(float(rng.uniform(0.58, 0.68)), 3),
        nib=nib,
        taper=round(float(rng.uniform(0.0, 0.05)), 3),
        plug=uniform(rng, 0.005, 0.014),
        ink=in_turn(turn, _BRIGHT if style == "highlighter" else _INKS),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: the nib towards +x."""
    marker = design(index)
    radius, neck = marker.thick / 2, marker.step * marker.thick / 2
    tip = marker.nib * marker.thick / 2
    length, holder = marker.barrel, marker.holder
    shell = BLACK if marker.style == "permanent" else GREY if marker.style == "paint" else WHITE
    front = [(0.0, neck), (0.42 * holder, 0.97 * neck), (holder, 1.25 * tip)]
    nib = [(holder, tip), (holder + 0.8 * tip + 0.002, tip)]
    pieces = [
        _barrel(marker, radius, length),
        _round(front, shell, density=750.0, rounding=(0.0, 0.0004)),
        _round(nib, marker.ink, density=600.0, rounding=(0.0, 0.8 * tip)),
    ]
    return tool_specimen(
        "marker",
        pieces,
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.about_x(),
    )


def _barrel(marker: Marker, radius: float, length: float) -> Piece:
    """Filled with felt; its colours from the rear plug to the ring at the front."""
    rear = (1 - marker.taper) * radius
    body, printed = {
        "permanent": (GREY, BLACK),
        "whiteboard": (WHITE, marker.ink),
        "paint": (WHITE, marker.ink),
        "jumbo": (marker.ink, WHITE),
        "highlighter": (marker.ink, BLACK),
    }[marker.style]
    bands: list[tuple[float, Colour]] = [
        (marker.plug - length, marker.ink),
        (-0.66 * length, body),
        (-0.60 * length, printed),
        (-0.22 * length, body),
        (-0.19 * length, printed),
        (-0.012, body),
        (0.0, marker.ink),
    ]
    table = [(-length, rear, rear), (-0.25 * length, radius, radius), (0.0, radius, radius)]
    return handle(table, bands, density=700.0, rounding=(0.0022, 0.0012))


def _round(
    profile: list[tuple[float, float]],
    rgba: Colour,
    *,
    density: float,
    rounding: tuple[float, float],
) -> Piece:
    table = [(x, r, r) for x, r in profile]
    return handle(table, [(np.inf, rgba)], density=density, rounding=rounding)
