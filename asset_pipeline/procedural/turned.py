"""Massive pieces of revolution about z: knobs, wheels, barrels, fruit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.revolution import convex_part, lathe, revolved_mass
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

RING_CORNERS = 16
_EVEN = 1e-6  # radii closer than this make a cylinder [m]


def turned(
    profile: Float[np.ndarray, "n 2"],
    levels: Sequence[float],
    *,
    bands: Sequence[tuple[float, Colour]],
    density: float,
    sections: int = 64,
) -> Piece:
    """A solid of revolution.

    Args:
      profile: `(r, z)` [m] from the axis at the bottom, up the outside, to the axis at the top.
      levels: Heights [m], increasing, at which its convex collision parts are cut, both ends
        included; between two cuts of equal radius there is a cylinder.
      bands: Upper end [m] and colour of each band, from the bottom; the last goes to the top.
      density: [kg/m^3].
      sections: Facets of what is seen.
    """
    return Piece(
        banded(profile, bands, sections),
        stacked_parts(profile, levels),
        revolved_mass(profile, density),
    )


def banded(
    profile: Float[np.ndarray, "n 2"], bands: Sequence[tuple[float, Colour]], sections: int
) -> tuple[Shape, ...]:
    """The surface of a profile that runs downwards below the first cut only, coloured by height.

    `bands` as in `turned`.
    """
    radius, height = profile[:, 0], np.maximum.accumulate(profile[:, 1])
    shapes, start = [], 0
    line: list[np.ndarray] = []
    for number, (top, rgba) in enumerate(bands):
        last = number == len(bands) - 1
        stop = len(profile) if last else int(np.searchsorted(height, top, side="right"))
        part = [*line, *profile[start:stop]]
        if not last:
            cut = np.array([np.interp(top, height, radius), top])
            if not np.allclose(part[-1], cut, rtol=0, atol=_EVEN):
                part.append(cut)
            line = [cut]
        shapes.append(Shape("mesh", mesh=lathe(np.array(part), sections), rgba=rgba))
        start = stop
    return tuple(shapes)


def stacked_parts(profile: Float[np.ndarray, "n 2"], levels: Sequence[float]) -> tuple[Shape, ...]:
    """Cylinders and frusta between successive levels; their rings circumscribe nothing.

    A ring's corners lie on the circle, so flats are inside it by at most 2 % of the radius.
    """
    outside = profile[1:-1] if profile[0, 0] == 0 else profile
    radii = np.interp(levels, outside[:, 1], outside[:, 0])
    shapes = []
    for low, high, r_low, r_high in zip(
        levels[:-1], levels[1:], radii[:-1], radii[1:], strict=True
    ):
        if abs(r_high - r_low) < _EVEN:
            pose = np.eye(4)
            pose[2, 3] = (low + high) / 2
            shapes.append(Shape("cylinder", (float(r_low), (high - low) / 2), pose))
        else:
            shapes.append(convex_part(np.concatenate([_ring(r_low, low), _ring(r_high, high)])))
    return tuple(shapes)


def _ring(radius: float, height: float) -> Float[np.ndarray, "corners 3"]:
    if radius < _EVEN:
        return np.array([[0.0, 0.0, height]])
    angles = (np.arange(RING_CORNERS) + 0.5) * (2 * np.pi / RING_CORNERS)
    return np.column_stack(
        [radius * np.cos(angles), radius * np.sin(angles), np.full(RING_CORNERS, height)]
    )
