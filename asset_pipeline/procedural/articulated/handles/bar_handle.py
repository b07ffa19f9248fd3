"""A bar handle on two posts."""

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
from asset_pipeline.procedural.articulated.handles.portion import portion
from asset_pipeline.procedural.solids import box, rounded_box
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup


@dataclass(frozen=True)
class BarHandle:
    """Sizes [m]: length and thickness of the bar, its standoff (free space between it and the
    face), how far each post stands from the bar's end, and the colour."""

    length: float = 0.130
    thickness: float = 0.011
    standoff: float = 0.036
    inset: float = 0.014
    rounding: float = 0.002
    rgba: Colour = (0.16, 0.16, 0.17, 1.0)

    def mounted(self, foot: Float[np.ndarray, "3"], direction: Direction) -> Mounted:
        """The handle in its place, see `Handle`; the label is that of the bar."""
        along = 1 if direction == "level" else 2
        half = self.thickness / 2
        middle = np.asarray(foot, float) - [self.standoff + half, 0.0, 0.0]
        reach = np.full(3, half)
        reach[along] = self.length / 2
        bar = (middle - reach, middle + reach)
        posts: list[tuple[np.ndarray, np.ndarray]] = []
        for sign in (-1.0, 1.0):
            centre = middle.copy()
            centre[along] += sign * (self.length / 2 - self.inset)
            low, high = centre - 0.9 * half, centre + 0.9 * half
            low[0], high[0] = middle[0] + half, foot[0]
            posts.append((low, high))
        collision = tuple(box(*ends, self.rgba) for ends in (bar, *posts))
        visual = (
            rounded_box(*bar, self.rounding, self.rgba),
            *(box(*ends, self.rgba) for ends in posts),
        )
        label = PoseLabel(
            origin=middle,
            rotation=handle_axes(direction),
            object_type="handle",
            extents=np.array([self.length, self.thickness, self.thickness]),
            # Half a turn about Y swaps the ends of the bar and the posts.
            symmetry=SymmetryGroup(np.stack([np.eye(3), np.diag([-1.0, 1.0, -1.0])])),
        )
        return Mounted(portion(visual, collision, ALUMINIUM), label)
