"""A teapot with its lid on: spout and handle on opposite sides, a knob on top.

Real sizes: the Brown Betty for two cups (0.6 l) is 115 mm wide without spout and handle and 125 mm tall with its knob;
pots on sale hold 0.35-1.1 l, are 95-135 mm wide and 100-160 mm tall, their spouts reach out by 45-65 mm, their handles by
30-42 mm, and weigh 0.35-0.8 kg. Up is X. The spout reaches out farther than the handle, so by the rule of the bulge it
is on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import AreaBox, Piece, rigid_specimen
from asset_pipeline.procedural.revolution import revolved_mass
from asset_pipeline.procedural.solids import loft
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar, bar_loops
from asset_pipeline.procedural.turned import banded, stacked_parts
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

WALL = 0.0035  # [m]
EDGE = 1e-4  # height of a step of the outline, which never runs level [m]
KNOB_HEIGHT = 0.021  # [m]
DARK: Colour = (0.08, 0.06, 0.05, 1.0)


@dataclass(frozen=True)
class Teapot:
    """Sizes [m] and colours.

    Attributes: width of the body; height to the lid's rim; power of the body's superellipse (2 is round);
    foot and mouth, radii at the bottom and under the lid as shares of the largest; low, above 1 lowers the
    belly; dome, height of the lid; knob, its radius; spout, its reach beyond the body; handle, its reach;
    square, exponent of the handle's superellipse; density of the wall [kg/m^3]; colour; lid's and
    handle's colours.
    """

    width: float = 0.118
    height: float = 0.088
    power: float = 2.2
    foot: float = 0.66
    mouth: float = 0.58
    low: float = 1.0
    dome: float = 0.013
    knob: float = 0.0115
    spout: float = 0.056
    handle: float = 0.036
    square: float = 2.3
    density: float = 2200.0
    colour: Colour = (0.36, 0.18, 0.10, 1.0)
    lid: Colour = (0.36, 0.18, 0.10, 1.0)
    grips: Colour = (0.36, 0.18, 0.10, 1.0)

    def outline(self, u: float | Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 2"]:
        """Points `(r, z)` of the body's outside from the foot, `u = 0`, to the mouth, `u = 1`."""
        ends = [-((1 - self.foot**self.power) ** (1 / self.power))]
        ends.append((1 - self.mouth**self.power) ** (1 / self.power))
        s = ends[0] + u * (ends[1] - ends[0])
        r = self.width / 2 * (1 - np.abs(s) ** self.power) ** (1 / self.power)
        return np.stack([r, self.height * u**self.low], axis=-1)

    def radius(self, z: float | Float[np.ndarray, "*n"]) -> float | Float[np.ndarray, "*n"]:
        """Of the body at height `z`."""
        return self.outline((np.asarray(z) / self.height) ** (1 / self.low))[..., 0]


_WHITE: Colour = (0.95, 0.94, 0.92, 1.0)
_STEEL: Colour = (0.79, 0.80, 0.82, 1.0)
# Body, lid, handle.
_GLAZES: tuple[tuple[Colour, Colour, Colour], ...] = (
    (_WHITE, (0.20, 0.32, 0.60, 1.0), _WHITE),
    ((0.20, 0.42, 0.40, 1.0), (0.20, 0.42, 0.40, 1.0), (0.20, 0.42, 0.40, 1.0)),
    (_STEEL, _STEEL, (0.12, 0.12, 0.13, 1.0)),
    ((0.84, 0.36, 0.30, 1.0), (0.84, 0.36, 0.30, 1.0), _WHITE),
    ((0.17, 0.17, 0.19, 1.0), (0.17, 0.17, 0.19, 1.0), (0.50, 0.36, 0.20, 1.0)),
    ((0.93, 0.80, 0.42, 1.0), _WHITE, (0.93, 0.80, 0.42, 1.0)),
    ((0.60, 0.72, 0.84, 1.0), (0.60, 0.72, 0.84, 1.0), (0.60, 0.72, 0.84, 1.0)),
)
# Height over width, power, foot, mouth, lowering: round, squat, tall, pear-shaped, drum.
_SHAPES = (
    (0.78, 2.2, 0.66, 0.56, 1.0),
    (0.62, 2.4, 0.70, 0.55, 1.0),
    (0.95, 3.2, 0.74, 0.62, 1.0),
    (0.86, 2.1, 0.72, 0.44, 1.15),
    (0.72, 4.5, 0.80, 0.66, 1.0),
)


def design(index: int) -> Teapot:
    """The sizes of instance `index`; 0 is a Brown Betty."""
    if index == 0:
        return Teapot()
    rng = specimen_rng("teapot", index)
    tall, power, foot, mouth, low = in_turn(index, _SHAPES)
    width = rng.uniform(0.096, 0.130)
    colour, lid, grips = in_turn(index, _GLAZES)
    return Teapot(
        width=round(float(width), 4),
        height=round(float(width * tall * rng.uniform(0.94, 1.06)), 4),
        power=round(float(power * rng.uniform(0.95, 1.05)), 2),
        foot=foot,
        mouth=mouth,
        low=low,
        dome=uniform(rng, 0.008, 0.018),
        knob=uniform(rng, 0.010, 0.0135),
        spout=uniform(rng, 0.052, 0.064),
        handle=uniform(rng, 0.031, 0.038),
        square=round(float(rng.uniform(2.0, 3.2)), 2),
        density=round(float(rng.uniform(1900.0, 2300.0)), 0),
        colour=colour,
        lid=lid,
        grips=grips,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: spout along +x."""
    pot = design(index)
    reach = pot.width / 2 + pot.handle
    top = pot.height + pot.dome + KNOB_HEIGHT
    return rigid_specimen(
        "teapot",
        [_body(pot), _spout(pot), _handle(pot)],
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(
            AreaBox(
                "grip",
                (-reach, -0.007, 0.32 * pot.height),
                (-reach + 0.010, 0.007, 0.86 * pot.height),
            ),
            AreaBox("grip", (-pot.knob, -pot.knob, top - 0.016), (pot.knob, pot.knob, top)),
        ),
    )


def _body(pot: Teapot) -> Piece:
    """Body, lid and knob, hollow but shut."""
    body = pot.outline(np.linspace(0, 1, 21))
    mouth, lid = body[-1, 0], pot.height + 3 * EDGE
    t = np.linspace(0, 1, 7)
    dome = [
        0.006 + (mouth - 0.0075) * np.cos(t * np.pi / 2),
        lid + pot.dome * np.sin(t * np.pi / 2),
    ]
    # The knob's outline from its neck, as shares of its radius and height.
    shares = np.array([[0.5, 0.12], [0.5, 0.2], [0.86, 0.38], [1, 0.56], [0.95, 0.76], [0.7, 0.92]])
    knob = shares * [pot.knob, KNOB_HEIGHT] + [0, lid + pot.dome]
    profile = np.concatenate(
        [
            [[0, 0], [body[0, 0] - 0.001, 0]],
            body + [0, EDGE],
            [[mouth - 0.0012, pot.height + 2 * EDGE]],
            np.stack(dome, axis=1),
            knob,
            [[0, lid + pot.dome + KNOB_HEIGHT]],
        ]
    )
    hollow = np.concatenate([body[::-1] - [WALL, 0], [[body[0, 0] - WALL, 0]]])
    hollow[:, 1] = np.clip(hollow[:, 1], WALL, pot.height - WALL)
    hollow = np.concatenate([[[0, pot.height - WALL]], hollow, [[0, WALL]]])
    levels = [*np.interp(np.arange(0, 21, 3), np.arange(21), body[:, 1]), pot.height + EDGE]
    levels = [2 * EDGE, *levels[1:-1], lid + EDGE, lid + 0.6 * pot.dome, lid + pot.dome]
    levels += [*knob[[1, 3, 4, 5], 1], profile[-1, 1]]
    bands = ((pot.height + EDGE, pot.colour), (np.inf, pot.lid))
    return Piece(
        banded(profile, bands, 56),
        stacked_parts(profile, levels),
        revolved_mass(np.concatenate([profile, hollow]), pot.density),
    )


def _spout(pot: Teapot) -> Piece:
    """A tapering tube along a parabola, with a dark opening at its end."""
    root = 0.42 * pot.height
    start = np.array([pot.radius(root) - 0.006, root])
    tip = np.array([pot.width / 2 + pot.spout, 0.98 * pot.height])
    bend = np.array([pot.width / 2 + 0.60 * pot.spout, 0.42 * pot.height])
    t = np.linspace(0, 1, 19)[:, None]
    curve = (1 - t) ** 2 * start + 2 * t * (1 - t) * bend + t**2 * tip
    line = np.column_stack([curve[:, 0], np.zeros(len(curve)), curve[:, 1]])
    radius = 0.0075 + 0.0085 * (1 - t) ** 1.6
    half = np.repeat(radius, 2, axis=1)
    # Of pottery, but hollow: a third of its volume.
    tube = bar(line, half, parts=5, rgba=pot.colour, density=0.35 * pot.density)
    rings = bar_loops(line[-2:], half[-2:])
    out = line[-1] - line[-2]
    rim = line[-1] + 0.72 * (rings[-1] - line[-1])
    lifted = rim + 0.0003 * out / np.linalg.norm(out)
    hole = loft(np.stack([rim, lifted]), caps=(False, True))
    if hole.face_normals[-1] @ out < 0:
        hole.invert()
    return Piece((*tube.visual, Shape("mesh", mesh=hole, rgba=DARK)), tube.collision, tube.mass)


def _handle(pot: Teapot) -> Piece:
    """Half a superellipse standing on the body at -x, its roots in the wall."""
    angles = np.linspace(np.pi / 2, -np.pi / 2, 33)
    power = 2 / pot.square
    z = pot.height * (0.59 + 0.27 * np.sign(np.sin(angles)) * np.abs(np.sin(angles)) ** power)
    out = (pot.handle - 0.005) * np.clip(np.cos(angles), 0, None) ** power
    out[[0, -1]] = -WALL
    middle, round_share = pot.width / 2, np.clip(out / pot.handle * 2, 0, 1)
    radius = pot.radius(z) * (1 - round_share) + middle * round_share
    line = np.column_stack([-radius - out, np.zeros_like(z), z])
    section = np.tile([0.005, 0.0068], (len(line), 1))
    return bar(line, section, parts=7, rgba=pot.grips, density=pot.density)
