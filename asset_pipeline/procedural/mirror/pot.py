"""A cooking pot with two side handles, without its lid.

Real sizes: stock pots and casseroles on sale are 16, 18, 20 and 24 cm wide inside and 7.5-14 cm tall
(DIN 44904's series of diameters); side handles reach out by 3-5 cm and are 7-11 cm long. An aluminium pot of 20 cm
weighs about 0.6 kg, one of 24 cm 0.9 kg. Up is X; the handles lie along Y, half a turn maps the pot onto itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from asset_pipeline.procedural.pieces import (
    AreaBox,
    Piece,
    placed,
    rigid_specimen,
    solid_piece,
)
from asset_pipeline.procedural.revolution import fillet
from asset_pipeline.procedural.shell import revolved_loops, shell_piece
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar_loops, convex_chunks, loft_outwards
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

POINTS = 64
WEDGES = 16
HANDLE_DENSITY = 1400.0  # phenolic resin, or hollow steel [kg/m^3]


@dataclass(frozen=True)
class Pot:
    """Sizes [m] and colours.

    Attributes: width, outer, at the rim; taper, by how much the foot is narrower; height; wall; bottom,
    thickness; corner, radius of the lower edge; flange, by how much the rim turns out; handle, a strap or a
    bar; reach of the handles beyond the wall; span, their length along the wall; level, their height as a
    share of the pot's; density of the wall [kg/m^3], for its real thickness; wall's, inside's and
    handles' colours.
    """

    width: float = 0.200
    taper: float = 0.0
    height: float = 0.105
    wall: float = 0.0022
    bottom: float = 0.004
    corner: float = 0.012
    flange: float = 0.003
    handle: Literal["strap", "bar"] = "strap"
    reach: float = 0.040
    span: float = 0.100
    level: float = 0.78
    density: float = 2300.0
    colour: Colour = (0.74, 0.75, 0.77, 1.0)
    inside: Colour = (0.82, 0.83, 0.84, 1.0)
    grips: Colour = (0.13, 0.13, 0.14, 1.0)


_STEEL: Colour = (0.78, 0.79, 0.80, 1.0)
_BLACK: Colour = (0.14, 0.14, 0.15, 1.0)
_CREAM: Colour = (0.93, 0.90, 0.82, 1.0)
# Wall, inside, handles.
_FINISHES: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.72, 0.13, 0.11, 1.0), _CREAM, (0.72, 0.13, 0.11, 1.0)),
    ((0.22, 0.23, 0.25, 1.0), (0.30, 0.30, 0.31, 1.0), _BLACK),
    (_STEEL, (0.84, 0.85, 0.86, 1.0), _STEEL),
    ((0.16, 0.32, 0.52, 1.0), (0.92, 0.93, 0.94, 1.0), (0.16, 0.32, 0.52, 1.0)),
    ((0.76, 0.44, 0.28, 1.0), (0.80, 0.80, 0.80, 1.0), (0.62, 0.50, 0.24, 1.0)),
    (_CREAM, (0.95, 0.94, 0.90, 1.0), (0.55, 0.36, 0.20, 1.0)),
    ((0.36, 0.52, 0.40, 1.0), _CREAM, _BLACK),
)


def design(index: int) -> Pot:
    """The sizes of instance `index`; 0 is an aluminium pot of 20 cm."""
    if index == 0:
        return Pot()
    rng = specimen_rng("pot", index)
    width = rng.uniform(0.140, 0.225)
    height = width * rng.uniform(0.42, 0.62)
    colour, inside, grips = in_turn(index, _FINISHES)
    return Pot(
        width=round(float(width), 4),
        taper=round(float(rng.choice((0.0, 0.0, 0.012, 0.024))), 4),
        height=round(float(height), 4),
        wall=uniform(rng, 0.0020, 0.0028),
        bottom=uniform(rng, 0.0035, 0.0050),
        corner=uniform(rng, 0.006, 0.013),
        flange=round(float(rng.choice((0.0012, 0.003, 0.005))), 4),
        handle="bar" if index % 2 else "strap",
        reach=uniform(rng, 0.036, 0.046),
        span=round(float(width * rng.uniform(0.46, 0.56)), 4),
        level=round(float(rng.uniform(0.68, 0.82)), 3),
        density=round(float(rng.uniform(1700.0, 2300.0)), 0),
        colour=colour,
        inside=inside,
        grips=grips,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: handles along x."""
    pot = design(index)
    handle = _handle(pot)
    half_turn = compose(rotation_about(np.array([0.0, 0.0, 1.0]), np.pi), np.zeros(3))
    middle = pot.level * pot.height
    low = np.array([pot.width / 2 + 0.012, -pot.span / 2, middle - 0.012])
    high = np.array([_wall(pot) + pot.reach, pot.span / 2, middle + 0.012])
    turned = np.array([-1.0, -1.0, 1.0])
    return rigid_specimen(
        "pot",
        [_vessel(pot), handle, placed(handle, half_turn)],
        object_type="mirror",
        symmetry=SymmetryGroup.two_planes(),
        areas=(AreaBox("grip", low, high), AreaBox("grip", low * turned, high * turned)),
    )


def _vessel(pot: Pot) -> Piece:
    rim, foot = pot.width / 2, (pot.width - pot.taper) / 2
    brim, lip = rim + pot.flange, 0.4 * pot.wall
    top = pot.height - pot.wall
    corners = np.array(
        [[foot - pot.corner - 0.001, 0], [foot, 0], [rim, top - 0.006]]
        + [[brim, top], [brim - lip, pot.height]]
    )
    outer = fillet(corners, {1: pot.corner}, 6)
    inner = outer - [pot.wall, 0.0]
    inner[:, 1] = np.maximum(inner[:, 1], pot.bottom)
    inner[0] = [foot - pot.corner - 0.001, pot.bottom]
    inner[-1] += [2 * lip, 0.0]
    return shell_piece(
        revolved_loops(outer, POINTS),
        revolved_loops(inner, POINTS),
        cuts=(0, 7, len(outer) - 1),
        wedges=(WEDGES, WEDGES),
        colours=((len(outer), pot.colour),),
        inside=pot.inside,
        density=pot.density,
        floor=True,
    )


def _wall(pot: Pot) -> float:
    """The outer radius where the handles are."""
    return (pot.width - pot.taper * (1 - pot.level)) / 2


def _handle(pot: Pot) -> Piece:
    """The one at +x: half a superellipse in a horizontal plane, both ends in the wall."""
    angles = np.linspace(np.pi / 2, -np.pi / 2, 29)
    z = pot.level * pot.height
    wall = _wall(pot)
    thick, tall = (0.0055, 0.0125) if pot.handle == "strap" else (0.0065, 0.0080)
    half = pot.span / 2 - thick
    power = 2 / (3.4 if pot.handle == "strap" else 2.6)
    y = half * np.sign(np.sin(angles)) * np.abs(np.sin(angles)) ** power
    root = np.sqrt(wall**2 - half**2) - 0.4 * pot.wall
    x = root + (wall + pot.reach - thick - root) * np.clip(np.cos(angles), 0, None) ** power
    loops = bar_loops(
        np.column_stack([x, y, np.full_like(y, z)]),
        np.tile([thick, tall], (len(x), 1)),
        sideways=(0.0, 0.0, 1.0),
        power=3.5 if pot.handle == "strap" else 2.0,
    )
    for end in (0, -1):  # cut off inside the wall
        loops[end, :, 0] = np.sqrt((wall - 0.5 * pot.wall) ** 2 - loops[end, :, 1] ** 2)
    mesh = loft_outwards(loops)
    return solid_piece(mesh, convex_chunks(loops, 7), rgba=pot.grips, density=HANDLE_DENSITY)
