"""The strap with a snap button that keeps a diary or a wallet shut."""

from __future__ import annotations

import numpy as np

from asset_pipeline.procedural.moulded import facing, raised
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.solids import ellipse
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.swept import bar
from manipose_mj.assets.geometry import Shape

THICKNESS = 0.0028  # [m]
BUTTON = (0.0058, 0.0022)  # radius and height [m]
ARC_STEPS = 12


def snap_strap(
    *,
    start: float,
    edge: float,
    past: float,
    height: float,
    width: float,
    rgba: Colour,
    metal: Colour,
) -> Piece:
    """From below the edge of a thing on z = 0, around it in a half circle, and onto its upper side.

    Args:
      start: Where its end on the upper side lies, x [m].
      edge: Where the thing ends, x [m].
      past: How far the strap reaches beyond that [m].
      height: Of the thing [m].
      width: Of the strap, about y = 0 [m].
      rgba: The strap's colour.
      metal: The button's.
    """
    top, low = height + THICKNESS / 2, THICKNESS / 2
    radius = (top - low) / 2
    middle = np.array([edge + past - THICKNESS / 2 - radius, 0.0, (top + low) / 2])
    angles = np.linspace(np.pi / 2, -np.pi / 2, ARC_STEPS + 1)
    arc = middle + radius * np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    line = np.concatenate([[[start, 0.0, top]], arc, [[edge - 0.001, 0.0, low]]])
    half = np.tile([THICKNESS / 2, width / 2], (len(line), 1))
    stops = (1, *range(3, ARC_STEPS + 1, 2), ARC_STEPS + 1)
    strap = bar(line, half, parts=stops, rgba=rgba, density=800.0, power=8.0)
    face = facing((0, 0, 1), (start + 0.45 * width, 0.0, height + THICKNESS), up=(0, 1, 0))
    radius, rise = BUTTON
    button = raised(ellipse((radius, radius), 24), face, rise, metal, shrink=0.8)
    stud = Shape("cylinder", (0.95 * radius, 0.5 * rise), face)
    return Piece((*strap.visual, button), (*strap.collision, stud), strap.mass)
