"""Straight handles and shafts along x: smooth sections, rounded ends, bands of colour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.revolution import MAX_PART_VERTICES, convex_part
from asset_pipeline.procedural.solids import loft
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose

# A collision part of a handle spans a stretch that bends by no more than this [m].
BEND = 0.0006
STEP = 0.008  # between stations [m]
END_STEPS = 6  # stations of a rounded end
# Poses of pieces made along z that are to lie along x, and along y.
ALONG_X = compose(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.zeros(3))
ALONG_Y = compose(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), np.zeros(3))


def superellipse(power: float, points: int = 32) -> Float[np.ndarray, "points 2"]:
    """The outline of a section of half lengths 1: 2 is an ellipse, 4 a rounded rectangle."""
    angles = np.arange(points) * (2 * np.pi / points)
    ring = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=1), 12)
    return np.sign(ring) * np.abs(ring) ** (2 / power)


def lobed(lobes: int, depth: float, points: int = 48) -> Float[np.ndarray, "points 2"]:
    """A circle of radius 1 with grooves along the handle, `depth` deep as a share of the radius."""
    angles = np.arange(points) * (2 * np.pi / points)
    radius = 1 - depth * (1 - np.cos(lobes * angles)) / 2
    return radius[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


ROUND = superellipse(2.0)


def handle(
    table: Sequence[tuple[float, float, float]],
    bands: Sequence[tuple[float, Colour]],
    *,
    density: float,
    outline: Float[np.ndarray, "points 2"] = ROUND,
    rounding: tuple[float, float] = (0.0, 0.0),
    centre: tuple[float, float] = (0.0, 0.0),
) -> Piece:
    """A massive handle whose sections change smoothly along x.

    Args:
      table: Rows of x, increasing, and the half lengths of the section along y and z [m].
      bands: Upper end along x [m] and colour of each band, from the first; the last goes to the end.
      density: [kg/m^3].
      outline: Of its sections, in the yz plane; a multiple of 16 points.
      rounding: Radii of the first and the last end's edges [m], less than the half lengths there.
      centre: y and z of its axis [m].
    """
    loops = handle_loops(table, [x for x, _ in bands[:-1]], outline, rounding, centre)
    mesh = loft(loops)
    ends = [0, *(int(np.argmin(abs(loops[:, 0, 0] - x))) for x, _ in bands[:-1]), len(loops) - 1]
    visual = tuple(
        Shape("mesh", mesh=loft(loops[a : b + 1], (a == 0, b == ends[-1])), rgba=rgba)
        for a, b, (_, rgba) in zip(ends[:-1], ends[1:], bands, strict=True)
    )
    mass = solid_mass_properties(mesh, density * float(mesh.volume))
    return Piece(visual, loop_hulls(loops), mass)


def handle_loops(
    table: Sequence[tuple[float, float, float]],
    extra: Sequence[float],
    outline: Float[np.ndarray, "points 2"],
    rounding: tuple[float, float] = (0.0, 0.0),
    centre: tuple[float, float] = (0.0, 0.0),
) -> Float[np.ndarray, "stations points 3"]:
    """The sections of `handle`, with stations at the `extra` values of x as well."""
    rows = np.array(table, float)
    start, stop = rows[[0, -1], 0]
    ends = 1 - np.cos(np.linspace(0, np.pi / 2, END_STEPS))
    even = np.linspace(start, stop, max(2, 1 + int(np.ceil((stop - start) / STEP))))
    x = np.concatenate([even, rows[:, 0], extra, start + rounding[0] * ends])
    x = np.unique(np.concatenate([x, stop - rounding[1] * ends]).round(7))
    half = np.stack([PchipInterpolator(rows[:, 0], rows[:, k])(x) for k in (1, 2)], axis=1)
    for depth, radius in ((x - start, rounding[0]), (stop - x, rounding[1])):
        inside = np.clip(radius - depth, 0, radius)
        half = half - (radius - np.sqrt(radius**2 - inside**2))[:, None]
    across = half[:, None] * outline + centre
    along = np.broadcast_to(x[:, None, None], (*across.shape[:2], 1))
    return np.concatenate([along, across], axis=2)


def loop_hulls(loops: Float[np.ndarray, "stations points 3"]) -> tuple[Shape, ...]:
    """Convex parts, each between two loops, as few as follow the loops to within `BEND`.

    Of loops with many points every second (third ...) one counts, 16 at most.
    """
    stride = -(-loops.shape[1] // (MAX_PART_VERTICES // 2))
    corners = loops[:, ::stride]
    shapes, start = [], 0
    while start < len(loops) - 1:
        stop = start + 1
        while stop + 1 < len(loops) and _bend(corners[start : stop + 2]) < BEND:
            stop += 1
        shapes.append(convex_part(corners[[start, stop]].reshape(-1, 3)))
        start = stop
    return tuple(shapes)


def _bend(loops: Float[np.ndarray, "stations points 3"]) -> float:
    """How far loops lie from the straight lines between the corners of the first and the last [m]."""
    first, last = loops[0], loops[-1]
    chord = last - first
    direction = chord / np.linalg.norm(chord, axis=1, keepdims=True)
    offset = loops - first
    along = np.einsum("spk,pk->sp", offset, direction)
    return float(np.linalg.norm(offset - along[..., None] * direction, axis=2).max())
