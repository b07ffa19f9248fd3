"""What a cabinet is made to: its layout, its sizes, how its joints resist, and its colours.

Frame: z up, origin at the centre of the bottom face (of the feet, where it has some), front towards -x.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Literal

from asset_pipeline.procedural.articulated.cabinets.layout import Cell, Layout, Lines
from asset_pipeline.procedural.articulated.handles.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.handles.mounted import Handle
from asset_pipeline.procedural.specimen import Colour

WOOD = 680.0  # [kg/m^3], between particle board and beech


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

    def shelf_heights(self, cell: Cell) -> list[float]:
        """Of the undersides of the shelves behind a door."""
        low, high = self.upward.clear(cell.rows)
        bay = (high - low - cell.shelves * self.board) / (cell.shelves + 1)
        return [low + (k + 1) * bay + k * self.board for k in range(cell.shelves)]
