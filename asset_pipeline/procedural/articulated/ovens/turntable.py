"""A microwave oven's turntable: a glass disc with a raised rim, on a hub. It does not turn."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import placed_shape
from asset_pipeline.procedural.revolution import convex_part, lathe
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose

TOP = 0.012  # of the disc above the cavity's floor [m]
THICKNESS = 0.005
RIM, RIM_WIDTH = 0.002, 0.004  # the rim is so much higher; it is only seen
HUB = 0.030  # radius
CORNERS = 16
RGBA: Colour = (0.78, 0.87, 0.88, 0.55)


def turntable(floor: Float[np.ndarray, "3"], diameter: float) -> tuple[list[Shape], list[Shape]]:
    """What is seen, and what is touched.

    Args:
      floor: `(3,)`, the point of the cavity's floor below the middle [m].
      diameter: [m].
    """
    pose, radius = compose(np.eye(3), floor), diameter / 2
    outline = [
        (0.0, 0.0),
        (HUB, 0.0),
        (HUB, TOP - THICKNESS),
        (radius - RIM_WIDTH / 4, TOP - THICKNESS),
        (radius, TOP + RIM),
        (radius - RIM_WIDTH, TOP + RIM),
        (radius - 2 * RIM_WIDTH, TOP),
        (0.0, TOP),
    ]
    disc = Shape("mesh", mesh=lathe(np.array(outline), 48), rgba=RGBA)
    solid = (_prism(radius, TOP - THICKNESS, TOP), _prism(HUB, 0.0, TOP - THICKNESS))
    return [placed_shape(disc, pose)], [placed_shape(shape, pose) for shape in solid]


def _prism(radius: float, low: float, high: float) -> Shape:
    """For a disc about z: half as far outside the circle as inside."""
    angles = (np.arange(CORNERS) + 0.5) * (2 * np.pi / CORNERS)
    reach = radius * (1 + 1 / np.cos(np.pi / CORNERS)) / 2
    ring = reach * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ends = [np.column_stack([ring, np.full(CORNERS, z)]) for z in (low, high)]
    return convex_part(np.concatenate(ends))
