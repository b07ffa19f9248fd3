"""A window squeegee: a T of handle and rubber blade.

Typical sizes, from general knowledge and not from a data sheet: channels are 150-350 mm wide and
12-18 mm deep, with 10-15 mm of rubber standing out, 3 mm thick; handles are 120-150 mm by 25-32 mm;
150-350 g. X runs along the handle towards the blade; the origin is at the back of the clamp. Both
faces are alike and so are both sides: half a turn about X is in its group. Y is across the T's
plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from asset_pipeline.procedural.extruded import panel
from asset_pipeline.procedural.pieces import Piece, placed
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, superellipse
from manipose_mj.poses import SymmetryGroup, compose

METAL, PLASTIC, RUBBER = 2700.0, 1150.0, 1150.0  # [kg/m^3]
HOLLOW = 650.0  # a moulded handle and the air in it, on average [kg/m^3]
BLACK: Colour = (0.13, 0.13, 0.14, 1.0)
STAINLESS: Colour = (0.74, 0.75, 0.77, 1.0)
BRASS: Colour = (0.80, 0.64, 0.30, 1.0)

Style = Literal["clip", "yoke"]
# Handle, clamp and channel.
_COLOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.16, 0.45, 0.30, 1.0), BLACK, STAINLESS),
    ((0.14, 0.14, 0.15, 1.0), (0.85, 0.16, 0.13, 1.0), STAINLESS),
    (BRASS, BRASS, BRASS),
    ((0.16, 0.36, 0.66, 1.0), (0.16, 0.36, 0.66, 1.0), (0.90, 0.90, 0.91, 1.0)),
    ((0.93, 0.60, 0.12, 1.0), BLACK, BLACK),
    ((0.62, 0.43, 0.26, 1.0), STAINLESS, STAINLESS),
    ((0.90, 0.91, 0.92, 1.0), (0.45, 0.68, 0.72, 1.0), (0.45, 0.68, 0.72, 1.0)),
)


@dataclass(frozen=True)
class Squeegee:
    """Sizes [m], style and colours.

    Attributes: style of the clamp, a small block or a fan; width of the channel; grip, the handle's length;
    thick, its diameter; clamp, half the clamp's width; deep, the clamp's length; channel, half its
    thickness; rubber, how far it stands out; handle, holder and rail, colours.
    """

    style: Style = "clip"
    width: float = 0.250
    grip: float = 0.135
    thick: float = 0.029
    clamp: float = 0.032
    deep: float = 0.020
    channel: float = 0.0060
    rubber: float = 0.014
    handle: Colour = (0.14, 0.14, 0.15, 1.0)
    holder: Colour = (0.55, 0.56, 0.58, 1.0)
    rail: Colour = STAINLESS


def design(index: int) -> Squeegee:
    """The sizes of instance `index`; 0 is a window cleaner's of 25 cm."""
    if index == 0:
        return Squeegee()
    rng = specimen_rng("squeegee", index)
    style: Style = "yoke" if index % 2 else "clip"
    width = rng.uniform(0.205, 0.340)
    colour, holder, rail = in_turn(index, _COLOURS)
    return Squeegee(
        style,
        width=round(float(width), 4),
        grip=uniform(rng, 0.115, 0.150),
        thick=uniform(rng, 0.025, 0.031),
        clamp=round(
            float(
                width * rng.uniform(0.22, 0.32) if style == "yoke" else rng.uniform(0.026, 0.036)
            ),
            4,
        ),
        deep=round(
            float(rng.uniform(0.026, 0.038) if style == "yoke" else rng.uniform(0.016, 0.022)), 4
        ),
        channel=uniform(rng, 0.0052, 0.0068),
        rubber=uniform(rng, 0.010, 0.015),
        handle=colour,
        holder=holder,
        rail=rail,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying flat, its handle along x and the blade along y."""
    squeegee = design(index)
    return tool_specimen(
        "squeegee",
        [_handle(squeegee), _clamp(squeegee), *_blade(squeegee)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
        symmetry=SymmetryGroup.two_planes(),
    )


def _handle(squeegee: Squeegee) -> Piece:
    """A round grip with three rings to hold it by, thinner before the clamp."""
    n, r = squeegee.grip, squeegee.thick / 2
    shares = [(-1.0, 0.86), (-0.92, 0.98), (-0.72, 1.0)]
    for ring in (-0.66, -0.58, -0.50):
        shares += [(ring, 0.955), (ring + 0.04, 0.985)]
    shares += [(-0.30, 0.86), (-0.12, 0.74), (0.0, 0.74)]
    table = [(share * n, radius * r, 0.94 * radius * r) for share, radius in shares]
    bands = [(-0.93 * n, squeegee.holder), (0.002, squeegee.handle)]
    return handle(table, bands, density=HOLLOW, rounding=(0.006, 0.0))


def _clamp(squeegee: Squeegee) -> Piece:
    half, deep, z = squeegee.clamp, squeegee.deep, squeegee.channel + 0.0022
    if squeegee.style == "clip":
        outline = shapely.box(0.0, -half, deep, half).buffer(-0.004).buffer(0.004, quad_segs=3)
    else:
        neck = 0.68 * squeegee.thick
        outline = shapely.Polygon(
            [(0.0, -neck), (0.0, neck), (0.35 * deep, 1.1 * neck), (deep, half)]
            + [(deep, -half), (0.35 * deep, -1.1 * neck)]
        )
    assert isinstance(outline, shapely.Polygon)
    return panel(outline, -z, z, rgba=squeegee.holder, density=PLASTIC)


def _blade(squeegee: Squeegee) -> list[Piece]:
    """The rail and the rubber in it, which is a little wider."""
    start, half, z = squeegee.deep - 0.006, squeegee.width / 2, squeegee.channel
    rail = handle(
        [(-half + 0.002, 0.0065, z), (half - 0.002, 0.0065, z)],
        [(half, squeegee.rail)],
        density=0.55 * METAL,  # a folded profile
        outline=superellipse(4.0),
        rounding=(0.001, 0.001),
    )
    sideways = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rail = placed(rail, compose(sideways, np.array([start + 0.0065, 0.0, 0.0])))
    front = start + 0.013
    rubber = panel(
        shapely.box(front - 0.004, -half, front + squeegee.rubber, half),
        -0.0015,
        0.0015,
        rgba=BLACK,
        density=RUBBER,
    )
    return [rail, rubber]
