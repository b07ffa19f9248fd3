"""A cabinet from its sizes: its carcass, and the drawers and doors that its layout asks for."""

from __future__ import annotations

from typing import Literal

import numpy as np

from asset_pipeline.procedural.articulated.assembly.parts import (
    Part,
    articulated_specimen,
    moving,
    space_between,
)
from asset_pipeline.procedural.articulated.cabinets.carcass import carcass
from asset_pipeline.procedural.articulated.cabinets.front_panel import Pane, framed, slab
from asset_pipeline.procedural.articulated.cabinets.layout import Cell
from asset_pipeline.procedural.articulated.cabinets.sizes import WOOD, Cabinet
from asset_pipeline.procedural.articulated.handles.portion import Portion, portion
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import Colour, Specimen
from manipose_mj.assets.geometry import Joint

GLASS, GLASS_THICKNESS = 2500.0, 0.004
GLASS_RGBA: Colour = (0.62, 0.74, 0.76, 0.35)
RECESS = 0.006  # of a framed front's wooden pane behind its frame [m]
FRAMED_FROM = 0.17  # lower fronts than this are slabs [m]
HANDLE_EDGE = 0.032  # from a door's free edge to its handle [m]


def furniture(cabinet: Cabinet) -> Specimen:
    """The cabinet, everything shut."""
    parts = [part for cell in cabinet.layout.cells for part in _parts(cabinet, cell)]
    return articulated_specimen([carcass(cabinet)], parts)


def _parts(c: Cabinet, cell: Cell) -> list[Part]:
    if cell.kind == "drawer":
        return [_drawer(c, cell)]
    cover, clear = c.across.cover(cell.columns, c.gap), c.across.clear(cell.columns)
    if cell.kind == "door":
        return [_door(c, cell, cell.name, cell.hinge, cover, clear)]
    middle = (cover[0] + cover[1]) / 2
    return [
        _door(
            c,
            cell,
            f"right_{cell.name}",
            "right",
            (cover[0], middle - c.gap / 2),
            (clear[0], middle),
        ),
        _door(
            c,
            cell,
            f"left_{cell.name}",
            "left",
            (middle + c.gap / 2, cover[1]),
            (middle, clear[1]),
        ),
    ]


def _heights(c: Cabinet, cell: Cell) -> tuple[float, float]:
    """From where to where a front reaches: a gap above the floor, and one below a crown."""
    low, high = c.upward.cover(cell.rows, c.gap)
    on_top = cell.rows[1] == c.upward.count and c.crown > 0
    return low + (c.gap if cell.rows[0] == 0 else 0.0), high - (c.gap if on_top else 0.0)


def _drawer(c: Cabinet, cell: Cell) -> Part:
    low, high = c.upward.clear(cell.rows)
    y, z = c.across.cover(cell.columns, c.gap), _heights(c, cell)
    clear = c.across.clear(cell.columns)
    side = clear[0] + c.gap, clear[1] - c.gap
    floor, back = low + c.gap + c.wall, c.face + c.inner_depth
    top = floor + c.wall_height
    inner = side[0] + c.wall, side[1] - c.wall
    boards = [
        ((c.face, side[0], low + c.gap), (back + c.wall, side[1], floor)),
        ((c.face, side[0], floor), (back + c.wall, inner[0], top)),
        ((c.face, inner[1], floor), (back + c.wall, side[1], top)),
        ((back, inner[0], floor), (back + c.wall, inner[1], top)),
    ]
    shapes = tuple(box(*ends, c.inside) for ends in boards)
    cavity = space_between((c.face, inner[0], floor), (back, inner[1], high), moves_with_part=True)
    joint = Joint(
        kind="slide",
        origin=np.array([c.face, (side[0] + side[1]) / 2, low]),
        axis=np.array([-1.0, 0.0, 0.0]),
        range=(0.0, c.travel),
        frictionloss=c.drawer_friction,
        damping=c.drawer_damping,
    )
    tall = z[1] - z[0] >= FRAMED_FROM and c.style == "frame"
    panel, recess = _front(c, y, z, "frame" if tall else "slab")
    foot = np.array([c.face - c.front + recess, (y[0] + y[1]) / 2, (z[0] + z[1]) / 2])
    handle = c.handle.mounted(foot, "level")
    tray = portion(shapes, shapes, WOOD)
    return moving(cell.name, [panel, tray], handle, joint, cavity)


def _door(
    c: Cabinet,
    cell: Cell,
    name: str,
    hinge: Literal["left", "right"],
    y: tuple[float, float],
    clear: tuple[float, float],
) -> Part:
    """A door over the columns' `y`, before the space between `clear`, turning about its outer edge."""
    z = _heights(c, cell)
    low, high = c.upward.clear(cell.rows)
    shelves = c.shelf_heights(cell)
    cavity = space_between(
        (-c.depth / 2, clear[0], low),
        (c.depth / 2 - c.board, clear[1], shelves[0] if shelves else high),
        moves_with_part=False,
    )
    # About the inner outer edge, the door swings clear of the carcass.
    on_left = hinge == "left"
    joint = Joint(
        kind="hinge",
        origin=np.array([c.face, y[1] if on_left else y[0], c.height / 2]),
        axis=np.array([0.0, 0.0, -1.0 if on_left else 1.0]),
        range=(0.0, c.swing),
        frictionloss=c.door_friction,
        damping=c.door_damping,
    )
    panel, _ = _front(c, y, z, c.style)
    free = y[0] + HANDLE_EDGE if on_left else y[1] - HANDLE_EDGE
    reach = c.handle.length / 2 + 0.02
    at = float(np.clip(z[0] + cell.handle_at * (z[1] - z[0]), z[0] + reach, z[1] - reach))
    foot = np.array([c.face - c.front, free, at])
    return moving(name, [panel], c.handle.mounted(foot, "upright"), joint, cavity)


def _front(
    c: Cabinet, y: tuple[float, float], z: tuple[float, float], style: str
) -> tuple[Portion, float]:
    """The panel, and how far its middle lies behind its outer side [m]."""
    low, high = np.array([c.face - c.front, y[0], z[0]]), np.array([c.face, y[1], z[1]])
    if style == "slab":
        return slab(low, high, rgba=c.front_rgba, density=WOOD), 0.0
    if style == "glass":
        inset = (c.front - GLASS_THICKNESS) / 2
        pane = Pane(inset, GLASS_THICKNESS, GLASS_RGBA, GLASS)
    else:
        pane = Pane(RECESS, c.front - RECESS, c.front_rgba, WOOD)
    rails = (c.rail, c.rail, c.rail, c.rail)
    return framed(low, high, rails, pane, rgba=c.front_rgba, density=WOOD), pane.inset
