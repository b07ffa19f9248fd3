"""A knife: chef's, santoku, paring, bread and table knives.

Typical sizes, from general knowledge and not from a data sheet: a 180 mm chef's knife is 310 mm
long with a blade 44 mm high and 2.3 mm thick; a paring knife 195 mm with a blade of 90 mm by 21 mm;
a table knife 215-235 mm, all steel. X runs from the handle to the point; the origin is at the
blade's heel, the handle's end. Z points to the edge, which lies lower than the handle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

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
from asset_pipeline.procedural.tool_handles import handle, loop_hulls, superellipse
from manipose_mj.poses import compose

STEEL, WOOD, PLASTIC = 7800.0, 850.0, 1250.0  # [kg/m^3]
BLADE: Colour = (0.80, 0.81, 0.83, 1.0)
BOLSTER: Colour = (0.62, 0.63, 0.65, 1.0)
RIVET: Colour = (0.78, 0.70, 0.48, 1.0)
EDGE = 0.0005  # thickness of the edge [m]
SUNK = 0.008  # of the blade in the handle [m]
TEETH = 5e-3  # from tooth to tooth of a bread knife [m]

Style = Literal["chef", "santoku", "paring", "bread", "table"]
_STYLES: tuple[Style, ...] = ("chef", "paring", "table", "santoku", "bread")


@dataclass(frozen=True)
class _Kind:
    """Ranges of sizes [m] and the blade's outline.

    Attributes: handle and blade, lengths; high, the blade's height; thick, of its spine; half, the
    handle's half width as seen from the side; spine and edge, rows of the share along the
    blade and the depth below the spine's line as a share of the height.
    """

    handle: tuple[float, float]
    blade: tuple[float, float]
    high: tuple[float, float]
    thick: float
    half: tuple[float, float]
    spine: tuple[tuple[float, float], ...]
    edge: tuple[tuple[float, float], ...]


_KINDS: dict[Style, _Kind] = {
    "chef": _Kind(
        (0.112, 0.130), (0.150, 0.200), (0.038, 0.047), 0.0023, (0.0110, 0.0130),
        ((0.0, 0.0), (0.4, 0.02), (0.75, 0.18), (1.0, 0.55)),
        ((0.0, 1.0), (0.35, 1.0), (0.65, 0.93), (0.88, 0.76), (1.0, 0.58)),
    ),
    "santoku": _Kind(
        (0.110, 0.128), (0.135, 0.175), (0.040, 0.047), 0.0020, (0.0110, 0.0130),
        ((0.0, 0.0), (0.75, 0.0), (0.92, 0.25), (1.0, 0.84)),
        ((0.0, 1.0), (0.6, 1.0), (0.9, 0.95), (1.0, 0.88)),
    ),
    "paring": _Kind(
        (0.092, 0.108), (0.088, 0.112), (0.0215, 0.0250), 0.0020, (0.0080, 0.0092),
        ((0.0, 0.0), (0.5, 0.02), (0.8, 0.18), (1.0, 0.55)),
        ((0.0, 1.0), (0.5, 0.97), (0.8, 0.80), (1.0, 0.60)),
    ),
    "bread": _Kind(
        (0.112, 0.125), (0.180, 0.210), (0.029, 0.034), 0.0020, (0.0110, 0.0125),
        ((0.0, 0.0), (0.85, 0.0), (0.95, 0.20), (1.0, 0.62)),
        ((0.0, 1.0), (0.5, 1.0), (1.0, 0.88)),
    ),
    "table": _Kind(
        (0.094, 0.110), (0.106, 0.125), (0.0205, 0.0225), 0.0024, (0.0085, 0.0095),
        ((0.0, 0.08), (0.1, 0.0), (0.7, 0.0), (0.9, 0.15), (1.0, 0.45)),
        ((0.0, 0.96), (0.3, 0.93), (0.75, 1.0), (0.92, 0.88), (1.0, 0.60)),
    ),
}  # fmt: skip
# Colour of the scales and whether they are of wood.
_SCALES: tuple[tuple[Colour, float], ...] = (
    ((0.13, 0.13, 0.14, 1.0), PLASTIC),
    ((0.42, 0.25, 0.15, 1.0), WOOD),
    ((0.66, 0.45, 0.27, 1.0), WOOD),
    ((0.74, 0.15, 0.13, 1.0), PLASTIC),
    ((0.90, 0.89, 0.85, 1.0), PLASTIC),
    ((0.20, 0.33, 0.46, 1.0), PLASTIC),
    ((0.25, 0.16, 0.12, 1.0), WOOD),
)


@dataclass(frozen=True)
class Knife:
    """Sizes [m], style and colours.

    Attributes: style; grip, the handle's length; half, its half width as seen from the side; blade,
    its length; high, its height at the heel; bolster, length of the steel at the handle's front end;
    rivets, their number; scales, colour of the handle; density of the handle [kg/m^3].
    """

    style: Style = "chef"
    grip: float = 0.118
    half: float = 0.0118
    blade: float = 0.180
    high: float = 0.043
    bolster: float = 0.010
    rivets: int = 3
    scales: Colour = (0.13, 0.13, 0.14, 1.0)
    density: float = PLASTIC


def design(index: int) -> Knife:
    """The sizes of instance `index`; 0 is a chef's knife of 180 mm, the kinds take turns after it."""
    if index == 0:
        return Knife()
    rng = specimen_rng("knife", index)
    style = _STYLES[mixed(index) % 5]
    kind = _KINDS[style]
    scales, density = in_turn(index, _SCALES)
    plain = style == "table"
    return Knife(
        style,
        *(uniform(rng, *r) for r in (kind.handle, kind.half, kind.blade, kind.high)),
        bolster=0.0 if plain else round(float(rng.choice((0.0, 0.010, 0.014))), 3),
        rivets=0 if plain else int(rng.choice((0, 2, 3), p=(0.3, 0.2, 0.5))),
        scales=BOLSTER if plain else scales,
        density=0.55 * STEEL if plain else density,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying on its side along x, its edge towards -y."""
    knife = design(index)
    return tool_specimen(
        "knife",
        [*_handle(knife), _blade(knife)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="z",
    )


def _handle(knife: Knife) -> list[Piece]:
    n, y = knife.grip, knife.half
    if knife.style == "table":
        z = 0.50 * y
        table = [(-n, 0.92 * y, 0.9 * z), (-0.85 * n, y, z), (-0.35 * n, 0.76 * y, 0.95 * z)]
        table += [(-0.05 * n, 0.66 * y, 0.9 * z), (0.0, 0.66 * y, 0.8 * z)]
        outline = superellipse(3.0)
        rounding = (0.003, 0.0005)
    else:
        z = 0.70 * y
        table = [(-n, 0.98 * y, z), (-0.88 * n, y, z), (-0.55 * n, 0.86 * y, 0.94 * z)]
        table += [(-0.22 * n, 0.93 * y, z), (0.0, 0.86 * y, 0.86 * z)]
        outline = superellipse(3.4)
        rounding = (0.0045, 0.001)
    bands = [(-knife.bolster, knife.scales), (0.0, BOLSTER)] if knife.bolster else None
    bar = handle(
        table,
        bands or [(0.0, knife.scales)],
        density=knife.density,
        outline=outline,
        rounding=rounding,
    )
    pins = []
    sections = PchipInterpolator([row[0] for row in table], [row[2] for row in table])
    for share in np.linspace(-0.80, -0.24, knife.rivets):
        half = float(sections(share * n)) + 1e-4
        pin = handle(
            [(-half, 0.0030, 0.0030), (half, 0.0030, 0.0030)], [(0.0, RIVET)], density=STEEL
        )
        pins.append(placed(Piece(pin.visual, (), pin.mass), _upright(share * n)))
    return [bar, *pins]


def _upright(x: float) -> Float[np.ndarray, "4 4"]:
    """Moves x to z, at `x` along the handle [m]."""
    return compose(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), np.array([x, 0.0, 0.0]))


def _blade(knife: Knife) -> Piece:
    """A wedge: even from the spine to two thirds of its height, then ground to the edge."""
    kind = _KINDS[knife.style]
    top, half = 0.78 * knife.half, kind.thick / 2
    if knife.style == "table":
        top = 0.66 * knife.half
    count = 1 + round(knife.blade / (TEETH / 2)) if knife.style == "bread" else 33
    share = np.linspace(0, 1, count)
    depth = [
        PchipInterpolator(*np.array(rows).T)(share) * knife.high for rows in (kind.spine, kind.edge)
    ]
    upper, lower = top - depth[0], top - depth[1]
    lower = np.minimum(lower, upper - 0.0008)
    x = share * knife.blade
    # The tang inside the handle.
    x = np.concatenate([[-SUNK, 0.0], x])
    tang = 0.5 * knife.half
    upper, lower = (
        np.concatenate([[side * tang] * 2, line]) for side, line in ((1, upper), (-1, lower))
    )
    x[2] = 1e-4
    smooth = _wedges(x, upper, lower, half)
    if knife.style == "bread":
        lower = lower + np.where(np.arange(len(lower)) % 2, 0.0013, 0.0)
    mesh = loft_outwards(_wedges(x, upper, lower, half))
    return solid_piece(mesh, loop_hulls(smooth), rgba=BLADE, density=STEEL)


def _wedges(x: np.ndarray, upper: np.ndarray, lower: np.ndarray, half: float) -> np.ndarray:
    shoulder = upper + 0.55 * (lower - upper)
    thin = np.full_like(upper, EDGE / 2)
    corners = [(upper, half), (upper, -half), (shoulder, -half), (lower, -thin), (lower, thin)]
    corners.append((shoulder, half))
    return np.stack(
        [np.stack([x, y, np.broadcast_to(z, y.shape)], axis=1) for y, z in corners], axis=1
    )
