"""An edge pull: a lip in front of the face, carried by a web along its upper side.

Fingers go around the lip: one over the web, one under it into the free space behind. Sold edge and
profile pulls stand 25-40 mm off the face with lips of 10-15 mm.
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
from asset_pipeline.procedural.solids import box, rounded_box
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose


@dataclass(frozen=True)
class EdgePull:
    """Sizes [m]: length along the face; height of the lip along it and its thickness off it;
    standoff (free space behind the lip); thickness of the web; the colour."""

    length: float = 0.140
    height: float = 0.011
    thickness: float = 0.013
    standoff: float = 0.030
    web: float = 0.004
    rgba: Colour = (0.70, 0.71, 0.72, 1.0)

    def mounted(self, foot: Float[np.ndarray, "3"], direction: Direction) -> Mounted:
        """The pull in its place, see `Handle`.

        The label is that of the lip, which is what fingers close on, as a bar's leaves its posts out.
        The web is on the side of Z, so no turn maps the pull onto itself.
        """
        length, half = self.length / 2, self.height / 2
        middle = self.standoff + self.thickness / 2
        # In the label's axes, about the foot: X along the pull, Y outwards, Z towards the web.
        lip = (
            np.array([-length, self.standoff, -half]),
            np.array([length, middle + self.thickness / 2, half]),
        )
        web = (
            np.array([-length, 0.0, half - self.web]),
            np.array([length, self.standoff, half]),
        )
        collision = tuple(box(*ends, self.rgba) for ends in (lip, web))
        visual = (rounded_box(*lip, 0.35 * self.height, self.rgba), collision[1])
        pull = portion(visual, collision, ALUMINIUM)
        rotation = handle_axes(direction)
        label = PoseLabel(
            origin=np.asarray(foot, float) + middle * rotation[:, 1],
            rotation=rotation,
            object_type="handle",
            extents=np.array([self.length, self.thickness, self.height]),
            symmetry=SymmetryGroup.identity(),
        )
        return Mounted(moved(pull, compose(rotation, np.asarray(foot, float))), label)
