"""A table clock: an alarm clock with two bells, a round clock on a foot, or a block with a dial.

Real sizes: twin-bell clocks are 80-115 mm wide, 110-160 mm tall and 50-65 mm deep and weigh 0.2-0.35 kg; travel and block
clocks 70-110 x 60-95 x 35-55 mm and 0.1-0.25 kg. Up is X. The dial's side is the broad one; rear leg, foot and winding
keys reach out behind, so by the rule of the bulge Y points away from the dial, to the back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.dial import dial_prints
from asset_pipeline.procedural.moulded import (
    ON_EDGE,
    facing,
    moulded,
    printed,
    rectangle,
    rounded_polygon,
    slab_loops,
)
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen
from asset_pipeline.procedural.solids import ellipse
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar
from asset_pipeline.procedural.tool_handles import ALONG_X
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

INK: Colour = (0.10, 0.10, 0.11, 1.0)
BRASS: Colour = (0.78, 0.64, 0.32, 1.0)
CHROME: Colour = (0.80, 0.81, 0.82, 1.0)
Style = Literal["bells", "foot", "block"]


@dataclass(frozen=True)
class Clock:
    """Sizes [m] and colours.

    Attributes: style; width of the case (a round one's diameter), height of a block's; depth; lift, height of
    the case above the table; bell, radius; back, how far leg, foot or keys stand out behind; narrow, size of
    a block's back as a share of its front; hour and minute shown; density [kg/m^3] of the case with its
    works; case's, dial's, rim's and marks' colours.
    """

    style: Style = "bells"
    width: float = 0.090
    height: float = 0.090
    depth: float = 0.036
    lift: float = 0.016
    bell: float = 0.021
    back: float = 0.022
    narrow: float = 0.75
    hour: int = 10
    minute: int = 9
    density: float = 800.0
    case: Colour = (0.76, 0.16, 0.15, 1.0)
    dial: Colour = (0.97, 0.96, 0.92, 1.0)
    rim: Colour = CHROME
    marks: Colour = INK


_WHITE: Colour = (0.96, 0.96, 0.95, 1.0)
_BLACK: Colour = (0.14, 0.14, 0.15, 1.0)
# Case, dial, rim, marks.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    (_BLACK, _WHITE, (0.30, 0.30, 0.32, 1.0), INK),
    ((0.40, 0.62, 0.60, 1.0), (0.97, 0.95, 0.88, 1.0), BRASS, INK),
    ((0.56, 0.36, 0.20, 1.0), (0.95, 0.92, 0.82, 1.0), BRASS, (0.30, 0.16, 0.08, 1.0)),
    (_WHITE, (0.20, 0.21, 0.24, 1.0), (0.75, 0.76, 0.78, 1.0), _WHITE),
    ((0.24, 0.36, 0.58, 1.0), _WHITE, CHROME, (0.12, 0.18, 0.34, 1.0)),
    ((0.93, 0.74, 0.26, 1.0), _WHITE, _WHITE, INK),
    ((0.72, 0.73, 0.75, 1.0), _BLACK, CHROME, (0.95, 0.92, 0.70, 1.0)),
)
_STYLES: tuple[Style, ...] = ("block", "foot", "bells")


def design(index: int) -> Clock:
    """The sizes of instance `index`; 0 is a red alarm clock with bells, the styles take turns after it."""
    if index == 0:
        return Clock()
    rng = specimen_rng("clock", index)
    style: Style = in_turn(index, _STYLES)
    low, high = {"bells": (0.074, 0.096), "foot": (0.072, 0.104), "block": (0.072, 0.112)}[style]
    width = uniform(rng, low, high)
    height = round(width * float(rng.uniform(0.72, 0.95)), 4) if style == "block" else width
    return Clock(
        style,
        width,
        height,
        depth=uniform(rng, 0.032, 0.042) if style != "block" else uniform(rng, 0.038, 0.052),
        lift=uniform(rng, 0.012, 0.018) if style == "bells" else uniform(rng, 0.007, 0.011),
        bell=round(width * float(rng.uniform(0.20, 0.25)), 4),
        back=uniform(rng, 0.018, 0.026) if style != "block" else uniform(rng, 0.006, 0.008),
        narrow=uniform(rng, 0.62, 0.76),
        hour=int(rng.integers(1, 13)),
        minute=int(rng.integers(0, 60)),
        density=round(float(rng.uniform(520.0, 760.0)), 0),
        **dict(zip(("case", "dial", "rim", "marks"), in_turn(index, _COLOURS), strict=True)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: dial towards -x, standing on z = 0."""
    clock = design(index)
    x, y, low = clock.depth / 2, clock.width / 2, clock.lift
    if clock.style == "block":
        pieces, low = [_block(clock)], 0.0
    elif clock.style == "foot":
        pieces = [_drum(clock), _foot(clock)]
    else:
        pieces = [_drum(clock), *_legs(clock), *_bells(clock)]
    pieces += [_key(clock, side) for side in (-1.0, 1.0)]
    return rigid_specimen(
        "clock",
        pieces,
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(AreaBox("grip", (-x, -y, low), (x, y, low + clock.height)),),
    )


def _drum(clock: Clock) -> Piece:
    """A round case along x: raised rim around the dial at -x, rounded back at +x."""
    r, d = clock.width / 2, clock.depth
    profile = np.array(
        [(0, 0), (r - 0.003, 0), (r, 0.002), (r, 0.008), (r - 0.0012, 0.0082)]
        + [
            (r - 0.0012, 0.70 * d),
            (0.94 * r, 0.86 * d),
            (0.82 * r, 0.96 * d),
            (0.66 * r, d),
            (0, d + 1e-6),
        ]
    )
    bands = ((0.0081, clock.rim), (1.0, clock.case))
    levels = (0, 0.002, 0.70 * d, 0.86 * d, 0.96 * d, d)
    drum = turned(profile, levels, bands=bands, density=clock.density, sections=56)
    centre = np.array([-d / 2, 0.0, clock.lift + r])
    drum = placed(drum, compose(ALONG_X[:3, :3], centre))
    face = facing((-1, 0, 0), centre)
    return Piece((*drum.visual, *_dial(clock, face, r - 0.006)), drum.collision, drum.mass)


def _dial(
    clock: Clock,
    face: Float[np.ndarray, "4 4"],
    radius: float,
    outline: Float[np.ndarray, "p 2"] | None = None,
) -> list[Shape]:
    """The dial with the time; round unless it has an outline of its own."""
    plate = ellipse((radius, radius)) if outline is None else outline
    time = (clock.hour, clock.minute)
    return [
        printed(plate, face, clock.dial, 2),
        *dial_prints(face, radius, time, clock.marks, first_layer=4),
    ]


def _block(clock: Clock) -> Piece:
    """A case that narrows from the dial to its back, flat below."""
    x, y, z = clock.depth / 2, clock.width / 2, clock.height
    loops = slab_loops(
        rectangle(y, z / 2), 0.009, -x, x, edges=(0.003, 0.003), cuts=(-x + 0.007,), steps=5
    )
    share = np.clip((loops[..., 2] + x - 0.007) / (2 * x - 0.007), 0, 1)
    size = 1 - (1 - clock.narrow) * share
    loops[..., 0] *= size
    loops[..., 1] = (loops[..., 1] + z / 2) * size
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # drawn along z, lies along x
    bands = ((0.007 / clock.depth, clock.rim), (1.0, clock.case))
    case = placed(moulded(loops, bands, density=clock.density), compose(turn, np.zeros(3)))
    face = facing((-1, 0, 0), (-x, 0, z / 2))
    r = min(y, z / 2) - 0.008
    corners = rounded_polygon(rectangle(y - 0.007, z / 2 - 0.007), 0.006)
    return Piece((*case.visual, *_dial(clock, face, r, corners)), case.collision, case.mass)


def _foot(clock: Clock) -> Piece:
    """A plate that reaches out behind, with a saddle under the case."""
    front, back, y = -clock.depth / 2 + 0.002, clock.depth / 2 + clock.back, 0.36 * clock.width
    tall = clock.lift + 0.12 * clock.width
    corners = np.array(
        [[back, 0.0], [back, 0.007], [0.7 * clock.depth / 2, tall], [front, tall], [front, 0.0]]
    )
    loops = slab_loops(
        corners, (0.001, 0.003, 0.004, 0.002, 0.001), -y, y, edges=(0.003, 0.003), steps=2
    )
    foot = moulded(loops, ((1.0, clock.rim),), density=700.0)
    return placed(foot, ON_EDGE)


def _legs(clock: Clock) -> list[Piece]:
    """Two splayed feet in front and one behind."""
    r, d = clock.width / 2, clock.depth
    centre = clock.lift + r
    places = [(-0.28 * d, s * 0.50 * r, -0.26 * d, s * 0.66 * r) for s in (-1.0, 1.0)]
    places.append((0.44 * d, 0.0, d / 2 + clock.back - 0.006, 0.0))
    legs = []
    for x0, y0, x1, y1 in places:
        root = np.array([x0, y0, centre - (0.84 if y0 else 0.80) * r])
        tip = np.array([x1, y1, 0.004])
        line = np.stack([root, (root + tip) / 2, tip])
        across = (1.0, 0.0, 0.0) if y0 else (0.0, 1.0, 0.0)
        half = np.full((3, 2), 0.0038)
        leg = bar(line, half, parts=1, rgba=clock.rim, density=1500.0, sideways=across)
        pad = turned(
            np.array([(0, 0), (0.0062, 0), (0.0066, 0.0008), (0.0062, 0.006), (0, 0.0062)]),
            (0.0, 0.006),
            bands=((1.0, clock.rim),),
            density=1500.0,
            sections=20,
        )
        legs += [leg, placed(pad, compose(np.eye(3), np.array([x1, y1, 0.0])))]
    return legs


def _bells(clock: Clock) -> list[Piece]:
    """Two domes on posts with a hammer between, and a carrying bow over them."""
    r, b = clock.width / 2, clock.bell
    centre = np.array([0.0, 0.0, clock.lift + r])
    angles = np.linspace(0, np.pi / 2, 8)
    dome = np.column_stack([b * np.cos(angles), 0.004 + 0.62 * b * np.sin(angles)])
    dome[-1, 0] = 0.0
    profile = np.array([(0, 0.003), (0.94 * b, 0.003), *dome])
    levels = (0.003, *dome[[0, 2, 4, 6], 1])
    pieces = []
    for side in (-1.0, 1.0):
        tilt = rotation_about(np.array([1.0, 0.0, 0.0]), -side * np.deg2rad(36.0))
        bell = turned(profile, levels, bands=((1.0, clock.rim),), density=1100.0, sections=32)
        out = tilt @ np.array([0.0, 0.0, 1.0])
        pieces.append(placed(bell, compose(tilt, centre + (r + 0.004) * out)))
        post = turned(
            np.array([(0, 0), (0.0035, 0), (0.0035, 0.012), (0, 0.0121)]),
            (0.0, 0.012),
            bands=((1.0, clock.rim),),
            density=2000.0,
            sections=16,
        )
        pieces.append(placed(post, compose(tilt, centre + (r - 0.004) * out)))
    hammer = turned(
        np.array(
            [(0, 0), (0.0024, 0), (0.0024, 0.016), (0.0060, 0.0165), (0.0060, 0.0235), (0, 0.024)]
        ),
        (0.0, 0.016, 0.0165, 0.0235),
        bands=((0.0161, CHROME), (1.0, clock.rim)),
        density=2500.0,
        sections=20,
    )
    pieces.append(placed(hammer, compose(np.eye(3), centre + [0, 0, r - 0.003])))
    return pieces


def _key(clock: Clock, side: float) -> Piece:
    """A winding or setting knob on the back."""
    reach = 0.011 if clock.style != "block" else clock.back + 0.001
    profile = np.array(
        [
            (0, 0),
            (0.0035, 0),
            (0.0035, 0.4 * reach),
            (0.0075, 0.42 * reach),
            (0.0075, reach),
            (0, reach + 1e-6),
        ]
    )
    knob = turned(
        profile,
        (0.0, 0.4 * reach, 0.42 * reach, reach),
        bands=((1.0, clock.marks if clock.marks == INK else clock.rim),),
        density=1200.0,
        sections=20,
    )
    height = (
        clock.lift + clock.height / 2
        if clock.style != "block"
        else 0.45 * clock.height * clock.narrow
    )
    at = np.array([clock.depth / 2 - 0.001, side * 0.36 * clock.width / 2, height])
    return placed(knob, compose(ALONG_X[:3, :3], at))
