"""A notebook lying flat: bound with a square back, with a plastic coil, or a diary shut by a snap strap.

Real sizes: A6 is 105 x 148 mm, B6 125 x 176 mm, A5 148 x 210 mm, pocket books 90 x 140 mm; 60-120 leaves make 8-18 mm;
coils are of 2 mm filament every 4.5-6 mm. Paper of 80 g/m^2 has about 800 kg/m^3: 0.08-0.35 kg. Up, X, is across the covers.
A bound book is a plain slab: Y lies along its longer side and the half turns map the shape onto itself. A coil has much
surface, so by the rule of the bulge Y points from the coil to the fore edge; it is alike from above and below, so half
a turn about Y is in the group. A strap reaches past the fore edge, where Y points, and lies on top.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.flat_objects import LONG_Y, OVER, along_face
from asset_pipeline.procedural.moulded import (
    facing,
    moulded,
    printed,
    rectangle,
    rounded_polygon,
    slab_loops,
)
from asset_pipeline.procedural.pieces import UPRIGHT, AreaBox, Piece, placed_shape, rigid_specimen
from asset_pipeline.procedural.revolution import wall_wedges
from asset_pipeline.procedural.snap_strap import snap_strap
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar_loops, loft_outwards
from asset_pipeline.procedural.tool_handles import ALONG_Y
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

PAPER: Colour = (0.95, 0.93, 0.87, 1.0)
LINES: Colour = (0.78, 0.76, 0.70, 1.0)
METAL: Colour = (0.75, 0.75, 0.76, 1.0)
COVER = 0.0014  # thickness [m]
PITCH = 0.0046  # of the coil [m]
WIRE = 0.0010  # its filament's radius [m]
WEDGES = 10
Style = Literal["bound", "coil", "diary"]


@dataclass(frozen=True)
class Notebook:
    """Sizes [m] and colours.

    Attributes: style; width across the back, and depth along it; thickness; coil, its radius; strap, its width;
    past, how far the strap or the coil reaches past the edge; density [kg/m^3]; cover's, band's, label's and
    coil's or strap's colours.
    """

    style: Style = "coil"
    width: float = 0.105
    depth: float = 0.148
    thickness: float = 0.013
    coil: float = 0.0075
    strap: float = 0.0
    past: float = 0.0032
    density: float = 760.0
    cover: Colour = (0.16, 0.34, 0.56, 1.0)
    band: Colour = (0.10, 0.24, 0.42, 1.0)
    label: Colour = (0.95, 0.94, 0.90, 1.0)
    extra: Colour = (0.16, 0.16, 0.17, 1.0)


_WHITE: Colour = (0.94, 0.94, 0.93, 1.0)
_BLACK: Colour = (0.14, 0.14, 0.15, 1.0)
# Cover, band, label, coil or strap.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    (_BLACK, (0.26, 0.26, 0.28, 1.0), (0.86, 0.84, 0.78, 1.0), (0.72, 0.14, 0.14, 1.0)),
    ((0.74, 0.22, 0.20, 1.0), (0.56, 0.14, 0.13, 1.0), _WHITE, _WHITE),
    ((0.72, 0.58, 0.40, 1.0), (0.54, 0.40, 0.25, 1.0), (0.95, 0.92, 0.84, 1.0), _BLACK),
    ((0.36, 0.58, 0.50, 1.0), (0.22, 0.42, 0.36, 1.0), _WHITE, (0.90, 0.88, 0.80, 1.0)),
    ((0.95, 0.76, 0.26, 1.0), (0.85, 0.60, 0.12, 1.0), _WHITE, (0.25, 0.26, 0.28, 1.0)),
    ((0.52, 0.40, 0.64, 1.0), (0.38, 0.27, 0.50, 1.0), (0.94, 0.90, 0.96, 1.0), _WHITE),
    ((0.88, 0.60, 0.64, 1.0), (0.76, 0.42, 0.48, 1.0), _WHITE, (0.50, 0.24, 0.30, 1.0)),
)
_STYLES: tuple[Style, ...] = ("bound", "diary", "coil")
# Width and depth [m]: pocket, A6, B6, A5; a coil may also be along the short side.
_FORMATS = ((0.090, 0.140), (0.105, 0.148), (0.125, 0.176), (0.140, 0.205))


def design(index: int) -> Notebook:
    """The sizes of instance `index`; 0 is coil-bound A6, the styles take turns after it."""
    if index == 0:
        return Notebook()
    rng = specimen_rng("notebook", index)
    style: Style = in_turn(index, _STYLES)
    sizes = _FORMATS if style == "bound" else _FORMATS[:3]
    width, depth = (
        round(side * float(rng.uniform(0.97, 1.03)), 4) for side in sizes[index % len(sizes)]
    )
    if style == "coil" and rng.random() < 0.35 and depth < 0.16:
        width, depth = depth, width
    low, high = {
        "bound": (0.008, 0.016),
        "diary": (0.012, 0.018),
        "coil": (0.12 * width, 0.135 * width),
    }[style]
    thick = uniform(rng, low, high)
    coil = round(thick / 2 + float(rng.uniform(0.0006, 0.0010)), 4)
    return Notebook(
        style,
        width,
        depth,
        thick,
        coil=coil,
        strap=uniform(rng, 0.022, 0.034),
        past=round(width * float(rng.uniform(0.132, 0.148)), 4)
        if style == "diary"
        else round(0.42 * coil, 4),
        density=round(float(rng.uniform(650.0, 800.0)), 0),
        **dict(zip(("cover", "band", "label", "extra"), in_turn(index, _COLOURS), strict=True)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: on z = 0, the back at -x."""
    book = design(index)
    pieces = [_book(book)]
    symmetry, rotation = SymmetryGroup.identity(), UPRIGHT
    if book.style == "coil":
        pieces.append(_coil(book))
        symmetry = OVER
    elif book.style == "diary":
        pieces.append(_strap(book))
    else:
        symmetry = SymmetryGroup.three_planes()
        rotation = LONG_Y
    x, y = book.width / 2, book.depth / 2
    return rigid_specimen(
        "notebook",
        pieces,
        object_type="mirror",
        symmetry=symmetry,
        rotation=rotation,
        areas=(AreaBox("grip", (0.2 * x, -y, 0.0), (x, y, book.thickness)),),
    )


def _book(book: Notebook) -> Piece:
    """Two covers and the leaves between them, cut flush on three sides; a band and a label on top."""
    x, y, z = book.width / 2, book.depth / 2, book.thickness
    cuts = (COVER, z - COVER)
    loops = slab_loops(rectangle(x, y), 0.004, 0.0, z, edges=(0.0006, 0.0006), cuts=cuts)
    bands = ((COVER / z, book.cover), (1 - COVER / z, PAPER), (1.0, book.cover))
    top = facing((0, 0, 1), (0, 0, z), up=(0, 1, 0))
    prints: list[Shape] = []
    back = facing((-1, 0, 0), (-x, 0, z / 2))
    if book.style == "coil":
        prints += [
            _on(
                top,
                rounded_polygon(rectangle(0.55 * x, 0.16 * y), 0.004),
                book.label,
                (0.08 * x, 0.40 * y),
            )
        ]
        for k in (-1, 0, 1):
            line = rectangle(0.42 * x, 0.0005)
            prints.append(_on(top, line, book.band, (0.08 * x, (0.40 + 0.07 * k) * y), 2))
        prints.append(_on(top, rectangle(0.88 * x, 0.05 * y), book.band, (0.08 * x, -0.72 * y)))
    else:
        prints.append(printed(rectangle(y - 0.004, z / 2 - 0.0006), back, book.cover))
        prints.append(_on(top, rectangle(0.07 * x, y), book.band, (-0.86 * x, 0.0)))
        patch = rounded_polygon(rectangle(0.36 * x, 0.14 * y), 0.003)
        prints.append(_on(top, patch, book.label, (0.02 * x, 0.45 * y)))
    if book.style == "bound":
        prints.append(_on(top, rectangle(0.003, y), book.extra, (0.78 * x, 0.0), 2))
        for share in (-0.3, 0.0, 0.3):
            face = facing((1, 0, 0), (x, 0, z * (0.5 + share)))
            prints.append(printed(rectangle(y - 0.004, 0.0002), face, LINES))
    return moulded(loops, bands, density=book.density, prints=prints)


def _on(
    face: np.ndarray, outline: np.ndarray, rgba: Colour, at: tuple[float, float], layer: int = 1
) -> Shape:
    return printed(outline, along_face(face, at), rgba, layer)


def _coil(book: Notebook) -> Piece:
    """Rings along the back; what collides is a tube."""
    x = -book.width / 2 + book.coil - book.past
    centre = np.array([x, 0.0, book.thickness / 2])
    angles = np.linspace(0, 2 * np.pi, 13)
    radius = book.coil - WIRE
    count = int((book.depth - 0.010) / PITCH)
    line = np.stack([radius * np.cos(angles), 0 * angles, radius * np.sin(angles)], axis=1)
    loops = bar_loops(line, np.full((13, 2), WIRE), points=6)
    loops[-1] = loops[0]
    ring = loft_outwards(loops)
    shifts = centre + np.outer((np.arange(count) - (count - 1) / 2) * PITCH, [0.0, 1.0, 0.0])
    size = len(ring.vertices)
    mesh = trimesh.Trimesh(
        (np.asarray(ring.vertices) + shifts[:, None]).reshape(-1, 3),
        (np.asarray(ring.faces) + size * np.arange(count)[:, None, None]).reshape(-1, 3),
        process=False,
    )
    half = (count - 1) / 2 * PITCH + WIRE
    outer = np.array([[book.coil, -half], [book.coil, half]])
    inner = outer - [2 * WIRE, 0.0]
    pose = ALONG_Y.copy()
    pose[:3, 3] = centre
    tube = tuple(placed_shape(s, pose) for s in wall_wedges(outer, inner, WEDGES, arc_steps=2))
    mass = solid_mass_properties(mesh, 1100.0 * float(mesh.volume))
    return Piece((Shape("mesh", mesh=mesh, rgba=book.extra),), tube, mass)


def _strap(book: Notebook) -> Piece:
    x = book.width / 2
    return snap_strap(
        start=0.56 * x,
        edge=x,
        past=book.past,
        height=book.thickness,
        width=book.strap,
        rgba=book.extra,
        metal=METAL,
    )
