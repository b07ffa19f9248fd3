"""A toy aeroplane: propeller plane, biplane or airliner.

Real sizes: die-cast airliners are 110-200 mm long, wooden and plastic propeller planes 120-250 mm, spans 0.75-1.05
of the length; 0.06-0.35 kg. Up is X. The wings are ahead of the middle, so by the rule of the bulge Y points to the tail.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.mirror.airframe import fin, nacelle, propeller, wheel_on_leg
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen, solid_piece
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.solids import ellipse, loft, print_on_face, rounded_rectangle
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, mixed, specimen_rng
from asset_pipeline.procedural.swept import convex_chunks, loft_outwards
from asset_pipeline.procedural.tool_handles import superellipse
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose

GLASS: Colour = (0.16, 0.22, 0.32, 1.0)
TAILWARDS = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # X up, Y to the tail
Style = Literal["propeller", "biplane", "airliner"]


@dataclass(frozen=True)
class Airplane:
    """Sizes [m] and colours.

    Attributes: style; length from nose to tail; span; girth, diameter of the fuselage; chord of the wing at
    its root; taper, chord at the tip as a share; sweep, by how much the tip lies behind the root; wing,
    place of its root's middle from the nose as a share of the length; thick, the wing's thickness; tail,
    span of the tailplane; fin, height; blades of the propeller; density [kg/m^3]; colours of fuselage,
    wings, and trim.
    """

    style: Style = "propeller"
    length: float = 0.180
    span: float = 0.180
    girth: float = 0.034
    chord: float = 0.042
    taper: float = 0.72
    sweep: float = 0.004
    wing: float = 0.27
    thick: float = 0.006
    tail: float = 0.068
    fin: float = 0.034
    blades: int = 2
    density: float = 620.0
    colour: Colour = (0.80, 0.16, 0.13, 1.0)
    wings: Colour = (0.95, 0.92, 0.84, 1.0)
    trim: Colour = (0.95, 0.76, 0.20, 1.0)


_WHITE: Colour = (0.95, 0.95, 0.95, 1.0)
_PAINTS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.18, 0.38, 0.68, 1.0), (0.96, 0.80, 0.22, 1.0), (0.80, 0.16, 0.13, 1.0)),
    (_WHITE, (0.72, 0.74, 0.77, 1.0), (0.14, 0.26, 0.56, 1.0)),
    ((0.32, 0.42, 0.28, 1.0), (0.38, 0.48, 0.32, 1.0), (0.86, 0.70, 0.20, 1.0)),
    ((0.92, 0.54, 0.14, 1.0), _WHITE, (0.20, 0.36, 0.60, 1.0)),
    (_WHITE, _WHITE, (0.78, 0.12, 0.16, 1.0)),
    ((0.80, 0.62, 0.40, 1.0), (0.86, 0.70, 0.48, 1.0), (0.26, 0.52, 0.50, 1.0)),
    ((0.55, 0.76, 0.86, 1.0), _WHITE, (0.92, 0.42, 0.40, 1.0)),
)
_STYLES: tuple[Style, ...] = ("airliner", "biplane", "propeller")


def design(index: int) -> Airplane:
    """The sizes of instance `index`; 0 is a low-wing propeller plane, the styles take turns after it."""
    if index == 0:
        return Airplane()
    rng = specimen_rng("toy_airplane", index)
    style: Style = in_turn(index, _STYLES)
    # As shares of the length: span, girth, chord, taper, sweep, wing, thickness, tail, fin.
    low, high = {
        "propeller": (
            (0.92, 0.17, 0.20, 0.55, 0.0, 0.25, 0.031, 0.34, 0.16),
            (1.06, 0.21, 0.25, 0.90, 0.03, 0.285, 0.038, 0.42, 0.22),
        ),
        "biplane": (
            (0.94, 0.17, 0.19, 0.82, 0.0, 0.26, 0.030, 0.34, 0.16),
            (1.06, 0.20, 0.23, 0.96, 0.02, 0.31, 0.036, 0.42, 0.20),
        ),
        "airliner": (
            (0.84, 0.12, 0.19, 0.34, 0.09, 0.25, 0.028, 0.30, 0.19),
            (0.98, 0.15, 0.23, 0.48, 0.13, 0.275, 0.034, 0.35, 0.24),
        ),
    }[style]
    shares = rng.uniform(low, high)
    length = rng.uniform(0.125, 0.225)
    s = [round(float(v), 4) for v in shares * length]
    colour, wings, trim = in_turn(index, _PAINTS)
    return Airplane(
        style=style,
        length=round(float(length), 4),
        span=s[0],
        girth=s[1],
        chord=s[2],
        taper=round(float(shares[3]), 3),
        sweep=s[4],
        wing=round(float(shares[5]), 3),
        thick=s[6],
        tail=s[7],
        fin=s[8],
        blades=3 if mixed(index) % 5 == 2 else 2,
        density=round(float(rng.uniform(550.0, 900.0)), 0),
        colour=colour,
        wings=wings,
        trim=trim,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: nose along +x, the fuselage's axis at z = 0, its middle at the origin."""
    plane = design(index)
    pieces: list[Piece] = [*_fuselage(plane), *_wings(plane), *_tail(plane)]
    girth = plane.girth
    if plane.style == "airliner":
        x = plane.length * (0.5 - plane.wing) + 0.42 * plane.chord - 0.34 * plane.sweep
        for side in (-1.0, 1.0):
            at = np.array([x, 0.17 * side * plane.span, -0.454 * girth])
            pieces.append(nacelle(at, girth, rgba=plane.trim, density=plane.density))
        wheel, feet = 0.20 * girth, ((0.13, 0.0), (0.56, 0.30), (0.56, -0.30))
    else:
        nose = plane.length / 2
        pieces += propeller(nose, girth, plane.blades, rgba=plane.trim, density=plane.density)
        ahead = plane.wing - 0.2 * plane.chord / plane.length
        wheel, feet = 0.22 * girth, ((ahead, 0.55), (ahead, -0.55), (0.93, 0.0))
    for share, side in feet:  # level with one another: the fuselage's axis is, too
        x, _, rise = (float(v) for v in _line(plane, np.array(share)))
        at, top = np.array([x, side * girth, -0.92 * girth]), rise - 0.1 * girth
        pieces += wheel_on_leg(at, wheel, 0.14 * girth, top, density=plane.density)
    r = plane.girth / 2
    return rigid_specimen(
        "toy_airplane",
        pieces,
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        rotation=TAILWARDS,
        areas=(AreaBox("grip", (-0.36 * plane.length, -r, -r), (-0.02 * plane.length, r, r)),),
    )


# Of the fuselage: place from nose to tail, radius, height of the middle; as shares of length and girth.
_PROPELLER_BODY = ((0, 0.30, 0), (0.015, 0.37, 0), (0.10, 0.46, 0), (0.30, 0.50, 0.0))
_PROPELLER_BODY += ((0.50, 0.46, 0.02), (0.75, 0.30, 0.08), (0.97, 0.16, 0.14), (1.0, 0.10, 0.15))
_AIRLINER_BODY = ((0, 0.06, -0.10), (0.012, 0.16, -0.09), (0.05, 0.33, -0.06), (0.13, 0.50, 0))
_AIRLINER_BODY += (
    (0.40, 0.50, 0),
    (0.66, 0.50, 0),
    (0.85, 0.32, 0.12),
    (0.98, 0.10, 0.22),
    (1.0, 0.05, 0.23),
)


def _line(
    plane: Airplane, share: Float[np.ndarray, "*n"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, radius and height of the fuselage's middle at shares of the way from nose to tail."""
    table = np.array(_AIRLINER_BODY if plane.style == "airliner" else _PROPELLER_BODY)
    radius, rise = (np.interp(share, table[:, 0], table[:, k]) * plane.girth for k in (1, 2))
    return plane.length * (0.5 - share), radius, rise


def _fuselage(plane: Airplane) -> list[Piece]:
    table = np.array(_AIRLINER_BODY if plane.style == "airliner" else _PROPELLER_BODY)
    stations = np.unique(np.concatenate([table[:, 0], np.linspace(0, 1, 21)]).round(4))
    x, radius, rise = _line(plane, stations)
    ring = superellipse(2.0 if plane.style == "airliner" else 2.5, 24)
    across = radius[:, None, None] * ring + np.stack([0 * rise, rise], 1)[:, None]
    loops = np.concatenate([np.broadcast_to(x[:, None, None], (len(x), 24, 1)), across], axis=2)
    cuts = tuple(int(np.searchsorted(stations, s)) for s in table[1:-1, 0] if s > 0.02)
    body = solid_piece(
        loft_outwards(loops), convex_chunks(loops, cuts), rgba=plane.colour, density=plane.density
    )
    if plane.style == "airliner":
        return [Piece((*body.visual, *_windows(plane)), body.collision, body.mass)]
    return [body, _canopy(plane)]


def _windows(plane: Airplane) -> list[Shape]:
    """An airliner's rows of windows and its cockpit's panes."""
    shapes = []
    for share in np.linspace(0.17, 0.64, 15):
        x, radius, _ = _line(plane, np.array(share))
        for side in (-1.0, 1.0):
            lean = side * np.deg2rad(14)
            out = np.array([0.0, side * np.cos(lean), abs(np.sin(lean))])
            up = np.cross(out, [-side, 0.0, 0.0])
            facing = np.stack([np.cross(up, out), up, out], axis=1)
            at = np.array([float(x), 0.0, 0.0]) + float(radius) * 0.999 * out
            pane = rounded_rectangle((0.007 * plane.length, 0.011 * plane.length), 0.001, steps=2)
            shapes.append(
                Shape("mesh", mesh=print_on_face(pane, compose(facing, at), 3), rgba=GLASS)
            )
    return [*shapes, _cockpit(plane)]


def _cockpit(plane: Airplane) -> Shape:
    """A dark band around the upper half of the nose."""
    angles = np.linspace(np.deg2rad(35), np.deg2rad(145), 15)
    rows = []
    for share in (0.065, 0.098):
        x, radius, rise = (float(v) for v in _line(plane, np.array(share)))
        lift = radius + 0.0004
        rows.append([(x, lift * np.cos(a), rise + lift * np.sin(a)) for a in angles])
    # The band's lower side is a little inside the nose.
    outer = np.array(rows)
    inner = outer * [1.0, 0.94, 0.94]
    return Shape(
        "mesh", mesh=loft_outwards(np.concatenate([outer, inner[:, ::-1]], axis=1)), rgba=GLASS
    )


def _canopy(plane: Airplane) -> Piece:
    """A glazed hood, or a biplane's low windscreen, behind the wing's middle."""
    long = 0.075 if plane.style == "biplane" else 0.12
    middle = 0.52 if plane.style == "biplane" else 0.44
    x, radius, _ = (float(v) for v in _line(plane, np.array(middle)))
    levels = np.linspace(0, 1, 6)
    size = np.sqrt(1 - (0.96 * levels) ** 2)
    z = 0.5 * radius + levels * (0.5 * radius + 0.30 * plane.girth)
    rings = np.stack(
        [
            np.column_stack(
                [ellipse((s * long * plane.length, s * 0.72 * radius), 16) + [x, 0], np.full(16, h)]
            )
            for s, h in zip(size, z, strict=True)
        ]
    )
    parts = [convex_part(rings[[a, b]].reshape(-1, 3)) for a, b in ((0, 2), (2, 4), (4, 5))]
    return solid_piece(loft(rings), parts, rgba=GLASS, density=plane.density)


def _wings(plane: Airplane) -> list[Piece]:
    x = plane.length * (0.5 - plane.wing)
    heights = {
        "propeller": (-0.26 * plane.girth,),
        "biplane": (-0.34 * plane.girth, 1.05 * plane.girth),
        "airliner": (-0.22 * plane.girth,),
    }[plane.style]
    pieces = []
    for level, z in enumerate(heights):
        for side in (-1.0, 1.0):
            tip = side * plane.span / 2
            root = 0.15 * side * plane.girth if level == 0 else 0.0
            ends = np.array(
                [
                    [x, plane.chord, plane.thick, root],
                    [x - plane.sweep, plane.taper * plane.chord, 0.8 * plane.thick, tip],
                ]
            )
            wing = fin(ends, False, rgba=plane.wings, density=plane.density)
            pieces.append(placed(wing, compose(np.eye(3), np.array([0.0, 0.0, z]))))
    if plane.style == "biplane":
        pieces += [
            _strut(plane, x, side * share, heights)
            for share in (0.36, 0.07)
            for side in (-1.0, 1.0)
        ]
    return pieces


def _strut(plane: Airplane, x: float, share: float, heights: tuple[float, ...]) -> Piece:
    """An upright between a biplane's wings."""
    low, high = (0.0 if abs(share) < 0.1 else heights[0]), heights[1]
    ends = np.array([[x, 0.30 * plane.chord, 0.003, low], [x, 0.30 * plane.chord, 0.003, high]])
    strut = fin(ends, True, rgba=plane.trim, density=plane.density)
    return placed(strut, compose(np.eye(3), np.array([0.0, share * plane.span, 0.0])))


def _tail(plane: Airplane) -> list[Piece]:
    x, radius, rise = (float(v) for v in _line(plane, np.array(0.90)))
    chord, swept = 0.52 * plane.chord, 0.30 * plane.sweep + 0.006
    thick = 0.75 * plane.thick
    upright = np.array(
        [[x, 1.2 * chord, thick, rise], [x - swept, 0.66 * chord, thick, rise + radius + plane.fin]]
    )
    pieces = [fin(upright, True, rgba=plane.trim, density=plane.density)]
    for side in (-1.0, 1.0):
        ends = np.array(
            [[x, chord, thick, 0.0], [x - swept, 0.66 * chord, thick, side * plane.tail / 2]]
        )
        half = fin(ends, False, rgba=plane.wings, density=plane.density)
        pieces.append(placed(half, compose(np.eye(3), np.array([0.0, 0.0, rise]))))
    return pieces
