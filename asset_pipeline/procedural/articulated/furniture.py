"""A cabinet from its sizes and its layout: carcass, drawers and doors.

Frame: z up, origin at the centre of the bottom face (of the feet, where it has some), front towards -x.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Literal

import numpy as np

from asset_pipeline.geometry import Joint, Shape
from asset_pipeline.mass import shape_mass_properties
from asset_pipeline.procedural.articulated.assembly import (
    Part,
    articulated_specimen,
    moving,
    space_between,
)
from asset_pipeline.procedural.articulated.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.front_panel import Pane, framed, slab
from asset_pipeline.procedural.articulated.layout import Cell, Layout, Lines, levels, uprights
from asset_pipeline.procedural.articulated.mounted import Handle
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import Colour, Specimen

WOOD = 680.0  # [kg/m^3], between particle board and beech
GLASS, GLASS_THICKNESS = 2500.0, 0.004
GLASS_RGBA: Colour = (0.62, 0.74, 0.76, 0.35)
RECESS = 0.004  # of a framed front's wooden pane behind its frame [m]
FRAMED_FROM = 0.17  # lower fronts than this are slabs [m]
SHELF_BACK = 0.02  # how far shelves stand behind the carcass's front [m]
FOOT, FOOT_INSET = 0.034, 0.012
HANDLE_EDGE = 0.032  # from a door's free edge to its handle [m]


@dataclass(frozen=True)
class Cabinet:
    """Sizes [m], colours, and how the joints resist.

    Attributes:
      layout: How the front is divided, and into what.
      depth: Of the carcass.
      board, front: Thickness of the carcass's boards and of the drawers' fronts and the doors.
      gap: Between all that moves and all else.
      wall, wall_height: Of a drawer's sides and back; its floor is as thick.
      inner_depth: Of a drawer.
      travel: Of a drawer [m]; swing: of a door [rad].
      feet: Height of four feet under the carcass.
      crown: Thickness of a top that overhangs the carcass, overhang: and by how much.
      style: Of the doors and the tall drawers' fronts; glass is for doors only.
      drawer_friction [N], drawer_damping [N s/m], door_friction [N m], door_damping [N m s/rad].
      handle: On every front; wood, front_rgba, inside: colours.
    """

    layout: Layout
    depth: float = 0.400
    board: float = 0.012
    front: float = 0.012
    gap: float = 0.003
    wall: float = 0.007
    wall_height: float = 0.055
    inner_depth: float = 0.340
    travel: float = 0.320
    swing: float = radians(110)
    feet: float = 0.0
    crown: float = 0.0
    overhang: float = 0.012
    style: Literal["slab", "frame", "glass"] = "slab"
    rail: float = 0.050
    drawer_friction: float = 2.0
    drawer_damping: float = 8.0
    door_friction: float = 0.25
    door_damping: float = 0.3
    handle: Handle = BarHandle()
    wood: Colour = (0.86, 0.73, 0.55, 1.0)
    front_rgba: Colour = (0.76, 0.58, 0.39, 1.0)
    inside: Colour = (0.91, 0.83, 0.69, 1.0)

    @property
    def width(self) -> float:
        """Of the carcass."""
        clear = self.layout.columns
        return sum(clear) + (len(clear) + 1) * self.board

    @property
    def height(self) -> float:
        """Of the carcass, with feet and without the overhanging top."""
        clear = self.layout.rows
        return self.feet + sum(clear) + (len(clear) + 1) * self.board

    @property
    def across(self) -> Lines:
        """The lines between the columns, along y."""
        return Lines.between(self.layout.columns, self.board, -self.width / 2)

    @property
    def upward(self) -> Lines:
        """The lines between the rows, along z."""
        return Lines.between(self.layout.rows, self.board, self.feet)

    @property
    def face(self) -> float:
        """Where the inner sides of the fronts are, along x."""
        return -self.depth / 2 - self.gap


def furniture(cabinet: Cabinet) -> Specimen:
    """The cabinet, everything shut."""
    parts = [part for cell in cabinet.layout.cells for part in _parts(cabinet, cell)]
    return articulated_specimen([_carcass(cabinet)], parts)


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


def _carcass(c: Cabinet) -> Piece:
    x, y, t, low = c.depth / 2, c.width / 2, c.board, c.feet
    top = c.height
    across, upward = c.across, c.upward
    whole = [0, *(k for k, run in uprights(c.layout) if run == (0, upward.count)), across.count]
    sides = [((-x, -y, low + t), (x, -y + t, top - t))]
    sides += [
        ((-x, across.at[k] - t / 2, low + t), (x, across.at[k] + t / 2, top - t))
        for k in whole[1:-1]
    ]
    sides += [((-x, y - t, low + t), (x, y, top - t))]
    covers = [((-x, -y, low), (x, y, low + t)), ((-x, -y, top - t), (x, y, top))]
    inner = []
    for k, run in uprights(c.layout):
        if k not in whole:
            z = upward.clear(run)
            inner.append(((-x, across.at[k] - t / 2, z[0]), (x - t, across.at[k] + t / 2, z[1])))
    for k, span in levels(c.layout):
        ends, z = across.clear(span), upward.at[k] - t / 2
        inner.append(((-x, ends[0], z), (x - t, ends[1], z + t)))
    for cell in c.layout.cells:
        ends = across.clear(cell.columns)
        for z in _shelf_heights(c, cell):
            inner.append(((-x + SHELF_BACK, ends[0], z), (x - t, ends[1], z + t)))
    for first, last in zip(whole[:-1], whole[1:], strict=True):
        ends = across.clear((first, last))
        inner.append(((x - t, ends[0], low + t), (x, ends[1], top - t)))
    shapes = [box(*ends, c.wood) for ends in (*covers, *sides)]
    shapes += [box(*ends, c.inside) for ends in inner]
    shapes += _feet_and_crown(c)
    return Piece(tuple(shapes), tuple(shapes), shape_mass_properties(shapes, WOOD))


def _feet_and_crown(c: Cabinet) -> list[Shape]:
    x, y = c.depth / 2, c.width / 2
    shapes = []
    if c.feet:
        for sx in (-1, 1):
            for sy in (-1, 1):
                middle = np.array([sx * (x - FOOT_INSET), sy * (y - FOOT_INSET), c.feet / 2])
                middle[:2] -= np.array([sx, sy]) * FOOT / 2
                half = np.array([FOOT, FOOT, c.feet]) / 2
                shapes.append(box(middle - half, middle + half, c.wood))
    if c.crown:
        front = c.face - c.front - c.overhang
        low = (front, -y - c.overhang, c.height)
        shapes.append(box(low, (x, y + c.overhang, c.height + c.crown), c.wood))
    return shapes


def _shelf_heights(c: Cabinet, cell: Cell) -> list[float]:
    """Of the undersides of the shelves behind a door."""
    low, high = c.upward.clear(cell.rows)
    bay = (high - low - cell.shelves * c.board) / (cell.shelves + 1)
    return [low + (k + 1) * bay + k * c.board for k in range(cell.shelves)]


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
    tray = Piece(shapes, shapes, shape_mass_properties(shapes, WOOD))
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
    shelves = _shelf_heights(c, cell)
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
) -> tuple[Piece, float]:
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
