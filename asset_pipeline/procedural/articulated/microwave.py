"""Microwave ovens for the counter: a door hinged on one side, mostly the left, and controls on the other.

Real sizes. Cases are 430-600 mm wide, 250-350 mm high and 330-450 mm deep without the handle (Toshiba ER-KD7
480 x 348 x 443, Panasonic NE-M265 529 x 335 x 455, National NE-M620 520 x 342 x 403 mm wide, high and deep);
they weigh 10-15 kg. Turntables are 245-360 mm across. Many have a push button that opens the door; these
all have a handle.

Frame: z up, origin at the centre of the bottom, between the feet's undersides, front towards -x.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Literal

import numpy as np

from asset_pipeline.procedural.articulated.assembly.parts import (
    Part,
    articulated_specimen,
    moving,
    space_between,
)
from asset_pipeline.procedural.articulated.cabinets.front_panel import Pane, framed
from asset_pipeline.procedural.articulated.handles.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.handles.mounted import Handle
from asset_pipeline.procedural.articulated.handles.portion import weighing
from asset_pipeline.procedural.articulated.handles.pulls import bar, bow, edge
from asset_pipeline.procedural.articulated.ovens.casing import Case, feet, slots
from asset_pipeline.procedural.articulated.ovens.control_panel import Panel, dials, keypad
from asset_pipeline.procedural.articulated.ovens.turntable import TOP, turntable
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Joint, Shape

GLASS = 2500.0  # [kg/m^3]
RUBBER: Colour = (0.10, 0.10, 0.10, 1.0)


@dataclass(frozen=True)
class Microwave:
    """Sizes [m], mass [kg] and colours.

    Attributes:
      width, height, depth: Of the case, without feet, door and handle.
      feet: Their height.
      door: Its thickness, and that of the panel beside it.
      panel: Width of the control panel.
      gap: Between all that moves and all else.
      side, ceiling, floor, back: Thickness of the walls around the cavity; the panel's side is thicker
        by the panel's width.
      rail: Width of the door's frame at top and bottom and at the hinge; the other side is wider by 20 mm.
      hinge: The door's side as seen from the front.
      plate: Diameter of the turntable.
      controls: Keys, or two dials.
      mass: Of the case with all that is in it.
      frame_density: Of the door's frame [kg/m^3].
      friction [N m], damping [N m s/rad]: Of the door; swing: its range [rad].
      handle: Upright, near the free edge.
    """

    width: float = 0.480
    height: float = 0.275
    depth: float = 0.360
    feet: float = 0.012
    door: float = 0.034
    panel: float = 0.125
    gap: float = 0.0025
    side: float = 0.022
    ceiling: float = 0.024
    floor: float = 0.026
    back: float = 0.040
    rail: float = 0.042
    hinge: Literal["left", "right"] = "left"
    plate: float = 0.255
    controls: Literal["keys", "dials"] = "keys"
    mass: float = 12.0
    frame_density: float = 650.0
    friction: float = 0.35
    damping: float = 0.30
    swing: float = radians(105)
    time: str = "12:30"
    handle: Handle = BarHandle(
        0.190, 0.013, 0.032, inset=0.018, rounding=0.004, rgba=(0.62, 0.63, 0.64, 1.0)
    )
    case_rgba: Colour = (0.80, 0.80, 0.81, 1.0)
    front_rgba: Colour = (0.10, 0.10, 0.11, 1.0)
    panel_rgba: Colour = (0.12, 0.12, 0.13, 1.0)
    lining: Colour = (0.88, 0.88, 0.86, 1.0)
    window: Colour = (0.04, 0.05, 0.06, 0.62)

    @property
    def sign(self) -> float:
        """+1 where the hinge is on the left, at +y."""
        return 1.0 if self.hinge == "left" else -1.0

    def span(self, first: float, last: float) -> tuple[float, float]:
        """The y of two places given as distances from the door's hinged side, in rising order [m]."""
        ends = sorted(self.sign * (self.width / 2 - at) for at in (first, last))
        return ends[0], ends[1]


# Case, front, panel, lining, handle.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour, Colour], ...] = (
    ((0.93, 0.93, 0.92, 1), (0.95, 0.95, 0.94, 1), (0.95, 0.95, 0.94, 1), (0.90, 0.90, 0.88, 1), (0.80, 0.80, 0.80, 1)),
    ((0.16, 0.16, 0.17, 1), (0.13, 0.13, 0.14, 1), (0.10, 0.10, 0.11, 1), (0.60, 0.61, 0.62, 1), (0.55, 0.55, 0.56, 1)),
    ((0.45, 0.46, 0.47, 1), (0.72, 0.72, 0.73, 1), (0.15, 0.15, 0.16, 1), (0.80, 0.80, 0.79, 1), (0.82, 0.82, 0.83, 1)),
    ((0.72, 0.12, 0.13, 1), (0.75, 0.13, 0.14, 1), (0.75, 0.13, 0.14, 1), (0.88, 0.88, 0.86, 1), (0.85, 0.85, 0.86, 1)),
    ((0.84, 0.83, 0.76, 1), (0.90, 0.87, 0.77, 1), (0.90, 0.87, 0.77, 1), (0.88, 0.88, 0.86, 1), (0.78, 0.78, 0.79, 1)),
    ((0.62, 0.76, 0.75, 1), (0.66, 0.80, 0.78, 1), (0.92, 0.93, 0.92, 1), (0.90, 0.90, 0.88, 1), (0.86, 0.86, 0.87, 1)),
    ((0.30, 0.30, 0.31, 1), (0.76, 0.76, 0.77, 1), (0.76, 0.76, 0.77, 1), (0.66, 0.67, 0.68, 1), (0.22, 0.22, 0.23, 1)),
)  # fmt: skip


def design(index: int) -> Microwave:
    """The sizes of instance `index`."""
    if index == 0:
        return Microwave()
    rng = specimen_rng("microwave", index)
    case, front, panel, lining, metal = in_turn(index, _COLOURS)
    width = uniform(rng, 0.432, 0.560)
    height = uniform(rng, 0.245, 0.262 + 0.35 * (width - 0.432))
    depth = uniform(rng, 0.300, 0.330 + 0.6 * (width - 0.432))
    side, back = uniform(rng, 0.018, 0.026), uniform(rng, 0.030, 0.045)
    beside = uniform(rng, 0.105, 0.105 + 0.18 * (width - 0.350))
    room = min(width - beside - 2 * side, depth - back) - 0.020
    bars = bar((0.60 * height, 0.80 * height), thickness=(0.012, 0.015), standoff=(0.028, 0.034))
    pulls = (bars, bow((0.58 * height, 0.75 * height)), bars, edge((0.55 * height, 0.85 * height)))
    return Microwave(
        width=width,
        height=height,
        depth=depth,
        feet=uniform(rng, 0.008, 0.016),
        door=uniform(rng, 0.030, 0.038),
        panel=beside,
        side=side,
        back=back,
        rail=uniform(rng, 0.034, 0.048),
        hinge="right" if rng.random() < 0.2 else "left",
        plate=min(room, uniform(rng, 0.245, 0.330)),
        controls="dials" if rng.random() < 0.4 else "keys",
        mass=round(10.0 + 5.0 * (width - 0.432) / 0.128 + float(rng.uniform(-0.5, 0.5)), 2),
        friction=uniform(rng, 0.30, 0.45),
        damping=uniform(rng, 0.25, 0.40),
        time=f"{rng.integers(10, 24):02d}:{rng.integers(0, 60):02d}",
        handle=pulls[index % len(pulls)](rng, metal),
        case_rgba=case,
        front_rgba=front,
        panel_rgba=panel,
        lining=lining,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, shut."""
    microwave = design(index)
    solid, visuals = _base(microwave)
    return articulated_specimen([weighing(visuals, solid, microwave.mass)], [_door(microwave)])


def _case(m: Microwave) -> Case:
    x, y, z = m.depth / 2, m.width / 2, m.feet
    inner = m.span(m.side, m.width - m.panel - m.side)
    return Case(
        low=np.array([-x, -y, z]),
        high=np.array([x, y, z + m.height]),
        inner_low=np.array([-x, inner[0], z + m.floor]),
        inner_high=np.array([x - m.back, inner[1], z + m.height - m.ceiling]),
        corner=0.006,
        rgba=m.case_rgba,
        lining=m.lining,
    )


def _base(m: Microwave) -> tuple[list[Shape], list[Shape]]:
    """Collision shapes, and what is seen."""
    case = _case(m)
    panel_y = m.span(m.width - m.panel, m.width)
    panel = Panel(
        np.array([case.low[0] - m.door, panel_y[0], case.low[2]]),
        np.array([case.low[0], panel_y[1], case.high[2]]),
        m.panel_rgba,
    )
    stand = feet(case.low, case.high, rgba=RUBBER)
    floor = (case.inner_low + case.inner_high) / 2
    floor[2] = case.inner_low[2]
    plate_visuals, plate = turntable(floor, m.plate)
    details, knobs = _controls(m, panel)
    side = np.array([0.12 * m.depth, m.sign * -m.width / 2, m.feet + 0.68 * m.height])
    visuals = [
        *case.visuals(),
        panel.solid(),
        *stand,
        *plate_visuals,
        *details,
        slots(side, 1, (0.030, 0.003), count=14, pitch=0.008),
        slots(side - [0, 0, 0.05], 1, (0.030, 0.003), count=14, pitch=0.008),
    ]
    return [*case.solid(), panel.solid(), *stand, *plate, *knobs], visuals


def _controls(m: Microwave, panel: Panel) -> tuple[list[Shape], list[Shape]]:
    """What is seen on the panel, and the dials, which stand out."""
    if m.controls == "keys":
        return keypad(panel, m.time), []
    radius = min(0.21 * panel.size[0], 0.085 * panel.size[1] + 0.004)
    return dials(panel, [panel.at(0.5, 0.70), panel.at(0.5, 0.32)], radius)


def _door(m: Microwave) -> Part:
    case = _case(m)
    face = case.low[0] - m.gap
    y = m.span(0.0, m.width - m.panel - m.gap)
    low = np.array([face - m.door + m.gap, y[0], case.low[2]])
    high = np.array([face, y[1], case.high[2]])
    wide, narrow = m.rail + 0.020, m.rail
    rails = (wide, narrow) if m.hinge == "left" else (narrow, wide)
    leaf = framed(
        low,
        high,
        (*rails, m.rail, m.rail),
        Pane(inset=0.004, thickness=0.006, rgba=m.window, density=GLASS),
        rgba=m.front_rgba,
        density=m.frame_density,
        corners=(0.004, 0.007),
    )
    joint = Joint(
        kind="hinge",
        origin=np.array([face, m.sign * m.width / 2, (low[2] + high[2]) / 2]),
        axis=np.array([0.0, 0.0, -m.sign]),
        range=(0.0, m.swing),
        frictionloss=m.friction,
        damping=m.damping,
    )
    edge = y[0] if m.hinge == "left" else y[1]
    foot = np.array([low[0], edge + m.sign * wide / 2, (low[2] + high[2]) / 2])
    cavity = space_between(case.inner_low + [0.0, 0.0, TOP], case.inner_high, moves_with_part=False)
    return moving("door", [leaf], m.handle.mounted(foot, "upright"), joint, cavity)
