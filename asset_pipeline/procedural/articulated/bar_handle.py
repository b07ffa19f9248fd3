"""A bar handle on two posts, as drawers and doors carry it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry import Shape
from asset_pipeline.labelling.label import PoseLabel
from asset_pipeline.procedural.solids import box, rounded_box
from asset_pipeline.procedural.specimen import Colour
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


def bar_handle(
    handle: BarHandle, foot: Float[np.ndarray, "3"], direction: Literal["level", "upright"]
) -> tuple[tuple[Shape, ...], tuple[Shape, ...], PoseLabel]:
    """A handle on a face whose outward normal is -x.

    The label's X runs along the bar and Y outwards. Of X's two signs ours is the one with X up; for
    a level bar, the one with Z up.

    Args:
      handle: Its sizes.
      foot: `(3,)`, the point of the face behind the bar's middle [m].
      direction: Of the bar: along y, or along z.

    Returns:
      Collision boxes (bar, posts), what is seen, and the label of the bar, all in the object frame.
    """
    along = 1 if direction == "level" else 2
    half = handle.thickness / 2
    middle = np.asarray(foot, float) - [handle.standoff + half, 0.0, 0.0]
    reach = np.full(3, half)
    reach[along] = handle.length / 2
    bar = (middle - reach, middle + reach)
    posts: list[tuple[np.ndarray, np.ndarray]] = []
    for sign in (-1.0, 1.0):
        centre = middle.copy()
        centre[along] += sign * (handle.length / 2 - handle.inset)
        low, high = centre - 0.9 * half, centre + 0.9 * half
        low[0], high[0] = middle[0] + half, foot[0]
        posts.append((low, high))
    collision = tuple(box(*ends, handle.rgba) for ends in (bar, *posts))
    visual = (
        rounded_box(*bar, handle.rounding, handle.rgba),
        *(box(*ends, handle.rgba) for ends in posts),
    )
    x = np.eye(3)[along]
    y = np.array([-1.0, 0.0, 0.0])
    rotation = np.stack([x, y, np.cross(x, y)], axis=1)
    label = PoseLabel(
        origin=middle,
        rotation=rotation,
        object_type="handle",
        extents=np.array([handle.length, handle.thickness, handle.thickness]),
        # Half a turn about Y swaps the ends of the bar and the posts.
        symmetry=SymmetryGroup(np.stack([np.eye(3), np.diag([-1.0, 1.0, -1.0])])),
    )
    return collision, visual, label
