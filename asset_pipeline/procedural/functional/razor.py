"""A wet razor, T-shaped: cartridge razors, disposable ones and safety razors with a knurled handle.

Real sizes. Safety razors have handles of 75-100 x 10-14 mm and heads 41-44 mm wide, 24-27 mm long; cartridge
razors are 135-150 mm long, their cartridges 40-43 x 20-25 mm and 7-9 mm thick with two to five blades.
Weights: disposable 8-15 g, cartridge 30-60 g, safety razors 60-110 g (theirs are of brass).

X runs along the handle to the head; the origin is where the handle ends and the neck to the head begins. The
head hangs below the handle's axis, its blades down and forward: the label's Y points up, away from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from jaxtyping import Float

from asset_pipeline.procedural.extruded import panel
from asset_pipeline.procedural.pieces import Piece, placed, solid_piece
from asset_pipeline.procedural.solids import box, rounded_box
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, superellipse
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose

CHROME: Colour = (0.78, 0.79, 0.81, 1.0)
BLADE: Colour = (0.88, 0.89, 0.91, 1.0)
BLACK: Colour = (0.13, 0.13, 0.14, 1.0)
STRIP: Colour = (0.55, 0.80, 0.72, 1.0)

Style = Literal["cartridge", "disposable", "safety"]
_STYLES: tuple[Style, ...] = ("cartridge", "safety", "disposable")
# Handle's length and thickness, head's width and length [m]; densities of handle and head.
_SIZES: dict[Style, tuple[tuple[float, float], ...]] = {
    "cartridge": ((0.102, 0.116), (0.0120, 0.0142), (0.0400, 0.0430), (0.0210, 0.0245)),
    "disposable": ((0.096, 0.108), (0.0106, 0.0124), (0.0390, 0.0415), (0.0180, 0.0205)),
    "safety": ((0.092, 0.112), (0.0106, 0.0132), (0.0412, 0.0440), (0.0240, 0.0270)),
}
_DENSITY: dict[Style, tuple[float, float]] = {
    "cartridge": (2400.0, 1300.0),
    "disposable": (900.0, 1150.0),
    "safety": (4500.0, 5000.0),
}


@dataclass(frozen=True)
class Razor:
    """Sizes [m], style and colours.

    Attributes: style; grip, the handle's length; thick, its diameter; width of the head and length,
    across the blades; tilt of its plane from the handle's axis [rad]; drop of its middle below the
    axis; neck, from the handle to the head's middle along x; blades; body, inlay and head colours.
    """

    style: Style = "cartridge"
    grip: float = 0.110
    thick: float = 0.0130
    width: float = 0.0415
    length: float = 0.0225
    tilt: float = 0.72
    drop: float = 0.011
    neck: float = 0.021
    blades: int = 3
    body: Colour = (0.16, 0.17, 0.20, 1.0)
    inlay: Colour = (0.15, 0.45, 0.78, 1.0)
    head: Colour = (0.24, 0.26, 0.30, 1.0)


_COLOURS: dict[Style, tuple[tuple[Colour, Colour, Colour], ...]] = {
    "cartridge": (
        ((0.74, 0.75, 0.78, 1.0), (0.90, 0.40, 0.12, 1.0), (0.20, 0.22, 0.26, 1.0)),
        ((0.20, 0.48, 0.46, 1.0), (0.90, 0.91, 0.90, 1.0), (0.70, 0.80, 0.80, 1.0)),
        ((0.92, 0.56, 0.66, 1.0), (0.96, 0.94, 0.94, 1.0), (0.94, 0.70, 0.78, 1.0)),
        ((0.15, 0.17, 0.22, 1.0), (0.72, 0.16, 0.18, 1.0), (0.18, 0.18, 0.20, 1.0)),
    ),
    "disposable": (
        ((0.20, 0.42, 0.76, 1.0), (0.20, 0.42, 0.76, 1.0), (0.20, 0.42, 0.76, 1.0)),
        ((0.96, 0.80, 0.18, 1.0), (0.96, 0.80, 0.18, 1.0), (0.96, 0.80, 0.18, 1.0)),
        ((0.94, 0.58, 0.70, 1.0), (0.94, 0.94, 0.94, 1.0), (0.94, 0.94, 0.94, 1.0)),
        ((0.94, 0.52, 0.16, 1.0), (0.94, 0.52, 0.16, 1.0), (0.92, 0.92, 0.92, 1.0)),
    ),
    "safety": (
        (CHROME, (0.62, 0.63, 0.65, 1.0), CHROME),
        ((0.24, 0.24, 0.26, 1.0), (0.16, 0.16, 0.17, 1.0), CHROME),
        ((0.82, 0.67, 0.38, 1.0), (0.70, 0.55, 0.28, 1.0), (0.82, 0.67, 0.38, 1.0)),
        ((0.40, 0.24, 0.15, 1.0), (0.34, 0.20, 0.12, 1.0), CHROME),
    ),
}


def design(index: int) -> Razor:
    """The sizes of instance `index`; 0 is a cartridge razor, the three kinds take turns after it."""
    if index == 0:
        return Razor()
    rng = specimen_rng("razor", index)
    style = _STYLES[index % len(_STYLES)]
    grip, thick, width, length = (uniform(rng, *r) for r in _SIZES[style])
    body, inlay, head = in_turn(1 + index // len(_STYLES), _COLOURS[style])
    steep = style == "safety"  # its head stands nearly square on the handle
    return Razor(
        style,
        grip,
        thick,
        width,
        length,
        tilt=round(float(rng.uniform(*((0.92, 1.08) if steep else (0.62, 0.85)))), 3),
        drop=round(float(rng.uniform(*((0.007, 0.009) if steep else (0.010, 0.0125)))), 4),
        neck=round(float(rng.uniform(*((0.014, 0.017) if steep else (0.019, 0.023)))), 4),
        blades={"cartridge": int(rng.integers(3, 6)), "disposable": 2, "safety": 1}[style],
        body=body,
        inlay=inlay,
        head=head,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: the head towards +x, hanging down."""
    razor = design(index)
    pieces = [_handle(razor), _neck(razor)]
    head = _safety_head(razor) if razor.style == "safety" else _cartridge(razor)
    pieces += [placed(piece, _head_pose(razor)) for piece in head]
    return tool_specimen(
        "razor",
        pieces,
        joint=(0.0, 0.0, 0.0),
        mirror_normal="y",
        functional=(razor.neck - 0.45 * razor.length, np.inf),
    )


def _handle(razor: Razor) -> Piece:
    length, radius, body, inlay = razor.grip, razor.thick / 2, razor.body, razor.inlay
    if razor.style == "safety":
        collar = 0.006
        shares = ((1.0, 1.0), (0.92, 1.0), (0.90, 0.88), (0.12, 0.88), (0.10, 1.0), (0.0, 1.0))
        bands = [(-0.90 * length, body), (-0.10 * length, inlay), (-collar, body), (0.0, body)]
        outline = superellipse(2.0)
    else:
        shares = ((1.0, 0.86), (0.70, 1.0), (0.40, 0.86), (0.14, 1.0), (0.0, 0.90))
        ribs = np.linspace(-0.34, -0.06, 8)  # rubber and body in turn
        bands = [(-0.80 * length, body), (-0.62 * length, inlay)]
        bands += [(s * length, (body, inlay)[k % 2]) for k, s in enumerate(ribs)]
        bands.append((0.0, body))
        outline = superellipse(2.6)
    table = [(-s * length, 0.92 * r * radius, r * radius) for s, r in shares]
    if razor.style == "safety":
        table = [(x, z, z) for x, _, z in table]
    density = _DENSITY[razor.style][0]
    return handle(table, bands, density=density, outline=outline, rounding=(0.4 * radius, 0.0008))


def _head_pose(razor: Razor) -> Float[np.ndarray, "4 4"]:
    """`T_body_head`: x across the blades, y along them, z out of the head's back, up to the handle."""
    c, s = np.cos(razor.tilt), np.sin(razor.tilt)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    return compose(turn, np.array([razor.neck, 0.0, -razor.drop]))


def _neck(razor: Razor) -> Piece:
    """A bar that bends from the handle's axis down to the middle of the head's back."""
    share = np.linspace(0, 1, 9)
    pose = _head_pose(razor)
    end = pose[:3, 3] + 0.0005 * pose[:3, 2]
    x = end[0] * (1 - (1 - share) ** 1.4)
    z = end[2] * share**1.9
    line = np.column_stack([x, np.zeros_like(x), z])
    start = 0.55 * razor.thick / 2
    yoke = 0.36 * razor.width / 2
    deep = np.interp(share, (0, 0.3, 0.7, 1), (start, 0.75 * start, 0.0024, 0.0016))
    wide = np.interp(share, (0, 0.1, 0.45, 1), (start, start, yoke, yoke))
    if razor.style == "safety":
        wide = deep = np.interp(share, (0, 0.3, 1), (start, 0.8 * start, 0.7 * start))
    half = np.column_stack([deep, wide])
    colour = razor.head if razor.style == "safety" else razor.body
    return bar(line, half, parts=3, rgba=colour, density=_DENSITY[razor.style][0], power=2.8)


def _cartridge(razor: Razor) -> list[Piece]:
    """A frame with blades, a rubber guard in front of them and a lubricating strip behind."""
    along, wide, thick = razor.length / 2, razor.width / 2, 0.0040
    low, high = np.array([-along, -wide, -thick]), np.array([along, wide, thick])
    frame = rounded_box(low, high, 0.0018, razor.head)
    assert frame.mesh is not None
    piece = solid_piece(
        frame.mesh, [box(low, high)], rgba=razor.head, density=_DENSITY[razor.style][1]
    )
    face, inside = -thick, wide - 0.0030
    guard, strip = 0.78 * along, -0.72 * along
    prints = [
        _plate(strip, 0.0019, inside, face, 0.0004, STRIP),
        *(_plate(guard - 0.0015 * k, 0.0005, inside, face, 0.0004, BLACK) for k in range(3)),
    ]
    for at in np.linspace(strip + 0.0044, guard - 0.0058, razor.blades):
        prints.append(_plate(float(at), 0.00055, inside, face, 0.0005, BLADE))
    return [Piece((*piece.visual, *prints), piece.collision, piece.mass)]


def _plate(x: float, half: float, wide: float, face: float, out: float, rgba: Colour) -> Shape:
    return box((x - half, -wide, face - out), (x + half, wide, face + 0.0005), rgba)


def _safety_head(razor: Razor) -> list[Piece]:
    """A curved cap below, the blade, and a base plate with rounded bars above, towards the handle."""
    along, wide = razor.length / 2, razor.width / 2
    turn = np.linspace(0, np.pi, 9)
    cap = np.column_stack([0.90 * along * np.cos(turn), -0.0008 - 0.0042 * np.sin(turn)])
    base = shapely.box(-along, 0.0012, along, 0.0042).buffer(-0.0012).buffer(0.0012, quad_segs=3)
    density = _DENSITY[razor.style][1]
    profiles = (
        (shapely.Polygon(cap), wide, razor.head),
        (shapely.box(-0.96 * along, -0.0009, 0.96 * along, -0.0002), wide - 0.0005, BLADE),
        (shapely.box(-0.70 * along, -0.0004, 0.70 * along, 0.0014), wide - 0.0010, BLACK),
        (base, wide, razor.head),
    )
    # Profiles are drawn in the head's xz plane and extruded along its y.
    turned = compose(np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]), np.zeros(3))
    return [
        placed(panel(outline, -half, half, rgba=rgba, density=density), turned)
        for outline, half, rgba in profiles
    ]
