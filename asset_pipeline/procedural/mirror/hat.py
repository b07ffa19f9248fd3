"""A baseball cap, or a hat whose brim is longer in front: fedora, bucket hat, sun hat.

Real sizes: heads of 54-62 cm round are 180-205 mm long and 145-165 mm wide; a cap's crown is 100-115 mm tall
and its peak 65-75 mm long; brims of hats are 45-85 mm wide. They weigh 60-130 g; cloth, felt and straw are taken as
3 mm of rigid sheet. Up is X; the brim's front reaches out farthest, so by the rule of the bulge it is on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen
from asset_pipeline.procedural.sheet import sheet
from asset_pipeline.procedural.shell import offset_loops, painted, shell_piece
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, mixed, specimen_rng
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose

POINTS = 48
THICKNESS = 0.003  # [m]
CROWN_RINGS = 13
SHOULDER_RINGS = 7
CUTS = (0, 4, 8, CROWN_RINGS - 1)
BRIM_RINGS = 5
CAP_EDGE = np.deg2rad(68.0)  # where a cap's peak ends, from the front
Style = Literal["cap", "fedora", "bucket", "sun"]


@dataclass(frozen=True)
class Hat:
    """Sizes [m] and colours.

    Attributes: style; length and width of the crown at its lower edge; height of the crown; power of its
    superellipse (2 is round, more is boxy); taper, share by which it is narrower at the top; pinch, by which
    its upper half is pressed together from both sides; front, side and
    back, width of the brim; droop, its slope at the sides (down is
    positive); curve, by how much a cap's sides hang and a brim's are turned up; density
    [kg/m^3]; colour; brim's colour; accent, of ribbon, button and front panels.
    """

    style: Style = "cap"
    length: float = 0.190
    width: float = 0.158
    height: float = 0.104
    power: float = 2.7
    taper: float = 0.0
    pinch: float = 0.0
    front: float = 0.072
    side: float = 0.0
    back: float = 0.0
    droop: float = 0.0
    curve: float = 0.008
    density: float = 480.0
    colour: Colour = (0.13, 0.22, 0.44, 1.0)
    brim: Colour = (0.72, 0.12, 0.12, 1.0)
    accent: Colour = (0.72, 0.12, 0.12, 1.0)

    def base(self, angle: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 2"]:
        """The crown's lower edge, seen from above."""
        return np.stack([self.length / 2 * np.cos(angle), self.width / 2 * np.sin(angle)], -1)


_CLOTH: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.14, 0.14, 0.15, 1.0), (0.14, 0.14, 0.15, 1.0), (0.90, 0.90, 0.90, 1.0)),
    ((0.78, 0.70, 0.55, 1.0), (0.66, 0.57, 0.42, 1.0), (0.30, 0.20, 0.13, 1.0)),
    ((0.20, 0.38, 0.24, 1.0), (0.16, 0.30, 0.19, 1.0), (0.86, 0.80, 0.58, 1.0)),
    ((0.88, 0.86, 0.80, 1.0), (0.16, 0.28, 0.52, 1.0), (0.16, 0.28, 0.52, 1.0)),
    ((0.42, 0.26, 0.17, 1.0), (0.42, 0.26, 0.17, 1.0), (0.13, 0.10, 0.08, 1.0)),
    ((0.80, 0.28, 0.16, 1.0), (0.66, 0.20, 0.12, 1.0), (0.96, 0.93, 0.86, 1.0)),
    ((0.46, 0.49, 0.53, 1.0), (0.28, 0.30, 0.34, 1.0), (0.20, 0.21, 0.24, 1.0)),
)
_STYLES: tuple[Style, ...] = ("fedora", "cap", "bucket", "cap", "sun")


def design(index: int) -> Hat:
    """The sizes of instance `index`; 0 is a baseball cap, the styles take turns after it."""
    if index == 0:
        return Hat()
    rng = specimen_rng("hat", index)
    style: Style = in_turn(mixed(index), _STYLES)
    # Height, power, taper, pinch; front, side, back, droop and curve of the brim.
    low, high = {
        "cap": (
            (0.096, 2.5, 0, 0, 0.064, 0, 0, 0.0, 0.005),
            (0.110, 3.0, 0, 0, 0.076, 0, 0, 0.01, 0.010),
        ),
        "fedora": (
            (0.104, 7.0, 0.0, 0.55, 0.078, 0.044, 0.028, 0.0, 0.002),
            (0.122, 9.0, 0.0, 0.60, 0.090, 0.052, 0.034, 0.03, 0.012),
        ),
        "bucket": (
            (0.085, 5.5, 0.12, 0.0, 0.072, 0.036, 0.024, 0.45, 0.0),
            (0.100, 7.0, 0.20, 0.0, 0.082, 0.042, 0.028, 0.65, 0.0),
        ),
        "sun": (
            (0.098, 6.5, 0.0, 0.56, 0.090, 0.056, 0.030, 0.0, 0.0),
            (0.114, 8.0, 0.0, 0.61, 0.100, 0.064, 0.036, 0.03, 0.006),
        ),
    }[style]
    height, power, taper, pinch, front, side, back, droop, curve = (
        round(float(value), 4) for value in rng.uniform(low, high)
    )
    colour, brim, accent = in_turn(index, _CLOTH)
    length = rng.uniform(0.180, 0.202)
    return Hat(
        style=style,
        length=round(float(length), 4),
        width=round(float(length * rng.uniform(0.80, 0.86)), 4),
        height=height,
        power=power,
        taper=taper,
        pinch=pinch,
        front=front,
        side=side,
        back=back,
        droop=droop,
        curve=curve,
        density=round(float(rng.uniform(380.0, 520.0)), 0),
        colour=colour,
        brim=brim,
        accent=accent,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: front along +x, the crown's lower edge at z = 0."""
    hat = design(index)
    pieces = [_crown(hat)] + ([_peak(hat), _button(hat)] if hat.style == "cap" else [])
    crest = (1 - hat.pinch) * hat.width / 2
    low = (-0.3 * hat.length, -crest, 0.6 * hat.height)
    return rigid_specimen(
        "hat",
        pieces,
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(AreaBox("grip", low, (0.3 * hat.length, crest, hat.height)),),
    )


def _crown(hat: Hat) -> Piece:
    """The crown, and the brim of what has one all around, as one shell."""
    angle = np.arange(POINTS) * (2 * np.pi / POINTS)
    shoulder = np.cos(np.linspace(0, np.pi / 4, SHOULDER_RINGS)) ** (2 / hat.power)
    sides = np.linspace(shoulder[-1], 0, CROWN_RINGS - SHOULDER_RINGS + 1)[1:]
    level = np.concatenate([shoulder, sides])
    radius = np.maximum((1 - level**hat.power) ** (1 / hat.power), 0.006)  # no point at the top
    plan = (radius * (1 - hat.taper * level))[:, None, None] * hat.base(angle)
    # The pinch by which such hats are taken: a ridge above straight flanks.
    flank = np.clip(level / level[CUTS[2]], 0, 1)[:, None] * (1 + 0.1 * np.cos(angle))
    plan[..., 1] *= 1 - hat.pinch * flank
    z = hat.height * level
    rings = np.concatenate([plan, np.broadcast_to(z[:, None, None], (len(z), POINTS, 1))], axis=-1)
    crown = CROWN_RINGS - 1
    cuts, wedges = [*CUTS], [8, 12, 12]
    if hat.style != "cap":
        rings = np.concatenate([rings, _brim(hat, angle)])
        cuts, wedges = [*cuts, crown + BRIM_RINGS], [*wedges, 16]
    inner = offset_loops(rings, THICKNESS)
    if hat.style == "cap":
        inner[-1, :, 2] = 0.0
        bands = ((crown, hat.colour),)
    else:
        ribbon = int(np.argmin(np.abs(z - 0.030)))
        bands = ((ribbon, hat.colour), (crown, hat.accent), (crown + BRIM_RINGS, hat.brim))
    piece = shell_piece(
        rings, inner, cuts=cuts, wedges=wedges, colours=bands, inside=hat.brim, density=hat.density
    )
    if hat.style != "cap" or hat.accent[0] < 0.85:
        return piece
    return Piece(
        (*_front_panels(hat, piece.visual[0]), *piece.visual[1:]), piece.collision, piece.mass
    )


def _front_panels(hat: Hat, shape: Shape) -> tuple[Shape, ...]:
    """The outside of a trucker's cap: light front panels."""
    assert shape.mesh is not None
    x, y, _ = shape.mesh.triangles_center.T
    light: Colour = (0.92, 0.92, 0.90, 1.0)
    angle = np.arctan2(y / hat.width, x / hat.length)
    return painted(shape.mesh, np.abs(angle) < np.pi / 3, light, shape.rgba)


def _brim(hat: Hat, angle: Float[np.ndarray, "p"]) -> Float[np.ndarray, "rings p 3"]:
    """Rings from the crown outwards; the width runs smoothly from front to side to back."""
    ahead, behind = np.clip(np.cos(angle), 0, 1) ** 2, np.clip(-np.cos(angle), 0, 1) ** 2
    width = hat.side + (hat.front - hat.side) * ahead + (hat.back - hat.side) * behind
    out = np.linspace(0, 1, BRIM_RINGS + 1)[1:, None] * width
    base = hat.base(angle)
    outwards = base / np.linalg.norm(base, axis=1, keepdims=True)
    share = out / width
    z = -hat.droop * hat.side * share + hat.curve * np.sin(angle) ** 2 * share**2
    return np.concatenate([base + out[..., None] * outwards, z[..., None]], axis=-1)


def _peak(hat: Hat) -> Piece:
    """A cap's peak: bent about its middle, its root under the crown's front."""
    angle = np.linspace(-CAP_EDGE, CAP_EDGE, 25)
    share = np.linspace(0, 1, 6)
    root = hat.base(angle) * (1 - THICKNESS / hat.length)
    reach = hat.front * np.cos(angle * (np.pi / 2 / CAP_EDGE)).clip(0.02) ** 0.62
    x = root[:, :1] + share * reach[:, None]
    y = root[:, 1:] * (1 - 0.05 * share)
    bend = hat.curve * (root[:, 1:] / (hat.width / 2)) ** 2
    z = 0.001 - hat.droop * share * reach[:, None] - bend * share**0.7
    z += 0.0006 + THICKNESS / 2 - z.min()  # the cap stands on its crown
    thickness = np.full(x.shape, THICKNESS)
    cuts = ((0, 4, 1), (4, 8, 1), (8, 12, 1), (12, 16, 1), (16, 20, 1), (20, 24, 1))
    return sheet(np.stack([x, y, z], -1), thickness, cuts=cuts, rgba=hat.brim, density=hat.density)


def _button(hat: Hat) -> Piece:
    """The button on a cap's top."""
    profile = np.array(
        [[0, -0.001], [0.0075, -0.001], [0.0075, 0.0015], [0.005, 0.0035], [0, 0.004]]
    )
    button = turned(
        profile,
        (-0.001, 0.0015, 0.004),
        bands=((1.0, hat.accent),),
        density=hat.density,
        sections=24,
    )
    return placed(button, compose(np.eye(3), np.array([0.0, 0.0, hat.height])))
