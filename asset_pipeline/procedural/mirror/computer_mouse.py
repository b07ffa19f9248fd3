"""A computer mouse with two buttons, a wheel and the start of its cord.

Real sizes: mice on sale are 95-125 mm long, 56-68 mm wide and 34-43 mm high and weigh 0.06-0.13 kg (Logitech's and
Microsoft's data sheets: M185 99 x 60 x 39 mm and 0.075 kg, B100 113 x 62 x 38 mm and 0.09 kg). Of the cord only the
bend relief is rigid. Up is X. The palm's end is high and broad and the cord reaches out in front, so by the rule of
the bulge buttons and cord are on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.moulded import facing, printed, rectangle, rounded_polygon
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen
from asset_pipeline.procedural.shell import painted
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar, loft_outwards
from asset_pipeline.procedural.tool_handles import ALONG_Y, loop_hulls
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose

RUBBER: Colour = (0.12, 0.12, 0.13, 1.0)
GAP: Colour = (0.05, 0.05, 0.06, 1.0)
POINTS = 48
BELT = 10  # points of a section between its top and the sides' colour
WHEEL_WIDTH = 0.007
WHEEL_RISE = 0.0032  # of the wheel above the shell [m]


@dataclass(frozen=True)
class Mouse:
    """Sizes [m] and colours.

    Attributes: length, width and height of the shell; front, its height at the buttons' end as a share; peak,
    where it is highest, from the rear as a share; waist and nose, widths in the middle and at the front as
    shares; round_off, how long the rounding of the ends is as a share; square, exponent of its sections;
    split, where the buttons begin, from the front as a share; cord, length of what is left of it; density
    [kg/m^3]; shell's, buttons', sides' and wheel's colours.
    """

    length: float = 0.104
    width: float = 0.062
    height: float = 0.039
    front: float = 0.46
    peak: float = 0.34
    waist: float = 0.93
    nose: float = 0.86
    round_off: float = 0.30
    square: float = 2.7
    split: float = 0.48
    cord: float = 0.017
    density: float = 640.0
    shell: Colour = (0.17, 0.17, 0.19, 1.0)
    buttons: Colour = (0.24, 0.25, 0.27, 1.0)
    sides: Colour = (0.12, 0.12, 0.13, 1.0)
    wheel: Colour = (0.55, 0.56, 0.58, 1.0)


_WHITE: Colour = (0.93, 0.93, 0.93, 1.0)
_BLACK: Colour = (0.14, 0.14, 0.15, 1.0)
_SILVER: Colour = (0.72, 0.73, 0.75, 1.0)
# Shell, buttons, sides, wheel.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    (_WHITE, (0.98, 0.98, 0.98, 1.0), (0.62, 0.64, 0.67, 1.0), (0.30, 0.31, 0.33, 1.0)),
    ((0.20, 0.36, 0.60, 1.0), _BLACK, _BLACK, (0.20, 0.36, 0.60, 1.0)),
    (_SILVER, _SILVER, _BLACK, _BLACK),
    (_BLACK, _BLACK, (0.74, 0.14, 0.13, 1.0), (0.74, 0.14, 0.13, 1.0)),
    ((0.86, 0.54, 0.58, 1.0), (0.93, 0.70, 0.72, 1.0), _WHITE, _WHITE),
    ((0.36, 0.38, 0.40, 1.0), (0.44, 0.46, 0.48, 1.0), _BLACK, (0.92, 0.55, 0.12, 1.0)),
    (
        (0.84, 0.81, 0.72, 1.0),
        (0.88, 0.85, 0.77, 1.0),
        (0.80, 0.77, 0.68, 1.0),
        (0.50, 0.48, 0.42, 1.0),
    ),
)


def design(index: int) -> Mouse:
    """The sizes of instance `index`; 0 is dark."""
    if index == 0:
        return Mouse()
    rng = specimen_rng("computer_mouse", index)
    length = uniform(rng, 0.096, 0.112)
    return Mouse(
        length,
        uniform(rng, 0.056, 0.066),
        uniform(rng, 0.035, 0.042),
        front=uniform(rng, 0.40, 0.50),
        peak=uniform(rng, 0.28, 0.38),
        waist=uniform(rng, 0.88, 0.97),
        nose=uniform(rng, 0.80, 0.90),
        round_off=uniform(rng, 0.24, 0.34),
        square=uniform(rng, 2.4, 3.2),
        split=uniform(rng, 0.42, 0.54),
        cord=uniform(rng, 0.0165, 0.020),
        density=round(float(rng.uniform(520.0, 760.0)), 0),
        **dict(zip(("shell", "buttons", "sides", "wheel"), in_turn(index, _COLOURS), strict=True)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: buttons along +x, standing on z = 0."""
    mouse = design(index)
    x, y = mouse.length / 2, mouse.width / 2
    pieces = [_shell(mouse), _wheel(mouse), _cord(mouse)]
    return rigid_specimen(
        "computer_mouse",
        pieces,
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(AreaBox("grip", (-0.5 * x, -y, 0.0), (0.5 * x, y, mouse.height)),),
    )


def _profile(mouse: Mouse, share: Float[np.ndarray, "n"]) -> tuple[np.ndarray, np.ndarray]:
    """Heights and half widths at shares of the length from the rear, end roundings included."""
    top = PchipInterpolator(
        [0, mouse.peak, 0.72, 1], [0.80, 1.0, 0.5 + mouse.front / 2, mouse.front]
    )
    side = PchipInterpolator([0, 0.30, 0.62, 1], [0.92, 1.0, mouse.waist, mouse.nose])

    def rounded(length: float, distance: np.ndarray) -> np.ndarray:
        return np.sqrt(np.clip(1 - np.clip(1 - distance / length, 0, 1) ** 2.4, 0, 1))

    rear, nose = rounded(mouse.round_off, share), rounded(0.12, 1 - share)
    height = mouse.height * top(share) * rear * (0.35 + 0.65 * nose)
    half = mouse.width / 2 * side(share) * rear**0.8 * (0.62 + 0.38 * nose)
    return height, half


def _loops(mouse: Mouse) -> Float[np.ndarray, "stations points 3"]:
    """Sections from the rear to the front: flat below, arched above; the first point is on top."""
    ends = 0.004, 0.012, 0.028, 0.05, 0.08
    split = 1 - mouse.split
    share = np.unique(
        [*ends, *np.linspace(0.12, 0.90, 16), split, split + 0.012, 0.94, 0.97, 0.99, 1.0]
    )
    height, half = _profile(mouse, share)
    angles = np.arange(POINTS) * (2 * np.pi / POINTS)
    up, across = np.round(np.cos(angles), 12), np.round(np.sin(angles), 12)
    keel = np.minimum(0.16 * mouse.height, 0.4 * height)[:, None]
    power = np.where(up > 0, 2 / mouse.square, 2 / 7.0)
    side = np.where(up > 0, 2 / mouse.square, 2 / 7.0)
    lift = np.sign(up) * np.abs(up) ** power
    z = np.where(up > 0, keel + lift * (height[:, None] - keel), keel * (1 + lift))
    y = half[:, None] * np.sign(across) * np.abs(across) ** side
    x = np.broadcast_to(mouse.length * (share - 0.5)[:, None], y.shape)
    return np.stack([x, y, z], axis=-1)


def _shell(mouse: Mouse) -> Piece:
    loops = _loops(mouse)
    mesh = loft_outwards(loops)
    column = (np.asarray(mesh.faces) % POINTS + POINTS // 2) % POINTS - POINTS // 2
    low = np.abs(column).max(axis=1) > BELT
    front = mesh.triangles_center[:, 0] > mouse.length * (0.5 - mouse.split)
    visuals = []
    for mask, rgba in (
        (low, mouse.sides),
        (~low & front, mouse.buttons),
        (~low & ~front, mouse.shell),
    ):
        visuals.append(painted(mesh, mask, rgba, rgba)[0])
    feet = [
        printed(
            rounded_polygon(rectangle(0.30 * mouse.width, 0.004), 0.003),
            facing((0, 0, -1), (x * mouse.length, 0, 0), up=(1, 0, 0)),
            RUBBER,
        )
        for x in (-0.26, 0.32)
    ]
    mass = solid_mass_properties(mesh, mouse.density * float(mesh.volume))
    return Piece((*visuals, *feet, *_gaps(mouse, loops)), loop_hulls(loops), mass)


def _gaps(mouse: Mouse, loops: np.ndarray) -> list[Shape]:
    """The dark lines between the buttons and behind them, a little off the shell."""
    x = loops[:, 0, 0]
    split = int(np.argmin(np.abs(x - mouse.length * (0.5 - mouse.split))))
    wide = 0.0006
    ridge = loops[split:-3, 0] + [0, 0, 0.0001]
    along = np.stack([ridge - [0, wide, 0], ridge + [0, wide, 0], ridge - [0, 0, 0.001]], axis=1)
    arch = np.arange(-8, 9)
    lines = [
        np.stack([loops[k, arch], 1.0015 * loops[k, arch] + [0, 0, 0.00015]])
        for k in (split, split + 1)
    ]
    behind = np.stack([lines[0][1], lines[1][1], lines[1][0] - [0, 0, 0.001]], axis=1)
    return [Shape("mesh", mesh=loft_outwards(strip), rgba=GAP) for strip in (along, behind)]


def _wheel(mouse: Mouse) -> Piece:
    """A ribbed wheel between the buttons."""
    radius, w = 0.0105, WHEEL_WIDTH
    share = 0.775
    top = float(_profile(mouse, np.array([share]))[0][0])
    profile = np.array(
        [
            [0, 0],
            [0.86 * radius, 0],
            [radius, 0.18 * w],
            [radius, 0.82 * w],
            [0.86 * radius, w],
            [0, w],
        ]
    )
    profile[:, 1] += np.arange(6) * 1e-6
    bands = ((0.3 * w, mouse.wheel), (0.7 * w, RUBBER), (1.0, mouse.wheel))
    wheel = turned(profile, (0.0, w), bands=bands, density=900.0, sections=32)
    tyre = Shape("cylinder", (radius, 0.41 * w), compose(np.eye(3), np.array([0, 0, w / 2])))
    wheel = Piece(wheel.visual, (tyre,), wheel.mass)
    at = np.array([mouse.length * (share - 0.5), -w / 2, top + WHEEL_RISE - radius])
    return placed(wheel, compose(ALONG_Y[:3, :3], at))


def _cord(mouse: Mouse) -> Piece:
    """The bend relief and the first of the cord."""
    start, height = mouse.length / 2 - 0.006, 0.008
    x = start + np.array(
        [0.0, 0.006, 0.006 + 0.55 * mouse.cord, 0.0065 + 0.55 * mouse.cord, 0.006 + mouse.cord]
    )
    radius = np.array([0.0030, 0.0030, 0.0024, 0.0019, 0.0019])
    line = np.column_stack([x, np.zeros(5), np.full(5, height)])
    return bar(line, np.stack([radius, radius], axis=1), parts=(2, 3), rgba=RUBBER, density=1200.0)
