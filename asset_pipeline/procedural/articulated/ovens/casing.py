"""The hollow case of a kitchen appliance: walls around a cavity, lined, with vents and feet.

Front towards -x, z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.articulated.cabinets.front_panel import (
    merged,
    plate_mesh,
    ring_boxes,
    ring_mesh,
)
from asset_pipeline.procedural.solids import PRINT_THICKNESS, box
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

LINING = 3 * PRINT_THICKNESS  # what is seen of the cavity's enamel stands so far off the walls [m]
FOOT = 0.030
FOOT_INSET = 0.025
Point = Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Case:
    """Attributes: low, high, outer corners; inner_low, inner_high, of the cavity, which is open at
    the front; corner, radius of the edges from front to back [m]; rgba, outside; lining, inside."""

    low: Point
    high: Point
    inner_low: Point
    inner_high: Point
    corner: float
    rgba: Colour
    lining: Colour

    def solid(self) -> list[Shape]:
        """Five walls."""
        back = self.high[0]
        walls = ring_boxes(
            self.low,
            np.array([self.inner_high[0], *self.high[1:]]),
            self.inner_low,
            self.inner_high,
        )
        rear = (np.array([self.inner_high[0], *self.low[1:]]), np.array([back, *self.high[1:]]))
        return [box(*ends, self.rgba) for ends in (*walls, rear)]

    def visuals(self) -> list[Shape]:
        """The case with rounded edges, and the enamel of the cavity."""
        outer = (self.low[1:], self.high[1:], self.corner)
        ring = ring_mesh(
            (self.low[0], self.inner_high[0]), outer, (self.inner_low[1:], self.inner_high[1:], 0.0)
        )
        rear = plate_mesh((self.inner_high[0], self.high[0]), outer)
        a, b, t = self.inner_low, self.inner_high, LINING
        enamel = [
            ((a[0], a[1], a[2]), (b[0], b[1], a[2] + t)),
            ((a[0], a[1], b[2] - t), (b[0], b[1], b[2])),
            ((a[0], a[1], a[2]), (b[0], a[1] + t, b[2])),
            ((a[0], b[1] - t, a[2]), (b[0], b[1], b[2])),
            ((b[0] - t, a[1], a[2]), (b[0], b[1], b[2])),
        ]
        rim = ring_mesh(
            (a[0] - t, a[0]), (a[1:] - 0.010, b[1:] + 0.010, 0.006), (a[1:], b[1:], 0.0)
        )
        return [
            merged([ring, rear], self.rgba),
            merged([rim, *(box(*ends).surface() for ends in enamel)], self.lining),
        ]


def feet(low: Point, high: Point, *, rgba: Colour) -> list[Shape]:
    """Four square feet from the floor, z = 0, up to the case."""
    middle, half = (low + high) / 2, (high - low) / 2 - FOOT_INSET
    return [
        box(
            (middle[0] + sx * half[0] - FOOT / 2, middle[1] + sy * half[1] - FOOT / 2, 0.0),
            (middle[0] + sx * half[0] + FOOT / 2, middle[1] + sy * half[1] + FOOT / 2, low[2]),
            rgba,
        )
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]


def slots(
    centre: Point,
    axis: int,
    size: tuple[float, float],
    *,
    count: int,
    pitch: float,
    rgba: Colour = (0.05, 0.05, 0.06, 1.0),
) -> Shape:
    """A row of vents printed on a face across `axis`: dark stripes side by side.

    Args:
      centre: Of the row, on the face [m].
      axis: The face's normal.
      size: Of each stripe, across the row and along it [m]; on a side face, along z and along x; on
        top, along y and along x; in front, along z and along y.
      count: Of the stripes.
      pitch: Between their middles, along the row [m].
    """
    across, along = {0: (2, 1), 1: (2, 0), 2: (1, 0)}[axis]
    half = np.full(3, 2 * PRINT_THICKNESS)
    half[across], half[along] = size[0] / 2, size[1] / 2
    meshes: list[trimesh.Trimesh] = []
    for k in range(count):
        middle = centre.copy()
        middle[along] += (k - (count - 1) / 2) * pitch
        meshes.append(box(middle - half, middle + half).surface())
    return merged(meshes, rgba)
