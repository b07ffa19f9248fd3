"""A tall jug with one handle and a pouring lip opposite.

Real sizes: the YCB pitcher is 108 mm wide, 235 mm tall and weighs 178 g without its lid (Calli et al. 2015);
water jugs on sale hold 0.8-2 l, are 85-125 mm wide and 160-250 mm tall, their handles reach out by 40-55 mm.
Plastic and enamel ones weigh 0.15-0.5 kg. Up is X. The handle reaches out farther than the lip, so by the rule of
the bulge it is on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import AreaBox, Piece, rigid_specimen
from asset_pipeline.procedural.revolution import fillet
from asset_pipeline.procedural.shell import revolved_loops, shell_piece
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar
from manipose_mj.poses import SymmetryGroup

POINTS = 48
LEVELS = 14  # rings of the wall between foot and rim
LIP_WIDTH = 0.34  # of the pouring lip about the axis [rad]
LIP_START = 0.66  # of the height, where the wall begins to bend towards the lip


@dataclass(frozen=True)
class Pitcher:
    """Sizes [m] and colours.

    Attributes: foot, belly and rim, outer diameters at the bottom, at 40 % of the height and at the top;
    height; wall; bottom, thickness; corner, radius of the lower edge; lip, reach of the pouring lip; rise,
    of its tip; reach of the handle beyond the wall; grip, its share of the height; square, exponent of its
    superellipse (2 is round); thick and wide, its section; density [kg/m^3]; colour; band, of the uppermost
    part; handle's and inside's colours.
    """

    foot: float = 0.100
    belly: float = 0.108
    rim: float = 0.112
    height: float = 0.225
    wall: float = 0.0028
    bottom: float = 0.004
    corner: float = 0.010
    lip: float = 0.018
    rise: float = 0.006
    reach: float = 0.047
    grip: float = 0.64
    square: float = 2.8
    thick: float = 0.012
    wide: float = 0.022
    density: float = 950.0
    colour: Colour = (0.18, 0.34, 0.62, 1.0)
    band: Colour = (0.18, 0.34, 0.62, 1.0)
    grips: Colour = (0.18, 0.34, 0.62, 1.0)
    inside: Colour = (0.30, 0.46, 0.72, 1.0)

    def radius(self, z: float | Float[np.ndarray, "*n"]) -> float | Float[np.ndarray, "*n"]:
        """Of the outer wall at height `z`: the parabola through foot, belly and rim."""
        t = np.asarray(z) / self.height
        weights = np.stack([(t - 0.4) * (t - 1) / 0.4, t * (1 - t) / 0.24, t * (t - 0.4) / 0.6], -1)
        return weights @ np.array([self.foot, self.belly, self.rim]) / 2


_WHITE: Colour = (0.95, 0.95, 0.93, 1.0)
_STEEL: Colour = (0.80, 0.81, 0.82, 1.0)
# Foot and rim as shares of the belly: a beaker, a bellied jug, a carafe, a cone, a straight one.
_SHAPES = ((0.92, 1.04), (0.84, 0.80), (0.98, 0.74), (1.16, 0.82), (1.0, 1.0))
# Wall, upper band, handle, inside.
_FINISHES: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    (_WHITE, (0.15, 0.27, 0.52, 1.0), (0.15, 0.27, 0.52, 1.0), _WHITE),
    (
        (0.86, 0.33, 0.20, 1.0),
        (0.86, 0.33, 0.20, 1.0),
        (0.86, 0.33, 0.20, 1.0),
        (0.93, 0.50, 0.36, 1.0),
    ),
    (_STEEL, _STEEL, (0.12, 0.12, 0.13, 1.0), (0.86, 0.87, 0.88, 1.0)),
    (
        (0.64, 0.42, 0.28, 1.0),
        (0.90, 0.84, 0.70, 1.0),
        (0.64, 0.42, 0.28, 1.0),
        (0.90, 0.84, 0.70, 1.0),
    ),
    ((0.55, 0.76, 0.72, 1.0), _WHITE, (0.55, 0.76, 0.72, 1.0), _WHITE),
    ((0.95, 0.82, 0.30, 1.0), (0.95, 0.82, 0.30, 1.0), _WHITE, (0.97, 0.90, 0.55, 1.0)),
    (
        (0.28, 0.45, 0.30, 1.0),
        (0.28, 0.45, 0.30, 1.0),
        (0.20, 0.32, 0.22, 1.0),
        (0.92, 0.90, 0.80, 1.0),
    ),
)


def design(index: int) -> Pitcher:
    """The sizes of instance `index`; 0 is like the YCB pitcher."""
    if index == 0:
        return Pitcher()
    rng = specimen_rng("pitcher", index)
    height = rng.uniform(0.165, 0.245)
    belly = rng.uniform(0.094, 0.118) * (0.85 + 0.15 * height / 0.245)
    foot, rim = in_turn(index, _SHAPES)
    wall, band, handle, inside = in_turn(index, _FINISHES)
    return Pitcher(
        foot=round(float(belly * foot), 4),
        belly=round(float(belly), 4),
        rim=round(float(belly * rim), 4),
        height=round(float(height), 4),
        wall=uniform(rng, 0.0024, 0.0034),
        bottom=uniform(rng, 0.0035, 0.0050),
        corner=uniform(rng, 0.006, 0.012),
        lip=uniform(rng, 0.016, 0.024),
        rise=uniform(rng, 0.004, 0.012),
        reach=uniform(rng, 0.043, 0.052),
        grip=round(float(rng.uniform(0.56, 0.70)), 3),
        square=round(float(rng.uniform(2.1, 3.4)), 2),
        thick=uniform(rng, 0.010, 0.013),
        wide=uniform(rng, 0.019, 0.025),
        density=round(float(rng.uniform(950.0, 1500.0)), 0),
        colour=wall,
        band=band,
        grips=handle,
        inside=inside,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: handle along +x."""
    jug = design(index)
    outer = float(jug.radius(0.55 * jug.height))
    half = 0.5 * jug.grip * jug.height
    low = (outer + 0.012, -jug.wide / 2, 0.55 * jug.height - half)
    high = (outer + jug.reach, jug.wide / 2, 0.55 * jug.height + half)
    return rigid_specimen(
        "pitcher",
        [_vessel(jug), _handle(jug)],
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(AreaBox("grip", low, high),),
    )


def _vessel(jug: Pitcher) -> Piece:
    start = jug.foot / 2 - jug.corner - 0.001
    z = np.linspace(0, jug.height - 0.4 * jug.wall, LEVELS)[1:]
    corners = np.concatenate([[[start, 0], [jug.foot / 2, 0]], np.stack([jug.radius(z), z], 1)])
    outer = fillet(corners, {1: min(jug.corner, 0.8 * z[0])}, 5)
    inner = np.stack([outer[:, 0] - jug.wall, np.maximum(outer[:, 1], jug.bottom)], 1)
    inner[0, 0] = start
    lip = 0.4 * jug.wall
    outer = np.concatenate([outer, outer[-1:] + [-lip, lip]])
    inner = np.concatenate([inner, inner[-1:] + [lip, lip]])
    bend = int(np.searchsorted(outer[:, 1], LIP_START * jug.height))
    band = int(np.searchsorted(outer[:, 1], 0.86 * jug.height))
    return shell_piece(
        _lipped(jug, revolved_loops(outer, POINTS)),
        _lipped(jug, revolved_loops(inner, POINTS)),
        cuts=(0, 6, bend, len(outer) - 1),
        wedges=(12, 12, 12),
        colours=((band, jug.colour), (len(outer), jug.band)),
        inside=jug.inside,
        density=jug.density,
        floor=True,
    )


def _lipped(jug: Pitcher, loops: Float[np.ndarray, "l p 3"]) -> Float[np.ndarray, "l p 3"]:
    """The rings with the pouring lip drawn out at -x."""
    angle = np.arctan2(loops[..., 1], -loops[..., 0])
    height = np.clip((loops[..., 2] / jug.height - LIP_START) / (1 - LIP_START), 0, 1)
    share = np.exp(-0.5 * (angle / LIP_WIDTH) ** 2) * height**1.6
    radius = np.linalg.norm(loops[..., :2], axis=-1)
    scale = 1 + jug.lip * share / radius
    return np.concatenate(
        [loops[..., :2] * scale[..., None], (loops[..., 2] + jug.rise * share)[..., None]], axis=-1
    )


def _handle(jug: Pitcher) -> Piece:
    """Half a superellipse standing on the wall, in the xz plane; its roots are in the wall."""
    angles = np.linspace(np.pi / 2, -np.pi / 2, 33)
    half = 0.5 * jug.grip * jug.height - jug.thick / 2
    power = 2 / jug.square
    z = 0.55 * jug.height + half * np.sign(np.sin(angles)) * np.abs(np.sin(angles)) ** power
    out = (jug.reach - jug.thick / 2) * np.clip(np.cos(angles), 0, None) ** power
    out[[0, -1]] = -0.5 * jug.wall
    line = np.column_stack([jug.radius(z) + out, np.zeros_like(z), z])
    section = np.tile([jug.thick / 2, jug.wide / 2], (len(line), 1))
    return bar(line, section, parts=7, rgba=jug.grips, density=jug.density, power=2.6)
