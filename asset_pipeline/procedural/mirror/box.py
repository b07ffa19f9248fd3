"""A folding carton: crackers, tea, pudding, juice.

Real sizes (Calli et al. 2015, object list): cracker box 60 x 160 x 230 mm and 411 g, sugar box
38 x 89 x 175 mm and 514 g, pudding box 35 x 110 x 89 mm and 187 g. Shop cartons: tea 60-75 x 75-125 x
125-140 mm, a 1 l juice brick 60 x 95 x 165 mm, a 0.2 l drink brick 37 x 50 x 105 mm. Ours: smallest side
30-70 mm (so that a Panda's hand takes it), the next 55-140 mm, height 90-210 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import combine, shape_mass_properties
from asset_pipeline.procedural.solids import (
    ellipse,
    print_on_face,
    rounded_box_bands,
    rounded_rectangle,
)
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Body, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

CARDBOARD = 700.0  # [kg/m^3]
CARDBOARD_WALL = 0.0006  # [m]
SQUARE_WITHIN = 0.002  # sides that differ by less count as equal [m]
WHITE: Colour = (0.97, 0.96, 0.93, 1.0)


@dataclass(frozen=True)
class Carton:
    """Sizes [m], content and colours.

    Attributes: depth (the smallest side, along x), width (along y), height; content, bulk density
    [kg/m^3]; body, band and ink colours; edge, radius of the edges.
    """

    depth: float = 0.060
    width: float = 0.130
    height: float = 0.190
    content: float = 190.0
    body: Colour = (0.76, 0.10, 0.12, 1.0)
    band: Colour = (0.97, 0.80, 0.22, 1.0)
    ink: Colour = (0.12, 0.22, 0.52, 1.0)
    edge: float = 0.0018


# Depth, width, height [m], bulk density of the content [kg/m^3].
_KINDS: tuple[tuple[tuple[float, float], tuple[float, float], tuple[float, float], float], ...] = (
    ((0.055, 0.066), (0.115, 0.140), (0.170, 0.210), 190.0),  # crackers
    ((0.060, 0.068), (0.072, 0.110), (0.120, 0.140), 180.0),  # tea
    ((0.030, 0.036), (0.080, 0.092), (0.105, 0.115), 560.0),  # pudding powder
    ((0.058, 0.063), (0.090, 0.096), (0.160, 0.170), 1030.0),  # juice, 1 l
    ((0.060, 0.070), (0.060, 0.070), (0.130, 0.200), 1030.0),  # milk, square
    ((0.036, 0.040), (0.085, 0.092), (0.165, 0.178), 860.0),  # sugar
)
_PRINTS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.15, 0.42, 0.30, 1.0), (0.95, 0.90, 0.72, 1.0), (0.55, 0.28, 0.12, 1.0)),
    ((0.45, 0.68, 0.82, 1.0), (0.14, 0.30, 0.56, 1.0), (0.80, 0.16, 0.16, 1.0)),
    ((0.97, 0.76, 0.16, 1.0), (0.80, 0.25, 0.10, 1.0), (0.35, 0.18, 0.10, 1.0)),
    ((0.93, 0.48, 0.12, 1.0), (0.98, 0.93, 0.80, 1.0), (0.20, 0.45, 0.20, 1.0)),
    ((0.30, 0.20, 0.45, 1.0), (0.85, 0.78, 0.92, 1.0), (0.93, 0.72, 0.20, 1.0)),
)


def design(index: int) -> Carton:
    """The sizes of instance `index`; 0 is a cracker box, the kinds take turns after it."""
    if index == 0:
        return Carton()
    rng = specimen_rng("box", index)
    depth, width, height, content = _KINDS[index % len(_KINDS)]
    d, w, h = (uniform(rng, *r) for r in (depth, width, height))
    if depth == width:
        w = d
    body, band, ink = in_turn(index, _PRINTS)
    return Carton(d, w, h, content, body, band, ink)


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre: width along y, depth along x."""
    carton = design(index)
    half = np.array([carton.depth, carton.width, carton.height]) / 2
    square = abs(carton.width - carton.depth) < SQUARE_WITHIN
    body = Body(
        name="box",
        collision=(Shape("box", tuple(half)),),
        visual=_visuals(carton, square),
        mass_properties=combine(
            [
                shape_mass_properties([Shape("box", tuple(half))], CARDBOARD),
                # What is inside displaces cardboard: its density is the difference.
                _content(half - CARDBOARD_WALL, carton.content - CARDBOARD),
            ]
        ),
    )
    label = PoseLabel(
        origin=np.zeros(3),
        # X up, Y along the width. Both signs are open: the half turns are in the group.
        rotation=np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
        object_type="mirror",
        extents=2 * half[[2, 1, 0]],
        symmetry=_quarter_turns() if square else SymmetryGroup.three_planes(),
    )
    return Specimen(label, (body,))


def _quarter_turns() -> SymmetryGroup:
    """The eight rotations of a box with a square section across X."""
    quarter = rotation_about(np.array([1.0, 0.0, 0.0]), np.pi / 2)
    return SymmetryGroup.generated(np.round(np.stack([quarter, np.diag([-1.0, 1.0, -1.0])])))


def _content(half: np.ndarray, density: float):
    solid = shape_mass_properties([Shape("box", tuple(half))], abs(density))
    sign = np.sign(density)
    return type(solid)(sign * solid.mass, solid.center_of_mass, sign * solid.inertia)


def _visuals(carton: Carton, square: bool) -> tuple[Shape, ...]:
    """Body, bands and a printed panel on every side; the print is as symmetric as the box."""
    x, y, z = carton.depth / 2, carton.width / 2, carton.height / 2
    inner, outer = 0.72 * z, 0.84 * z
    bands = rounded_box_bands((x, y, z), carton.edge, (-outer, -inner, inner, outer))
    colours = (carton.body, carton.band, carton.body, carton.band, carton.body)
    shapes = [
        Shape("mesh", mesh=mesh, rgba=rgba) for mesh, rgba in zip(bands, colours, strict=True)
    ]
    for turn in range(4):
        distance, half = ((x, y), (y, y if square else x))[turn % 2]
        face = _face(turn * np.pi / 2, distance)
        panel = 0.78 * half, 0.82 * inner
        oval = 0.84 * panel[0], min(0.60 * panel[1], 1.5 * panel[0])
        label = 0.70 * oval[0], 0.26 * oval[1]
        outlines = (
            (rounded_rectangle(panel, 0.12 * min(panel)), WHITE),
            (ellipse(oval), carton.body),
            (rounded_rectangle(label, 0.3 * min(label)), carton.ink),
        )
        for layer, (outline, rgba) in enumerate(outlines, start=1):
            shapes.append(Shape("mesh", mesh=print_on_face(outline, face, layer), rgba=rgba))
    return tuple(shapes)


def _face(turn: float, distance: float) -> Float[np.ndarray, "4 4"]:
    """The frame of an upright side: z along its outward normal, y up."""
    normal, up = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([0.0, 0.0, 1.0])
    return compose(np.stack([np.cross(up, normal), up, normal], axis=1), distance * normal)
