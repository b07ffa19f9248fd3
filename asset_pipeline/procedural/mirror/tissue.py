"""A box of tissues with one sticking out of its slot.

Real sizes: flat boxes on sale are 185-230 x 95-120 x 45-85 mm, compact ones 130-165 x 68-80 x 60-80 mm, square ones 105-115 mm
wide; 50-150 tissues, 0.10-0.28 kg; the tissue stands out by 40-60 mm. Ours are at most 70 mm tall or 72 mm wide, so that a
Panda's hand takes them. Up is X; Y lies along the slot and the longer side and half a turn maps the shape onto itself;
square boxes have a round hole and a tissue of four folds, and quarter turns do.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.moulded import facing, moulded, printed, rectangle, slab_loops
from asset_pipeline.procedural.pieces import AreaBox, Piece, rigid_specimen
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.solids import ellipse, loft
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, rotation_about

PAPER: Colour = (0.97, 0.97, 0.96, 1.0)
DARK: Colour = (0.30, 0.30, 0.32, 1.0)
PAPER_DENSITY = 60.0  # of the loosely folded tissue [kg/m^3]
POINTS = 48


@dataclass(frozen=True)
class TissueBox:
    """Sizes [m] and colours.

    Attributes: length, width, height of the box; slot, length of the hole as a share of the box's; out, how
    far the tissue stands out; spread, its length at the top as a share of the slot's; folds, waves of it; density
    of the box [kg/m^3]; carton's, band's and ink colours.
    """

    length: float = 0.205
    width: float = 0.112
    height: float = 0.060
    slot: float = 0.58
    out: float = 0.048
    spread: float = 1.02
    folds: int = 4
    density: float = 150.0
    carton: Colour = (0.35, 0.58, 0.74, 1.0)
    band: Colour = (0.93, 0.95, 0.96, 1.0)
    ink: Colour = (0.16, 0.32, 0.52, 1.0)

    @property
    def square(self) -> bool:
        """Whether it is as long as it is wide."""
        return self.length == self.width


# Carton, band, ink.
_COLOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.80, 0.55, 0.62, 1.0), (0.98, 0.93, 0.92, 1.0), (0.56, 0.22, 0.34, 1.0)),
    ((0.55, 0.70, 0.50, 1.0), (0.94, 0.95, 0.86, 1.0), (0.20, 0.40, 0.24, 1.0)),
    ((0.90, 0.87, 0.80, 1.0), (0.78, 0.66, 0.50, 1.0), (0.44, 0.34, 0.24, 1.0)),
    ((0.22, 0.30, 0.48, 1.0), (0.84, 0.72, 0.36, 1.0), (0.93, 0.90, 0.82, 1.0)),
    ((0.93, 0.74, 0.34, 1.0), (0.97, 0.95, 0.88, 1.0), (0.78, 0.40, 0.14, 1.0)),
    ((0.62, 0.55, 0.74, 1.0), (0.93, 0.91, 0.96, 1.0), (0.34, 0.26, 0.50, 1.0)),
)


def design(index: int) -> TissueBox:
    """The sizes of instance `index`; 0 is a flat box; every fourth one is square, every fourth compact."""
    if index == 0:
        return TissueBox()
    rng = specimen_rng("tissue", index)
    if index % 4 == 2:
        length = width = uniform(rng, 0.111, 0.120)
        height = uniform(rng, 0.050, 0.070)
    elif index % 4 == 3:
        length, width, height = (
            uniform(rng, 0.125, 0.165),
            uniform(rng, 0.064, 0.072),
            uniform(rng, 0.052, 0.078),
        )
    else:
        length, width, height = (
            uniform(rng, 0.175, 0.232),
            uniform(rng, 0.096, 0.120),
            uniform(rng, 0.045, 0.070),
        )
    carton, band, ink = in_turn(index, _COLOURS)
    return TissueBox(
        length,
        width,
        height,
        slot=uniform(rng, 0.50, 0.66),
        out=uniform(rng, 0.040, 0.056),
        spread=uniform(rng, 0.92, 1.12),
        folds=int(rng.choice((4, 6, 8))),
        density=round(float(rng.uniform(120.0, 190.0)), 0),
        carton=carton,
        band=band,
        ink=ink,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: slot along x, standing on z = 0."""
    item = design(index)
    x, y = item.length / 2, item.width / 2
    quarter = rotation_about(np.array([1.0, 0.0, 0.0]), np.pi / 2)
    symmetry = (
        SymmetryGroup.generated(np.round(quarter)[None])
        if item.square
        else SymmetryGroup.two_planes()
    )
    return rigid_specimen(
        "tissue",
        [_carton(item), _tissue(item)],
        object_type="mirror",
        symmetry=symmetry,
        areas=(AreaBox("grip", (-x, -y, 0.0), (x, y, item.height)),),
    )


def _carton(item: TissueBox) -> Piece:
    x, y, z = item.length / 2, item.width / 2, item.height
    loops = slab_loops(
        rectangle(x, y), 0.0015, 0.0, z, edges=(0.0012, 0.0012), cuts=(0.16 * z, 0.30 * z)
    )
    bands = ((0.16, item.ink), (0.30, item.band), (1.0, item.carton))
    prints: list[Shape] = []
    for normal, half in (((1, 0, 0), (x, y)), ((0, 1, 0), (y, x))):
        for side in (-1.0, 1.0):
            at = side * half[0] * np.array(normal) + [0, 0, 0.64 * z]
            face = facing(side * np.array(normal, float), at)
            tall, wide = 0.22 * z, min(0.52 * half[1], 0.75 * z)
            prints.append(printed(ellipse((wide, tall), 32), face, item.band, 1))
            prints.append(printed(ellipse((0.86 * wide, 0.72 * tall), 32), face, item.ink, 2))
    top = facing((0, 0, 1), (0, 0, z), up=(0, 1, 0))
    hole = _hole(item)
    prints.append(printed(1.16 * hole, top, item.band, 1))
    prints.append(printed(hole, top, DARK, 2))
    return moulded(loops, bands, density=item.density, prints=prints)


def _hole(item: TissueBox) -> np.ndarray:
    """The outline of the hole: a lens, or a circle in a square box."""
    if item.square:
        radius = 0.5 * item.slot * item.width / 2
        return ellipse((radius, radius))
    return ellipse((item.slot * item.length / 2, min(0.20 * item.width, 0.018)))


def _tissue(item: TissueBox) -> Piece:
    """A sheet gathered at the hole that opens in waves upwards."""
    angles = np.arange(POINTS) * (2 * np.pi / POINTS)
    c, s = np.cos(angles), np.sin(angles)
    shares = np.array([0.0, 0.12, 0.30, 0.50, 0.70, 0.86, 0.95, 1.0])
    loops = []
    for t in shares:
        rise = item.height - 0.002 + t * (item.out + 0.002)
        tip = 1 - 0.5 * max(0.0, (t - 0.86) / 0.14) ** 2
        if item.square:
            gathered = 0.30 + 0.42 * t**1.4
            lobe = 1 - (0.10 + 0.29 * t) * (1 - np.cos(4 * angles)) / 2
            radius = item.slot * item.width * gathered * lobe * (0.72 + 0.28 * tip)
            x, y = radius * c, radius * s
            dip = 0.25 * t**4 * item.out * (1 - np.cos(4 * angles)) / 2
        else:
            long = item.slot * item.length / 2 * (0.66 + (item.spread - 0.66) * t**1.2)
            thick = min(0.020, 0.2 * item.width) * (0.42 + 0.34 * t) * (0.3 + 0.7 * tip)
            wave = 1 - (0.10 + 0.13 * t) * (1 - np.cos(item.folds * np.pi * c)) / 2
            x, y = long * c, thick * s * wave
            dip = 0.36 * t**4 * item.out * np.abs(c) ** 2
        loops.append(np.column_stack([x, y, rise - dip]))
    stack = np.stack(loops)
    mesh = loft(stack)
    mass = solid_mass_properties(mesh, PAPER_DENSITY * float(mesh.volume))
    return Piece((Shape("mesh", mesh=mesh, rgba=PAPER),), _parts(stack, item.square), mass)


def _parts(stack: np.ndarray, square: bool) -> tuple[Shape, ...]:
    """Sectors between successive loops: hulls of a few points of each and of the middle."""
    parts = []
    sectors = 8 if square else 4
    span = POINTS // sectors
    stops = (0, 3, 5, 6, 7) if square else (0, 2, 4, 5, 6, 7)
    for low, high in pairwise(stops):
        for k in range(sectors):
            columns = (k * span + np.arange(0, span + 1, 2)) % POINTS
            rows = stack[[low, high]][:, columns].reshape(-1, 3)
            middles = stack[[low, high]].mean(axis=1)
            parts.append(convex_part(np.concatenate([rows, middles])))
    return tuple(parts)
