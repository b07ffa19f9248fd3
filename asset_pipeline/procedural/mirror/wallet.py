"""A wallet or purse lying flat: a folded wallet, one shut by a snap tab, or a purse with a kiss lock.

Real sizes: folded wallets are 105-125 x 85-98 x 14-28 mm, women's long ones 185-200 x 90-105 x 18-28 mm; purses with a
metal frame 95-130 x 80-110 x 22-35 mm; filled 0.08-0.25 kg. Up, X, is across the sides. A folded wallet is a plain slab:
Y lies along its longer side and the half turns map the shape onto itself. A tab reaches past the open edge, where Y
points by the rule of the bulge, and lies on top. The lock's knobs reach past a purse's frame, where Y points; it is alike
from above and below, so half a turn about Y is in the group.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.flat_objects import LONG_Y, OVER, along_face
from asset_pipeline.procedural.moulded import facing, moulded, printed, rectangle, slab_loops
from asset_pipeline.procedural.pieces import UPRIGHT, AreaBox, Piece, placed, rigid_specimen
from asset_pipeline.procedural.snap_strap import snap_strap
from asset_pipeline.procedural.solids import ellipse
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.tool_handles import ALONG_X
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose

GOLD: Colour = (0.80, 0.66, 0.34, 1.0)
SILVER: Colour = (0.76, 0.77, 0.78, 1.0)
STITCH = 0.0005  # half width of a seam [m]
NECK = 0.56  # a purse's width at its frame as a share
Style = Literal["fold", "tab", "purse"]


@dataclass(frozen=True)
class Wallet:
    """Sizes [m] and colours.

    Attributes: style; width, across the fold or from the lock to the bottom, and length along it; thickness;
    corner, radius of the outline; tab, its width or the knobs' radius; past, how far the tab or the knobs
    reach past the edge; density [kg/m^3]; leather's, gap's, seam's and metal's colours.
    """

    style: Style = "fold"
    width: float = 0.092
    length: float = 0.114
    thickness: float = 0.020
    corner: float = 0.006
    tab: float = 0.0
    past: float = 0.0
    density: float = 620.0
    leather: Colour = (0.40, 0.24, 0.13, 1.0)
    gap: Colour = (0.20, 0.11, 0.06, 1.0)
    seam: Colour = (0.62, 0.42, 0.26, 1.0)
    metal: Colour = GOLD


# Leather, gap, seam, metal.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    ((0.13, 0.13, 0.14, 1.0), (0.05, 0.05, 0.05, 1.0), (0.34, 0.34, 0.36, 1.0), SILVER),
    ((0.66, 0.16, 0.20, 1.0), (0.36, 0.06, 0.09, 1.0), (0.84, 0.44, 0.46, 1.0), GOLD),
    ((0.70, 0.47, 0.27, 1.0), (0.40, 0.24, 0.12, 1.0), (0.90, 0.76, 0.56, 1.0), GOLD),
    ((0.16, 0.24, 0.40, 1.0), (0.08, 0.12, 0.22, 1.0), (0.50, 0.58, 0.74, 1.0), SILVER),
    ((0.84, 0.64, 0.66, 1.0), (0.56, 0.36, 0.40, 1.0), (0.96, 0.86, 0.86, 1.0), GOLD),
    ((0.28, 0.36, 0.26, 1.0), (0.14, 0.19, 0.13, 1.0), (0.60, 0.66, 0.52, 1.0), SILVER),
    ((0.34, 0.18, 0.12, 1.0), (0.16, 0.08, 0.05, 1.0), (0.70, 0.54, 0.40, 1.0), GOLD),
)
_STYLES: tuple[Style, ...] = ("purse", "tab", "fold")


def design(index: int) -> Wallet:
    """The sizes of instance `index`; 0 is a brown folded wallet, the styles take turns after it."""
    if index == 0:
        return Wallet()
    rng = specimen_rng("wallet", index)
    style: Style = in_turn(index, _STYLES)
    if style == "purse":
        width = uniform(rng, 0.074, 0.096)
        length = round(width * float(rng.uniform(1.10, 1.28)), 4)
        thickness, tab, past = (
            uniform(rng, 0.022, 0.032),
            uniform(rng, 0.0045, 0.0054),
            uniform(rng, 0.020, 0.023),
        )
    else:
        width, length, thickness = (
            uniform(rng, 0.086, 0.098),
            uniform(rng, 0.108, 0.124),
            uniform(rng, 0.014, 0.026),
        )
        if index % 5 == 3:
            length = uniform(rng, 0.180, 0.196)
        tab, past = uniform(rng, 0.018, 0.021), uniform(rng, 0.018, 0.021)
    return Wallet(
        style,
        width,
        length,
        thickness,
        uniform(rng, 0.004, 0.009),
        tab if style != "fold" else 0.0,
        past if style != "fold" else 0.0,
        round(float(rng.uniform(520.0, 720.0)) * (0.7 if style == "purse" else 1.0), 0),
        *in_turn(index, _COLOURS),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: on z = 0; the open edge or the lock at +x."""
    wallet = design(index)
    x, y = wallet.width / 2, wallet.length / 2
    rotation = UPRIGHT
    if wallet.style == "fold":
        pieces, symmetry = [_folded(wallet)], SymmetryGroup.three_planes()
        rotation = LONG_Y
    elif wallet.style == "tab":
        pieces, symmetry = [_folded(wallet), _tab(wallet)], SymmetryGroup.identity()
    else:
        pieces, symmetry = _purse(wallet), OVER
    return rigid_specimen(
        "wallet",
        pieces,
        object_type="mirror",
        symmetry=symmetry,
        rotation=rotation,
        areas=(AreaBox("grip", (-x, -y, 0.0), (0.0, y, wallet.thickness)),),
    )


def _folded(wallet: Wallet) -> Piece:
    """Two leaves with a dark gap between, seams all around on top and below; the fold at -x hides the gap."""
    x, y, z = wallet.width / 2, wallet.length / 2, wallet.thickness
    edge = min(0.0045, 0.3 * z)
    cuts = (0.47 * z, 0.53 * z)
    loops = slab_loops(rectangle(x, y), wallet.corner, 0.0, z, edges=(edge, edge), cuts=cuts)
    bands = ((0.47, wallet.leather), (0.53, wallet.gap), (1.0, wallet.leather))
    prints = [
        shape
        for up, height in ((1.0, z), (-1.0, 0.0))
        for shape in _seam(wallet, facing((0, 0, up), (0, 0, height), up=(0, 1, 0)), edge + 0.0025)
    ]
    back = facing((-1, 0, 0), (-x, 0, z / 2))
    prints.append(printed(rectangle(y - wallet.corner, z / 2 - edge), back, wallet.leather))
    for side in (-1.0, 1.0):  # cards and lining in the gaps of the short sides
        face = facing((0, side, 0), (0.25 * x, side * y, z / 2))
        prints.append(printed(rectangle(0.5 * x, 0.10 * z), face, wallet.seam))
    face = facing((1, 0, 0), (x, 0, z / 2))
    for share, rgba in ((0.16, wallet.gap), (-0.16, wallet.gap)):
        face[2, 3] = z / 2 + share * z
        prints.append(printed(rectangle(y - wallet.corner, 0.0004), face, rgba))
    return moulded(loops, bands, density=wallet.density, prints=prints)


def _seam(wallet: Wallet, face: Float[np.ndarray, "4 4"], inset: float) -> list[Shape]:
    """Stitches along the edges of one side."""
    x, y = wallet.width / 2 - inset, wallet.length / 2 - inset
    seams = (
        ((x, 0), (STITCH, y)),
        ((-x, 0), (STITCH, y)),
        ((0, y), (x, STITCH)),
        ((0, -y), (x, STITCH)),
    )
    return [printed(rectangle(*half), along_face(face, at), wallet.seam) for at, half in seams]


def _tab(wallet: Wallet) -> Piece:
    x = wallet.width / 2
    return snap_strap(
        start=0.64 * x,
        edge=x,
        past=wallet.past,
        height=wallet.thickness,
        width=wallet.tab,
        rgba=wallet.leather,
        metal=wallet.metal,
    )


def _purse(wallet: Wallet) -> list[Piece]:
    """A puffed bag that widens away from a metal frame with two crossed knobs."""
    x, y, z = wallet.width / 2, wallet.length / 2, wallet.thickness
    corners = np.array(
        [
            [x, NECK * y],
            [-0.46 * x, y],
            [-x, 0.78 * y],
            [-x, -0.78 * y],
            [-0.46 * x, -y],
            [x, -NECK * y],
        ]
    )
    radii = (0.006, 0.6 * x, 0.6 * x, 0.6 * x, 0.6 * x, 0.006)
    edge = 0.46 * z
    loops = slab_loops(
        corners, radii, 0.0, z, edges=(edge, edge), cuts=(0.47 * z, 0.53 * z), steps=4
    )
    prints = []
    for up, height in ((1.0, z), (-1.0, 0.0)):
        for share in (-0.42, 0.0, 0.42):  # gathers
            face = facing((0, 0, up), (0.34 * x, share * y, height), up=(0, 1, 0))
            prints.append(printed(ellipse((0.26 * x, 0.0011), 16), face, wallet.gap))
    bands = ((0.47, wallet.leather), (0.53, wallet.gap), (1.0, wallet.leather))
    bag = moulded(loops, bands, density=wallet.density, prints=prints)
    return [bag, _frame(wallet), *_knobs(wallet)]


def _frame(wallet: Wallet) -> Piece:
    """Two metal bars along the straight edge, above and below the middle."""
    x, y, z = wallet.width / 2, NECK * wallet.length / 2 + 0.002, wallet.thickness
    half = 0.28 * z
    loops = slab_loops(
        rectangle(0.0045, y),
        0.002,
        z / 2 - half,
        z / 2 + half,
        edges=(0.0015, 0.0015),
        cuts=(0.48 * z, 0.52 * z),
    )
    loops[..., 0] += x - 0.0005
    bands = ((0.44, wallet.metal), (0.56, wallet.gap), (1.0, wallet.metal))
    return moulded(loops, bands, density=1500.0)


def _knobs(wallet: Wallet) -> list[Piece]:
    """Two balls side by side on short stems."""
    r, x, z = wallet.tab, wallet.width / 2 + 0.004, wallet.thickness / 2
    reach = wallet.past
    angles = np.linspace(-0.42 * np.pi, np.pi / 2, 9)
    ball = np.column_stack([r * np.cos(angles), reach - r + r * np.sin(angles)])
    ball[-1, 0] = 0.0
    stem = 0.45 * r
    profile = np.array([(0, -0.002), (stem, -0.002), (stem, ball[0, 1] - 1e-4), *ball])
    knobs = []
    for side in (-1.0, 1.0):
        knob = turned(
            profile,
            (-0.002, ball[0, 1] - 1e-4, *ball[1:-1:2, 1]),
            bands=((1.0, wallet.metal),),
            density=3000.0,
            sections=20,
        )
        knobs.append(placed(knob, compose(ALONG_X[:3, :3], np.array([x, side * 0.9 * r, z]))))
    return knobs
