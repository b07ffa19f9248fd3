"""Closed bodies of revolution about z, of an even mean density: bottles with content, flasks, fruit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.revolution import revolved_mass
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.turned import banded, stacked_parts
from manipose_mj.assets.geometry import Shape

LEVEL = 1e-5  # a rise less than this is a flat [m]


def filled(
    profile: Float[np.ndarray, "n 2"],
    *,
    density: float,
    bands: Sequence[tuple[float, Colour]],
    tolerance: float = 0.0008,
    sections: int = 64,
) -> Piece:
    """A body of revolution with as many frusta to collide with as its outline needs.

    Args:
      profile: `(r, z)` [m] from the axis at the bottom, up the outside, to the axis at the top; it
        may run downwards under a foot ring and inside a top rim.
      density: [kg/m^3]; the mean of a wall and what is within.
      bands: Upper end [m] and colour of each band, from the bottom; the last goes to the top.
      tolerance: Of the collision parts' radii against the profile [m].
      sections: Facets of what is seen.
    """
    return Piece(
        banded(profile, bands, sections),
        frusta(profile, tolerance),
        revolved_mass(profile, density),
    )


def frusta(profile: Float[np.ndarray, "n 2"], tolerance: float) -> tuple[Shape, ...]:
    """Cylinders and frusta that follow the outside of a profile; recesses at its ends are filled."""
    heights = profile[:, 1]
    first, last = int(heights.argmin()), len(heights) - 1 - int(heights[::-1].argmax())
    line = shapely.LineString(profile[first : last + 1]).simplify(tolerance)
    corners = np.array(line.coords)
    shapes: list[Shape] = []
    for (r_low, low), (r_high, high) in zip(corners[:-1], corners[1:], strict=True):
        if high - low > LEVEL:
            part = np.array([[0.0, low], [r_low, low], [r_high, high], [0.0, high]])
            shapes += stacked_parts(part, (float(low), float(high)))
    return tuple(shapes)
