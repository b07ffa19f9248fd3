"""A light bulb, glass up, on its Edison screw.

Real sizes. The screw shells E27 and E14 are 26.5 mm and 13.9 mm wide (IEC 60061-1); the bulbs A60, C35, G80 and T30
are 60, 35, 80 and 30 mm wide and 105-112, 98-105, 110-120 and 115-135 mm long (makers' data sheets). They
weigh 20-90 g: thin glass with filaments, or plastic with a driver under a white collar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import rigid_specimen
from asset_pipeline.procedural.revolution import curve_through, revolved_mass
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from manipose_mj.poses import SymmetryGroup

TURNS = 5  # of the screw's thread that show
BLACK: Colour = (0.12, 0.12, 0.13, 1.0)
BRASS: Colour = (0.72, 0.62, 0.38, 1.0)
NICKEL: Colour = (0.74, 0.74, 0.75, 1.0)
OPAL: Colour = (0.96, 0.95, 0.90, 1.0)
CLEAR: Colour = (0.86, 0.90, 0.92, 0.55)
AMBER: Colour = (0.88, 0.60, 0.22, 0.65)
COLLAR: Colour = (0.84, 0.85, 0.86, 1.0)

# Outline of long glasses from the screw to the top: shares of half the width and of the length.
_OUTLINES: dict[str, tuple[tuple[float, float], ...]] = {
    "C": ((0.0, 0.0), (0.55, 0.10), (0.95, 0.25), (1.0, 0.36), (0.86, 0.58), (0.55, 0.80))
    + ((0.27, 0.95),),
    "T": ((0.0, 0.0), (0.45, 0.07), (0.95, 0.18), (1.0, 0.26), (1.0, 0.84), (0.86, 0.94))
    + ((0.50, 0.99),),
}
_LOWEST = {"A": -0.55, "G": -0.95}  # where the ball of a round glass begins [rad]


@dataclass(frozen=True)
class LightBulb:
    """Sizes [m] and colours.

    Attributes: shape, the letter of its type; width; length, over all; screw, width of its shell;
    led, whether a driver's housing carries the glass; mass [kg]; glass and shell colours.
    """

    shape: str = "A"
    width: float = 0.060
    length: float = 0.108
    screw: float = 0.0265
    led: bool = False
    mass: float = 0.035
    glass: Colour = OPAL
    shell: Colour = NICKEL


_WIDTHS = {"A": (0.055, 0.065), "C": (0.034, 0.039), "G": (0.076, 0.082), "T": (0.029, 0.034)}
_LENGTHS = {"A": (0.102, 0.115), "C": (0.096, 0.112), "G": (0.108, 0.122), "T": (0.110, 0.135)}


def design(index: int) -> LightBulb:
    """The sizes of instance `index`; 0 is an opal A60."""
    if index == 0:
        return LightBulb()
    rng = specimen_rng("light_bulb", index)
    shape = in_turn(mixed(index), ("A", "C", "A", "G", "T"))
    small = shape == "C" or (shape == "T" and index % 2 == 0)
    led = shape in "AG" and index % 3 != 0
    return LightBulb(
        shape=shape,
        width=uniform(rng, *_WIDTHS[shape]),
        length=uniform(rng, *_LENGTHS[shape]),
        screw=0.0139 if small else 0.0265,
        led=led,
        mass=uniform(rng, 0.045, 0.085) if led else uniform(rng, 0.020, 0.045),
        glass=OPAL if led else in_turn(index, (CLEAR, OPAL, AMBER)),
        shell=in_turn(index, (NICKEL, BRASS)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    bulb = design(index)
    r, thread = bulb.screw / 2, 0.78 * bulb.screw
    foot = 0.22 * bulb.screw  # contact and insulator
    neck = foot + thread
    contact = [[0, 0], [0.30 * r, 0], [0.36 * r, 0.25 * foot]]
    insulator = [[0.42 * r, 0.26 * foot], [0.86 * r, foot]]
    heights = foot + thread * np.linspace(0, 1, 2 * TURNS + 1)
    ridges = np.column_stack([np.where(np.arange(2 * TURNS + 1) % 2, r, 0.92 * r), heights])
    glass = _round_glass(bulb, neck) if bulb.shape in _LOWEST else _long_glass(bulb, neck)
    housing = [[r, neck + 0.001], [1.1 * r, neck + 0.003]] if bulb.led else np.empty((0, 2))
    profile = np.concatenate([contact, insulator, ridges, housing, glass])
    bands = [(0.25 * foot, NICKEL), (foot, BLACK), (neck, bulb.shell)]
    if bulb.led:
        bands.append((glass[0, 1], COLLAR))
    bands.append((bulb.length, bulb.glass))
    density = bulb.mass / revolved_mass(profile, 1.0).mass
    piece = filled(profile, density=density, bands=bands, tolerance=0.0007)
    return rigid_specimen(
        "light_bulb", [piece], object_type="axial", symmetry=SymmetryGroup.about_x()
    )


def _round_glass(bulb: LightBulb, neck: float) -> np.ndarray:
    """A ball, down to the housing or to a throat that narrows to the screw."""
    radius = bulb.width / 2
    centre = np.array([0.0, bulb.length - radius])
    low = -np.arccos(0.84) if bulb.led else _LOWEST[bulb.shape]
    angles = np.linspace(low, np.pi / 2, 20)
    ball = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    ball[-1, 0] = 0.0
    if bulb.led:
        return ball
    # A cubic Bezier curve, upright at the screw and tangent to the ball.
    start, tangent = np.array([0.96 * bulb.screw / 2, neck]), np.array([-np.sin(low), np.cos(low)])
    reach = 0.42 * np.linalg.norm(ball[0] - start)
    middle = (start + [0, reach], ball[0] - reach * tangent)
    t = np.linspace(0, 1, 13)[:-1, None]
    throat = (1 - t) ** 3 * start + 3 * t * (1 - t) ** 2 * middle[0]
    throat += 3 * t**2 * (1 - t) * middle[1] + t**3 * ball[0]
    return np.concatenate([throat, ball])


def _long_glass(bulb: LightBulb, neck: float) -> np.ndarray:
    shares = np.array(_OUTLINES[bulb.shape])
    low, narrow = neck, 0.96 * bulb.screw / 2
    glass = [narrow, low] + shares * [bulb.width / 2 - narrow, bulb.length - low]
    glass[-1, 0] = shares[-1, 0] * bulb.width / 2
    return curve_through(np.vstack([glass, [0.0, bulb.length]]), 32)
