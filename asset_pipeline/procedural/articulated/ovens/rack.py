"""The grid that an oven holds: thin bars from front to back, on two across, and runners along the walls."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.articulated.cabinets.front_panel import merged
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

THICKNESS = 0.005  # of the bars [m]
INSET = 0.012  # from the cavity's front and back [m]
RUNNER = 0.012  # width of the ledges that carry the grid [m]
CHROME: Colour = (0.72, 0.73, 0.74, 1.0)
SIDES = 8


def rack(
    low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"], top: float, pitch: float
) -> tuple[list[Shape], list[Shape]]:
    """What is seen of a grid across a cavity, and its collision boxes.

    Args:
      low, high: Corners of the cavity, `(3,)` [m].
      top: Height of the grid's upper side [m].
      pitch: Between the bars; less than a ball of 6 cm needs to fall through [m].
    """
    half, z = THICKNESS / 2, top - THICKNESS / 2
    x = low[0] + INSET, high[0] - INSET
    y = low[1] + 0.003, high[1] - 0.003
    count = int(np.ceil((y[1] - y[0] - 2 * RUNNER) / pitch))
    bars = [
        ((x[0], b, z), (x[1], b, z)) for b in np.linspace(y[0] + RUNNER, y[1] - RUNNER, count + 1)
    ]
    # Below the bars, so that nothing crosses.
    bars += [
        ((a + half, y[0], z - THICKNESS), (a + half, y[1], z - THICKNESS))
        for a in (x[0], x[1] - THICKNESS)
    ]
    below = top - 2 * THICKNESS
    ledges = [
        box((x[0], low[1], below - 0.004), (high[0], y[0] + RUNNER, below), CHROME),
        box((x[0], y[1] - RUNNER, below - 0.004), (high[0], high[1], below), CHROME),
    ]
    rods, solid = [], []
    for start, stop in np.array(bars, float):
        rods.append(
            trimesh.creation.cylinder(half, segment=np.stack([start, stop]), sections=SIDES)
        )
        across = np.where(start == stop, half, 0.0)
        solid.append(box(start - across, stop + across, CHROME))
    return [merged(rods, CHROME), *ledges], [*solid, *ledges]
