"""Bars along a curve: handles, shafts, rims, spouts."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece, solid_piece
from asset_pipeline.procedural.revolution import MAX_PART_VERTICES, convex_part
from asset_pipeline.procedural.solids import loft
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

LOOP_POINTS = 20


def bar_loops(
    line: Float[np.ndarray, "n 3"],
    half: Float[np.ndarray, "n 2"],
    *,
    sideways: Float[np.ndarray, "3"] | tuple[float, float, float] = (0.0, 1.0, 0.0),
    power: float = 2.0,
    points: int = LOOP_POINTS,
) -> Float[np.ndarray, "n points 3"]:
    """Superelliptic cross-sections along a plane curve.

    Args:
      line: Their centres [m], in a plane across `sideways`; no two the same.
      half: Half lengths of each, in the plane and along `sideways` [m].
      sideways: Unit vector.
      power: 2 is an ellipse, 4 a rounded rectangle, 10 nearly a rectangle.
      points: Around each loop; a multiple of four reaches all four extremes.
    """
    across = np.asarray(sideways, float)
    tangents = np.gradient(line, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    normals = np.cross(across, tangents)
    angles = np.arange(points) * (2 * np.pi / points)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ring = np.sign(ring) * np.abs(ring) ** (2 / power)
    offset = half[:, None] * ring
    return line[:, None] + offset[..., :1] * normals[:, None] + offset[..., 1:] * across


def bar(
    line: Float[np.ndarray, "n 3"],
    half: Float[np.ndarray, "n 2"],
    *,
    parts: int | tuple[int, ...],
    rgba: Colour,
    density: float,
    sideways: Float[np.ndarray, "3"] | tuple[float, float, float] = (0.0, 1.0, 0.0),
    power: float = 2.0,
) -> Piece:
    """A massive bar along a plane curve; arguments as in `bar_loops`.

    Args:
      parts: Number of convex collision parts, of equally many stations, or the stations' indices at
        which one part ends and the next begins (the first and the last station are implied).
      rgba: Its colour.
      density: [kg/m^3].
    """
    loops = bar_loops(line, half, sideways=sideways, power=power)
    return solid_piece(
        loft_outwards(loops), convex_chunks(loops, parts), rgba=rgba, density=density
    )


def loft_outwards(loops: Float[np.ndarray, "l p 3"]) -> trimesh.Trimesh:
    """The closed surface through loops of either sense of rotation, normals outwards."""
    mesh = loft(loops)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def convex_chunks(
    loops: Float[np.ndarray, "l p 3"], parts: int | tuple[int, ...]
) -> tuple[Shape, ...]:
    """Hulls of successive stretches of loops that share their end loops; `parts` as in `bar`."""
    last = len(loops) - 1
    if isinstance(parts, int):
        ends = np.round(np.linspace(0, last, parts + 1)).astype(int)
    else:
        ends = np.array([0, *parts, last])
    shapes = []
    for start, stop in zip(ends[:-1], ends[1:], strict=True):
        chosen = sorted({int(start), int((start + stop) // 2), int(stop)})
        stride = -(-loops.shape[1] // (MAX_PART_VERTICES // len(chosen)))
        shapes.append(convex_part(loops[chosen, ::stride].reshape(-1, 3)))
    return tuple(shapes)
