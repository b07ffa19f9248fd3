"""An arched handle: a strap that leaves the face, bends over and comes back.

Sold bow handles have feet 96, 128 or 160 mm apart and stand 28-38 mm off the face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.articulated.handles.mounted import (
    ALUMINIUM,
    Direction,
    Mounted,
    handle_axes,
)
from asset_pipeline.procedural.articulated.handles.portion import moved, portion
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.swept import bar_loops, convex_chunks, loft_outwards
from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose

STATIONS, PARTS, POINTS = 25, 8, 12


@dataclass(frozen=True)
class BowHandle:
    """Sizes [m]: span between the feet's middles, width of the strap along the face and its
    thickness, standoff (free space behind the top of the arch); `power`, 2 for an ellipse, more
    for a flatter top; the colour."""

    span: float = 0.128
    width: float = 0.010
    thickness: float = 0.010
    standoff: float = 0.032
    power: float = 3.5
    rgba: Colour = (0.16, 0.16, 0.17, 1.0)

    @property
    def length(self) -> float:
        """With the feet."""
        return self.span + self.thickness

    def mounted(self, foot: Float[np.ndarray, "3"], direction: Direction) -> Mounted:
        """The handle in its place, see `Handle`; the label's origin is the top of the arch's line."""
        rise = self.standoff + self.thickness / 2
        angles = np.linspace(np.pi, 0.0, STATIONS)
        along, out = np.cos(angles), np.sin(angles)
        line = np.stack(
            [
                self.span / 2 * np.sign(along) * np.abs(along) ** (2 / self.power),
                rise * np.clip(out, 0.0, 1.0) ** (2 / self.power),
                np.zeros(STATIONS),
            ],
            axis=1,
        )
        half = np.tile([self.thickness / 2, self.width / 2], (STATIONS, 1))
        loops = bar_loops(line, half, sideways=(0.0, 0.0, 1.0), power=4.0, points=POINTS)
        loops[[0, -1], :, 1] = 0.0  # the feet stand flat on the face
        arch = Shape("mesh", mesh=loft_outwards(loops), rgba=self.rgba)
        bow = portion([arch], convex_chunks(loops, PARTS), ALUMINIUM)
        rotation = handle_axes(direction)
        label = PoseLabel(
            origin=np.asarray(foot, float) + rise * rotation[:, 1],
            rotation=rotation,
            object_type="handle",
            extents=np.array([self.length, self.thickness, self.width]),
            symmetry=SymmetryGroup(np.stack([np.eye(3), np.diag([-1.0, 1.0, -1.0])])),
        )
        return Mounted(moved(bow, compose(rotation, np.asarray(foot, float))), label)
