"""A pocket tape measure, its blade a little way out.

Real sizes: 3 m tapes are 55-64 x 52-60 x 28-34 mm and 0.12-0.18 kg, 5 m ones 68-75 x 62-68 x 33-38 mm and
0.2-0.3 kg, 8 m ones 76-82 x 70-76 x 38-46 mm and 0.35-0.45 kg; blades are 13, 16, 19 and 25 mm wide (shop data
of Stanley and Komelon). The belt clip lies flat on one side and does not count. Up is X; blade and hook reach
out of the mouth, so by the rule of the bulge the mouth is on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.procedural.moulded import (
    ON_EDGE,
    facing,
    moulded,
    printed,
    raised,
    rectangle,
    rounded_polygon,
    slab_loops,
)
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen
from asset_pipeline.procedural.solids import box, ellipse
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

STEEL: Colour = (0.78, 0.79, 0.80, 1.0)
INK: Colour = (0.10, 0.10, 0.11, 1.0)
RED: Colour = (0.80, 0.12, 0.10, 1.0)
BLADE_DENSITY = 1500.0  # drawn 1.6 mm thick, for a curved strip of 0.13 mm [kg/m^3]
BLADE = 0.0016
HOOK_DENSITY = 2600.0  # drawn 2.3 mm thick, for steel of 0.8 mm


@dataclass(frozen=True)
class SteelTape:
    """Sizes [m] and colours.

    Attributes: length, height and thickness of the case; nose, height of its front at the mouth as a share;
    slope, how far the top's front corner lies forwards as a share of half the length; crown, radius of the
    rear upper corner as a share of the height; out, how far the blade stands out; blade, its width; edge,
    rounding; density [kg/m^3]; cover's, rubber's, label's and blade's colours.
    """

    length: float = 0.068
    height: float = 0.065
    thickness: float = 0.036
    nose: float = 0.40
    slope: float = 0.50
    crown: float = 0.42
    out: float = 0.011
    blade: float = 0.019
    edge: float = 0.005
    density: float = 1650.0
    cover: Colour = (0.96, 0.78, 0.10, 1.0)
    rubber: Colour = (0.13, 0.13, 0.14, 1.0)
    label: Colour = (0.90, 0.90, 0.89, 1.0)
    strip: Colour = (0.97, 0.85, 0.22, 1.0)


_YELLOW: Colour = (0.97, 0.85, 0.22, 1.0)
_WHITE: Colour = (0.94, 0.94, 0.92, 1.0)
# Cover, rubber, label, blade.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    ((0.80, 0.14, 0.12, 1.0), (0.16, 0.16, 0.17, 1.0), _WHITE, _YELLOW),
    ((0.16, 0.36, 0.62, 1.0), (0.12, 0.12, 0.13, 1.0), (0.85, 0.86, 0.87, 1.0), _WHITE),
    ((0.90, 0.44, 0.10, 1.0), (0.22, 0.22, 0.23, 1.0), INK, _YELLOW),
    ((0.74, 0.75, 0.77, 1.0), (0.74, 0.75, 0.77, 1.0), (0.92, 0.78, 0.16, 1.0), _YELLOW),
    ((0.18, 0.48, 0.30, 1.0), (0.14, 0.14, 0.14, 1.0), _WHITE, _WHITE),
    ((0.20, 0.21, 0.23, 1.0), (0.93, 0.72, 0.12, 1.0), (0.93, 0.72, 0.12, 1.0), _YELLOW),
)
# Length, height, thickness [m], blade, density: 3, 5 and 8 m.
_KINDS = (
    ((0.055, 0.062), (0.052, 0.059), (0.028, 0.034), 0.016, 1450.0),
    ((0.066, 0.072), (0.061, 0.067), (0.033, 0.038), 0.019, 1600.0),
    ((0.072, 0.076), (0.069, 0.075), (0.038, 0.045), 0.025, 1650.0),
)


def design(index: int) -> SteelTape:
    """The sizes of instance `index`; 0 is a yellow 5 m tape, lengths take turns after it."""
    if index == 0:
        return SteelTape()
    rng = specimen_rng("steel_tape", index)
    length, height, thickness, blade, density = _KINDS[index % len(_KINDS)]
    return SteelTape(
        uniform(rng, *length),
        uniform(rng, *height),
        uniform(rng, *thickness),
        nose=uniform(rng, 0.32, 0.50),
        slope=uniform(rng, 0.30, 0.66),
        crown=uniform(rng, 0.22, 0.48),
        out=uniform(rng, 0.009, 0.013),
        blade=blade,
        edge=uniform(rng, 0.003, 0.007),
        density=round(density * float(rng.uniform(0.95, 1.05)), 0),
        **dict(zip(("cover", "rubber", "label", "strip"), in_turn(index, _COLOURS), strict=True)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: mouth along +x, standing on z = 0."""
    tape = design(index)
    x, y = tape.length / 2, tape.thickness / 2
    return rigid_specimen(
        "steel_tape",
        [_case(tape), _blade(tape)],
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(AreaBox("grip", (-x, -y, 0.0), (0.6 * x, y, tape.height)),),
    )


def _case(tape: SteelTape) -> Piece:
    """The case from side to side: covers, rubber around the rim, labels, clip, lock."""
    x, z, y = tape.length / 2, tape.height, tape.thickness / 2
    corners = np.array(
        [[x, 0], [x, tape.nose * z], [tape.slope * x, z], [-x, z], [-x, 0]], dtype=float
    )
    radii = (0.003, 0.006, 0.22 * z, tape.crown * z, 0.14 * z)
    loops = slab_loops(
        corners, radii, -y, y, edges=(tape.edge, tape.edge), cuts=(-0.4 * y, 0.4 * y), steps=5
    )
    middle = np.array([-0.06 * x, 0.50 * z])
    bands = ((0.3, tape.cover), (0.7, tape.rubber), (1.0, tape.cover))
    case = moulded(loops, bands, density=tape.density)
    sides = [_side(tape, side, middle) for side in (-1.0, 1.0)]
    prints = [shape for side in sides for shape in side]
    case = placed(case, ON_EDGE)
    button, block = _lock(tape)
    visuals = (*case.visual, *prints, *_clip(tape, middle), button)
    return Piece(visuals, (*case.collision, block), case.mass)


def _side(tape: SteelTape, side: float, middle: np.ndarray) -> list[Shape]:
    """A rubber ring and a round label on one side."""
    face = facing((0, side, 0), (middle[0], side * tape.thickness / 2, middle[1]))
    radius = 0.36 * min(tape.height, tape.length)
    return [
        printed(ellipse((r, r), 40), face, rgba, layer)
        for r, rgba, layer in (
            (1.12 * radius, tape.rubber, 2),
            (radius, tape.label, 4),
            (0.66 * radius, tape.cover, 6),
        )
    ]


def _clip(tape: SteelTape, middle: np.ndarray) -> list[Shape]:
    """A spring steel belt clip flat on the side at +y, with its screw."""
    face = facing((0, 1, 0), (middle[0], tape.thickness / 2, middle[1] - 0.04 * tape.height))
    tongue = rounded_polygon(
        np.array([[0.011, 0.30], [-0.011, 0.30], [-0.008, -0.32], [0.008, -0.32]])
        * [1.0, tape.height],
        0.004,
    )
    at = face.copy()
    at[2, 3] += 0.2 * tape.height
    return [
        printed(tongue, face, STEEL, 9),
        printed(ellipse((0.0035, 0.0035), 16), at, (0.45, 0.46, 0.48, 1.0), 11),
    ]


def _lock(tape: SteelTape) -> tuple[Shape, Shape]:
    """The button on the sloping front that stops the blade, as seen and as touched."""
    x, z = tape.length / 2, tape.height
    low, high = np.array([x, 0, tape.nose * z]), np.array([tape.slope * x, 0, z])
    slope = high - low
    face = facing((slope[2], 0, -slope[0]), low + 0.42 * slope)
    half = (0.28 * tape.thickness, 0.17 * float(np.linalg.norm(slope)))
    block = Shape("box", (*half, 0.001), face)
    button = raised(rounded_polygon(rectangle(*half), 0.002), face, 0.0018, RED)
    return button, block


def _blade(tape: SteelTape) -> Piece:
    """The strip out of the mouth with its marks, and the hook at its end."""
    mouth, tip, y = tape.length / 2, tape.length / 2 + tape.out, tape.blade / 2
    low = 0.0085
    strip = box((mouth - 0.010, -y, low), (tip, y, low + BLADE), tape.strip)
    hook = box((tip - 0.0015, -y, low - 0.0075), (tip + 0.0008, y, low + BLADE + 0.0008), STEEL)
    slot = facing((1, 0, 0), (mouth, 0, low + BLADE / 2))
    shapes: list[Shape] = [
        strip,
        hook,
        printed(rounded_polygon(rectangle(y + 0.0015, 0.0022), 0.0005, steps=1), slot, INK),
    ]
    top = low + BLADE
    for k, x in enumerate(np.arange(mouth + 0.0015, tip - 0.0035, 0.002)):
        long = y * (0.55 if k % 2 == 0 else 0.3)
        for side in (-1.0, 1.0):
            face = facing((0, 0, 1), (x, side * (y - long / 2), top), up=(0, 1, 0))
            shapes.append(printed(rectangle(0.0003, long / 2), face, INK))
    mass = shape_mass_properties((strip, hook), (BLADE_DENSITY, HOOK_DENSITY))
    return Piece(tuple(shapes), (strip, hook), mass)
