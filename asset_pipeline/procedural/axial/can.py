"""A drinks can with its tapered bottom and necked lid, or a food can that stacks.

Real sizes. The 330 ml drinks can (211/202) is 66.2 mm wide and 115 mm tall, its lid 54 mm over the seam and its
stand 47 mm wide under a dome 10 mm deep; the slim one is 58 mm wide and 145 mm tall, the 500 ml one 168 mm tall
(Beverage Can Makers Europe, dimensional leaflets). Food cans are 65-73 mm wide and 60-115 mm tall (the YCB tomato
soup can: 66 mm, 101 mm, 349 g, Calli et al. 2015); those that stack have a bottom 4-6 mm narrower than
the lid's seam. X points from the bottom to the lid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.filled import frusta
from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.revolution import fillet, lathe, revolved_mass
from asset_pipeline.procedural.solids import ellipse, print_on_face
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.turned import banded
from asset_pipeline.procedural.vessel import Wall, wall_rings
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

METAL: Colour = (0.78, 0.79, 0.81, 1.0)
TAB: Colour = (0.62, 0.63, 0.66, 1.0)
RECESS = 0.0019  # of the lid below its seam [m]
WEDGES = 8  # of the ring round the bottom's dome
PRODUCT = 520.0  # mean of a can two fifths full or of light content [kg/m^3]


@dataclass(frozen=True)
class Can:
    """Sizes [m] and colours.

    Attributes: kind; diameter of the body; height; lid, width over its seam; stand, of the bottom's
    ring; dome, its depth; body and band colours.
    """

    kind: Literal["drink", "food"] = "drink"
    diameter: float = 0.0662
    height: float = 0.1150
    lid: float = 0.0540
    stand: float = 0.0470
    dome: float = 0.0095
    body: Colour = (0.78, 0.07, 0.10, 1.0)
    band: Colour = (0.94, 0.94, 0.94, 1.0)


_BRANDS: tuple[tuple[Colour, Colour], ...] = (
    ((0.86, 0.30, 0.12, 1.0), (0.96, 0.90, 0.66, 1.0)),
    ((0.10, 0.28, 0.62, 1.0), (0.90, 0.20, 0.20, 1.0)),
    ((0.14, 0.48, 0.22, 1.0), (0.95, 0.86, 0.30, 1.0)),
    ((0.80, 0.10, 0.12, 1.0), (0.96, 0.95, 0.92, 1.0)),
    ((0.12, 0.12, 0.14, 1.0), (0.30, 0.75, 0.40, 1.0)),
    ((0.93, 0.80, 0.32, 1.0), (0.30, 0.45, 0.20, 1.0)),
    ((0.82, 0.83, 0.86, 1.0), (0.15, 0.35, 0.70, 1.0)),
)
_DRINKS = ((0.0662, 0.1150), (0.0583, 0.1450), (0.0662, 0.1680), (0.0533, 0.1345), (0.0662, 0.0880))


def design(index: int) -> Can:
    """The sizes of instance `index`; 0 is a 330 ml drinks can, every second one a food can."""
    if index == 0:
        return Can()
    rng = specimen_rng("can", index)
    body, band = in_turn(index, _BRANDS)
    if index % 2 == 0:
        diameter, height = in_turn(index // 2, _DRINKS)
        diameter += uniform(rng, -0.0004, 0.0004)
        return Can(
            diameter=diameter,
            height=height + uniform(rng, -0.002, 0.002),
            lid=diameter - uniform(rng, 0.0110, 0.0130),
            stand=diameter - uniform(rng, 0.0185, 0.0205),
            dome=uniform(rng, 0.0085, 0.0105),
            body=body,
            band=band,
        )
    lid = uniform(rng, 0.0640, 0.0735)
    return Can(
        kind="food",
        diameter=lid - 0.0016,
        height=uniform(rng, 0.060, 0.115),
        lid=lid,
        stand=lid - uniform(rng, 0.0085, 0.0105),
        dome=uniform(rng, 0.0045, 0.0060),
        body=body,
        band=band,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    can = design(index)
    bottom, side = _bottom(can), _side(can)
    rim = side[-1, 0]
    lid = np.array([[rim, can.height], [rim - 0.0012, can.height]])
    panel = can.height - RECESS
    lid = np.concatenate([lid, [[rim - 0.0022, panel], [0, panel]]])
    profile = np.concatenate([bottom, side, lid])
    low, high = (0.006, can.height - 0.006) if can.kind == "food" else (0.010, can.height - 0.006)
    start = 0.62 if can.kind == "food" else 0.30
    heights = [low, *(low + np.array([start, start + 0.12]) * (high - low)), high]
    colours = (METAL, can.body, can.band, can.body)
    piece = Piece(
        (
            Shape("mesh", mesh=lathe(bottom, 72), rgba=METAL),
            *banded(side, [*zip(heights, colours, strict=True), (can.height, METAL)], 72),
            Shape("mesh", mesh=lathe(lid, 72), rgba=METAL),
            *_tab(can, panel),
        ),
        _collision(can, bottom, side),
        revolved_mass(profile, PRODUCT),
    )
    return rigid_specimen("can", [piece], object_type="axial", symmetry=SymmetryGroup.about_x())


def _bottom(can: Can) -> np.ndarray:
    """The dome, from the axis to the ring that the can stands on: part of a sphere."""
    reach = can.stand / 2 - 0.002
    sphere = (reach**2 + can.dome**2) / (2 * can.dome)
    r = np.linspace(0, reach, 9)
    return np.column_stack([r, can.dome - sphere + np.sqrt(sphere**2 - r**2)])


def _side(can: Can) -> np.ndarray:
    """Upwards from the stand to the seam's top."""
    r, stand, seam = can.diameter / 2, can.stand / 2, can.lid / 2
    taper = 1.1 * (r - stand)
    if can.kind == "food":
        corners = [[stand, 0], [r, taper], [r, can.height - 0.003], [seam, can.height - 0.0028]]
        corners += [[seam, can.height]]
        return fillet(np.array(corners), {1: 0.003}, 4)
    neck = can.height - 0.0035
    corners = [[stand, 0], [r, taper], [r, neck - 0.014], [seam - 0.0012, neck - 0.0005]]
    corners += [[seam, neck], [seam, can.height]]
    return fillet(np.array(corners), {1: 0.006, 2: 0.008}, 5)


def _collision(can: Can, bottom: np.ndarray, side: np.ndarray) -> tuple[Shape, ...]:
    """A ring of wedges round the dome, and frusta above it."""
    level = np.array([[np.interp(can.dome, side[:, 1], side[:, 0]), can.dome]])
    low, high = side[side[:, 1] < can.dome], side[side[:, 1] > can.dome]
    ring = Wall(np.vstack([low, level]), bottom[::-1])
    wedges = wall_rings(ring, [(len(bottom), WEDGES)])
    return (*wedges, *frusta(np.vstack([level, high]), 0.0008))


def _tab(can: Can, panel: float) -> tuple[Shape, ...]:
    """A pull tab with its finger hole, as prints on the lid."""
    scale = can.lid / 0.054
    pose = np.eye(4)
    pose[:3, 3] = [0.006 * scale, 0, panel]
    hole = np.eye(4)
    hole[:3, 3] = [0.010 * scale, 0, panel]
    shapes = [print_on_face(ellipse((0.0125 * scale, 0.0075 * scale), 32), pose)]
    shapes.append(print_on_face(ellipse((0.0052 * scale, 0.0048 * scale), 24), hole, 2))
    return tuple(
        Shape("mesh", mesh=mesh, rgba=rgba) for mesh, rgba in zip(shapes, (TAB, METAL), strict=True)
    )
