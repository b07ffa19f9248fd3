"""A hammer: claw, ball-peen, cross-peen (locksmith's), and mallets of rubber and of beech.

Typical sizes, from general knowledge and not from a data sheet: a 13 oz claw hammer is 320 mm long,
its head 125 mm from face to claw, the face 27 mm wide; a 300 g locksmith's hammer is 300 mm long
with a head of 105 mm by 23 mm; rubber mallets have heads of 50-65 mm by 85-110 mm. X runs up the
handle; the origin is at the head's underside. Z points to the claw or the peen, which reaches
farther than the face; a mallet's two faces are alike, so half a turn about X is in its group.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece, placed, solid_piece
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from asset_pipeline.procedural.swept import loft_outwards
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import ROUND, handle, loop_hulls, superellipse
from manipose_mj.poses import SymmetryGroup, compose

STEEL, WOOD, RUBBER, FIBRE = 7850.0, 720.0, 1150.0, 1500.0  # [kg/m^3]
EYE = 6600.0  # steel around an eye that the handle, counted on its own, fills [kg/m^3]
FORGED: Colour = (0.30, 0.31, 0.33, 1.0)
BRIGHT: Colour = (0.72, 0.73, 0.75, 1.0)
OTHER_SIDE = compose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # half a turn about the handle

Style = Literal["claw", "ball", "cross", "rubber", "beech"]
Grip = Literal["wood", "sleeve"]
_STYLES: tuple[Style, ...] = ("claw", "ball", "cross", "rubber", "beech")
_WOODS: tuple[Colour, ...] = (
    (0.80, 0.62, 0.40, 1.0),
    (0.72, 0.50, 0.29, 1.0),
    (0.86, 0.72, 0.52, 1.0),
)
_SLEEVES: tuple[tuple[Colour, Colour], ...] = (
    ((0.13, 0.13, 0.14, 1.0), (0.93, 0.72, 0.12, 1.0)),
    ((0.14, 0.25, 0.55, 1.0), (0.74, 0.75, 0.77, 1.0)),
    ((0.15, 0.15, 0.16, 1.0), (0.80, 0.16, 0.12, 1.0)),
    ((0.85, 0.40, 0.10, 1.0), (0.20, 0.20, 0.22, 1.0)),
)
_RUBBERS: tuple[Colour, ...] = ((0.12, 0.12, 0.13, 1.0), (0.90, 0.89, 0.86, 1.0))


@dataclass(frozen=True)
class Hammer:
    """Sizes [m], style and colours.

    Attributes: style of the head; grip, the handle's kind; length of the handle below the head; thick,
    the grip's larger width; scale of the head, 1 is a 13 oz claw, a 12 oz ball-peen, a 300 g
    cross-peen hammer; reach, of a mallet's head to each side; bulk, its width; colours of the grip,
    of the shaft and of the head.
    """

    style: Style = "claw"
    grip: Grip = "wood"
    length: float = 0.285
    thick: float = 0.033
    scale: float = 1.0
    reach: float = 0.048
    bulk: float = 0.058
    hold: Colour = (0.80, 0.62, 0.40, 1.0)
    shaft: Colour = (0.80, 0.62, 0.40, 1.0)
    head: Colour = FORGED


def design(index: int) -> Hammer:
    """The sizes of instance `index`; 0 is a claw hammer with a hickory handle, the styles take turns."""
    if index == 0:
        return Hammer()
    rng = specimen_rng("hammer", index)
    style = _STYLES[mixed(index) % 5]
    grip: Grip = "wood" if style == "beech" or rng.uniform() < 0.5 else "sleeve"
    wood = in_turn(1 + index // 5, _WOODS)
    hold, shaft = (wood, wood) if grip == "wood" else in_turn(1 + index // 5, _SLEEVES)
    steel = FORGED if rng.uniform() < 0.6 else (0.16, 0.17, 0.19, 1.0)
    return Hammer(
        style,
        grip,
        length=uniform(rng, 0.232, 0.295),
        thick=uniform(rng, 0.029, 0.035),
        scale=round(float(rng.uniform(0.82, 1.05)), 3),
        reach=uniform(rng, 0.042, 0.055),
        bulk=uniform(rng, 0.050, 0.062),
        hold=hold,
        shaft=shaft,
        head={
            "rubber": in_turn(1 + index // 5, _RUBBERS),
            "beech": in_turn(2 + index // 5, _WOODS),
        }.get(style, steel),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying on its side: handle along x, head along y."""
    hammer = design(index)
    head, top = _HEADS[hammer.style](hammer)
    return tool_specimen(
        "hammer",
        [*_handle(hammer, top), *head],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.two_planes() if hammer.style in ("rubber", "beech") else None,
    )


def _handle(hammer: Hammer, top: float) -> list[Piece]:
    """From the butt to just above the head's upper side at x = `top` [m]."""
    n, y, z = hammer.length, hammer.thick / 2, 0.36 * hammer.thick
    neck = (0.0115, 0.0090)
    end = (top + 0.0012, 0.0105, 0.0085)
    if hammer.grip == "wood":
        table = [(-n, 0.92 * y, 0.92 * z), (-0.93 * n, y, z), (-0.66 * n, 0.90 * y, 0.95 * z)]
        table += [(-0.30 * n, *neck), (-0.02, *neck), end]
        bands = [(0.0, hammer.hold)]
        return [handle(table, bands, density=WOOD, outline=superellipse(2.4), rounding=(0.006, 0))]
    shaft = [(-0.5 * n, *neck), (0.0, *neck), end]
    table = [(-n, 0.95 * y, z), (-0.93 * n, y, z), (-0.75 * n, 0.88 * y, 0.93 * z)]
    table += [(-0.55 * n, 0.94 * y, z), (-0.40 * n, 0.80 * y, 0.93 * z)]
    bands = [(-0.94 * n, hammer.shaft), (0.0, hammer.hold)]
    return [
        handle(shaft, [(0.0, hammer.shaft)], density=FIBRE, outline=superellipse(2.4)),
        handle(table, bands, density=RUBBER, outline=superellipse(2.6), rounding=(0.006, 0.002)),
    ]


def _claw(hammer: Hammer) -> tuple[list[Piece], float]:
    s, top = hammer.scale, 0.028 * hammer.scale
    # The centre line, in the xy plane: from the eye up and over, and back to the underside's level.
    share = np.linspace(0, 1, 13)[:, None]
    corners = s * np.array([[0.0165, -0.006], [0.0250, -0.048], [0.0030, -0.080]])
    line = (1 - share) ** 2 * corners[0] + 2 * share * (1 - share) * corners[1]
    line = line + share**2 * corners[2]
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    t = share[:, 0]
    thick = s * (0.0090 * (1 - t) ** 1.2 + 0.0011)
    outer = s * (0.0105 + 0.0030 * t)
    inner = s * 0.0062 * np.clip((t - 0.36) / 0.64, 0, 1) ** 0.8
    ring = superellipse(4.0, 16)
    prongs = []
    for side in (-1.0, 1.0):
        across = line[:, None] + (thick[:, None] * ring[:, 0])[..., None] * normal[:, None]
        height = side * ((outer + inner)[:, None] + (outer - inner)[:, None] * ring[:, 1]) / 2
        loops = np.concatenate([across, height[..., None]], axis=2)
        prongs.append(
            solid_piece(loft_outwards(loops), loop_hulls(loops), rgba=hammer.head, density=STEEL)
        )
    face = [(0.006, 0.0115), (0.020, 0.0098), (0.033, 0.0108), (0.039, 0.0138), (0.052, 0.0138)]
    return [_eye(hammer, 0.0135, 0.0130, top), *prongs, _poll(hammer, face, 0.0155)], top


def _ball(hammer: Hammer) -> tuple[list[Piece], float]:
    top = 0.025 * hammer.scale
    face = [(0.006, 0.0110), (0.017, 0.0090), (0.026, 0.0125), (0.042, 0.0125)]
    angle = np.linspace(-0.62, 1.25, 9)
    ball = [(0.044 + 0.0125 * np.sin(a), 0.0125 * np.cos(a)) for a in angle]
    peen = [(0.006, 0.0105), (0.022, 0.0082), *ball]
    pieces = [_eye(hammer, 0.0130, 0.0120, top), _poll(hammer, face, 0.0125)]
    ball_piece = _poll(hammer, peen, 0.0125, end=0.0)
    return [*pieces, placed(ball_piece, OTHER_SIDE)], top


def _cross(hammer: Hammer) -> tuple[list[Piece], float]:
    s, top = hammer.scale, 0.024 * hammer.scale
    # Sections across y: the face's bevel, the body, and the wedge of the peen.
    rows = [(0.043, 0.0105, 0.0105), (0.041, 0.0118, 0.0118), (0.018, 0.0118, 0.0118)]
    rows += [(0.012, 0.0110, 0.0118), (-0.016, 0.0110, 0.0118), (-0.058, 0.0024, 0.0118)]
    rows += [(-0.060, 0.0012, 0.0110)]
    ring = superellipse(7.0, 16)
    loops = s * np.stack(
        [
            np.column_stack([0.0120 + x * ring[:, 0], np.full(16, y), z * ring[:, 1]])
            for y, x, z in rows
        ]
    )
    body = solid_piece(
        loft_outwards(loops), loop_hulls(loops), rgba=hammer.head, density=0.94 * STEEL
    )
    return [body], top


def _rubber(hammer: Hammer) -> tuple[list[Piece], float]:
    radius, reach = hammer.bulk / 2, hammer.reach
    table = [(-reach, radius), (-0.45 * reach, 0.965 * radius), (0.45 * reach, 0.965 * radius)]
    table += [(reach, radius)]
    head = handle(
        [(x, r, r) for x, r in table],
        [(0.0, hammer.head)],
        density=RUBBER,
        rounding=(0.004, 0.004),
    )
    return [placed(head, _sideways(radius))], 2 * radius


def _beech(hammer: Hammer) -> tuple[list[Piece], float]:
    deep, wide, reach = 0.56 * hammer.bulk, 0.40 * hammer.bulk, 1.12 * hammer.reach
    table = [(-reach, deep, wide), (reach, deep, wide)]
    head = handle(
        table,
        [(0.0, hammer.head)],
        density=WOOD,
        outline=superellipse(12.0),
        rounding=(0.003, 0.003),
    )
    return [placed(head, _sideways(deep))], 2 * deep


_HEADS = {"claw": _claw, "ball": _ball, "cross": _cross, "rubber": _rubber, "beech": _beech}


def _eye(hammer: Hammer, half_y: float, half_z: float, top: float) -> Piece:
    """The block around the handle, from the underside to x = `top` [m]."""
    y, z = hammer.scale * half_y, hammer.scale * half_z
    table = [(0.0, y, z), (top, y, z)]
    return handle(
        table,
        [(top, hammer.head)],
        density=EYE,
        outline=superellipse(4.0),
        rounding=(0.0015, 0.002),
    )


def _poll(
    hammer: Hammer, profile: list[tuple[float, float]], height: float, end: float = 0.0015
) -> Piece:
    """A piece of revolution along +y, `(y, r)` at scale 1; the outermost 3 mm are bright."""
    s = hammer.scale
    table = [(s * y, s * r, s * r) for y, r in profile]
    face = handle(
        table,
        [(table[-1][0] - 0.003, hammer.head), (0.0, BRIGHT)],
        density=STEEL,
        outline=ROUND,
        rounding=(0.0, end),
    )
    return placed(face, _sideways(s * height))


def _sideways(height: float) -> Float[np.ndarray, "4 4"]:
    """Moves x to y, at x = `height` [m] above the head's underside."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return compose(turn, np.array([height, 0.0, 0.0]))
