"""An oven from its sizes: a lined case with a grid, a control panel, and a door that opens downwards.

Frame: z up, origin at the centre of the bottom, front towards -x.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
import trimesh

from asset_pipeline.procedural.articulated.assembly.parts import (
    Part,
    articulated_specimen,
    moving,
    space_between,
)
from asset_pipeline.procedural.articulated.cabinets.front_panel import Pane, framed, merged
from asset_pipeline.procedural.articulated.handles.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.handles.mounted import Handle
from asset_pipeline.procedural.articulated.handles.portion import weighing
from asset_pipeline.procedural.articulated.ovens.casing import Case, feet, slots
from asset_pipeline.procedural.articulated.ovens.control_panel import Panel, dials, display
from asset_pipeline.procedural.articulated.ovens.rack import rack
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import Colour, Specimen
from manipose_mj.assets.geometry import Joint, Shape

GLASS = 2500.0  # [kg/m^3]
# Share of the door's weight that springs carry. A share left to friction would let it creep: MuJoCo's
# dry friction is regularized, and gives way by milliradians a second.
BALANCED = 1.0
MARGIN = 0.014  # from the door's outline to the cavity's [m]
HEATER_RADIUS, HEATER_BELOW = 0.004, 0.012  # [m]; the tubes' middles are so far below the ceiling
# Where dials are, as shares of the strip's width from its low y; a display is between them.
ALONG_STRIP = {2: (0.16, 0.84), 3: (0.12, 0.24, 0.84), 4: (0.12, 0.24, 0.76, 0.88)}
HEATER: Colour = (0.55, 0.24, 0.16, 1.0)
RUBBER: Colour = (0.10, 0.10, 0.10, 1.0)
AMBER: Colour = (0.95, 0.45, 0.20, 1.0)


@dataclass(frozen=True)
class Oven:
    """Sizes [m], mass [kg] and colours.

    Attributes:
      width, height, depth: Of the case, without feet, door and handle.
      feet: Their height.
      door: Its thickness, and that of the panel beside or above it.
      sill: From the case's underside to the door; top: from the door to the case's top.
      panel: Width of the control panel on the right; 0 where the controls are above the door.
      gap: Between all that moves and all else.
      side, back: Thickness of the walls beside and behind the cavity.
      rail: Width of the door's frame at the sides and below; above it is wider by `grip`, for the handle.
      rack: Height of the grid's upper side above the cavity's floor.
      bars: Between the grid's bars.
      heaters: Whether tubes run along the ceiling, as in table-top ovens.
      dials: How many.
      time: What the display shows; empty where there is none.
      mass: Of the case with all that is in it; frame_density: of the door's frame [kg/m^3].
      friction [N m], damping [N m s/rad]: Of the hinge.
      swing: Of the door [rad].
      handle: Level, along the upper edge.
    """

    width: float = 0.500
    height: float = 0.310
    depth: float = 0.360
    feet: float = 0.016
    door: float = 0.022
    sill: float = 0.064
    top: float = 0.022
    panel: float = 0.115
    gap: float = 0.003
    side: float = 0.018
    back: float = 0.030
    rail: float = 0.030
    grip: float = 0.020
    rack: float = 0.050
    bars: float = 0.024
    heaters: bool = True
    dials: int = 3
    time: str = ""
    mass: float = 8.5
    frame_density: float = 1100.0
    friction: float = 0.40
    damping: float = 0.60
    swing: float = pi / 2
    handle: Handle = BarHandle(
        0.280, 0.012, 0.027, inset=0.025, rounding=0.004, rgba=(0.62, 0.63, 0.64, 1.0)
    )
    case_rgba: Colour = (0.68, 0.69, 0.70, 1.0)
    front_rgba: Colour = (0.12, 0.12, 0.13, 1.0)
    panel_rgba: Colour = (0.15, 0.15, 0.16, 1.0)
    lining: Colour = (0.42, 0.42, 0.43, 1.0)
    window: Colour = (0.05, 0.045, 0.04, 0.55)


def oven_specimen(oven: Oven) -> Specimen:
    """The oven, shut."""
    solid, visuals = _base(oven)
    return articulated_specimen([weighing(visuals, solid, oven.mass)], [_door(oven)])


def _door_outline(o: Oven) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corner of the shut door."""
    face = -o.depth / 2 - o.gap
    beside = o.panel + o.gap if o.panel else 0.0
    low = np.array([face - o.door + o.gap, -o.width / 2 + beside, o.feet + o.sill])
    return low, np.array([face, o.width / 2, o.feet + o.height - o.top - o.gap])


def _case(o: Oven) -> Case:
    x, y, z = o.depth / 2, o.width / 2, o.feet
    low, high = _door_outline(o)
    return Case(
        low=np.array([-x, -y, z]),
        high=np.array([x, y, z + o.height]),
        inner_low=np.array([-x, low[1] + o.side, low[2] + MARGIN]),
        inner_high=np.array([x - o.back, high[1] - o.side, high[2] - MARGIN]),
        corner=0.006,
        rgba=o.case_rgba,
        lining=o.lining,
    )


def _base(o: Oven) -> tuple[list[Shape], list[Shape]]:
    """Collision shapes, and what is seen."""
    case = _case(o)
    low, high = case.inner_low, case.inner_high
    front = case.low[0] - o.door
    door_low, door_high = _door_outline(o)
    # The strip above the door, over the whole width; and the panel beside it.
    strip = Panel(
        np.array([front, case.low[1], door_high[2] + o.gap]),
        np.array([case.low[0], case.high[1], case.high[2]]),
        o.panel_rgba,
    )
    panels = [strip]
    if o.panel:
        upper = np.array([case.low[0], door_low[1] - o.gap, strip.low[2]])
        panels.append(Panel(case.low - [o.door, 0.0, 0.0], upper, o.panel_rgba))
    stand = feet(case.low, case.high, rgba=RUBBER) if o.feet else []
    grid_visuals, grid = rack(low, high, low[2] + o.rack, o.bars)
    heater_visuals, heaters = _heaters(o, low, high)
    details, knobs = _controls(o, panels[-1])
    sill = np.array([case.low[0], (door_low[1] + door_high[1]) / 2, o.feet + 0.45 * o.sill])
    side = np.array([0.1 * o.depth, -o.width / 2, o.feet + 0.75 * o.height])
    visuals = [
        *case.visuals(),
        *(panel.solid() for panel in panels),
        *stand,
        *grid_visuals,
        *heater_visuals,
        *details,
        slots(
            sill,
            0,
            (0.012, 0.022),
            count=int(0.6 * (door_high[1] - door_low[1]) / 0.030),
            pitch=0.030,
        ),
        slots(side, 1, (0.030, 0.004), count=12, pitch=0.010),
        slots(side * [1, -1, 1], 1, (0.030, 0.004), count=12, pitch=0.010),
    ]
    solid = [*case.solid(), *(panel.solid() for panel in panels), *stand, *grid, *heaters, *knobs]
    return solid, visuals


def _heaters(o: Oven, low: np.ndarray, high: np.ndarray) -> tuple[list[Shape], list[Shape]]:
    """Two tubes below the ceiling, from wall to wall."""
    if not o.heaters:
        return [], []
    z, tubes, solid = high[2] - HEATER_BELOW, [], []
    for share in (0.35, 0.70):
        x = low[0] + share * (high[0] - low[0])
        ends = np.array([[x, low[1], z], [x, high[1], z]])
        tubes.append(trimesh.creation.cylinder(HEATER_RADIUS, segment=ends, sections=10))
        reach = np.array([HEATER_RADIUS, 0.0, HEATER_RADIUS])
        solid.append(box(ends[0] - reach, ends[1] + reach))
    return [merged(tubes, HEATER)], solid


def _controls(o: Oven, panel: Panel) -> tuple[list[Shape], list[Shape]]:
    """Dials down the panel or along the strip, and a display between them: visuals, and solid."""
    width, height = panel.size
    if o.panel:
        radius = min(0.24 * width, 0.26 * height / o.dials)
        return dials(panel, [panel.at(0.5, (k + 0.5) / o.dials) for k in range(o.dials)], radius)
    places = [panel.at(share, 0.5) for share in ALONG_STRIP[o.dials]]
    visuals, solid = dials(panel, places, min(0.26 * height, 0.024))
    if o.time:
        size = 0.22 * width, 0.50 * height
        visuals += display(panel, panel.at(0.5, 0.5), size, o.time, rgba=AMBER)
    return visuals, solid


def _door(o: Oven) -> Part:
    case = _case(o)
    low, high = _door_outline(o)
    leaf = framed(
        low,
        high,
        (o.rail, o.rail, o.rail, o.rail + o.grip),
        Pane(inset=0.002, thickness=min(0.010, o.door - 0.008), rgba=o.window, density=GLASS),
        rgba=o.front_rgba,
        density=o.frame_density,
        corners=(0.003, 0.006),
    )
    foot = np.array([low[0], (low[1] + high[1]) / 2, high[2] - (o.rail + o.grip) / 2])
    handle = o.handle.mounted(foot, "level")
    joint = Joint(
        kind="hinge",
        origin=np.array([high[0], (low[1] + high[1]) / 2, low[2]]),
        axis=np.array([0.0, -1.0, 0.0]),
        range=(0.0, o.swing),
        frictionloss=o.friction,
        damping=o.damping,
    )
    ceiling = HEATER_BELOW + HEATER_RADIUS if o.heaters else 0.0
    cavity = space_between(
        case.inner_low + [0.0, 0.0, o.rack],
        case.inner_high - [0.0, 0.0, ceiling],
        moves_with_part=False,
    )
    return moving("door", [leaf], handle, joint, cavity, balanced=BALANCED)
