"""Curved sheets of varying thickness: spoons, forks' tines, everything pressed or carved thin."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece, solid_piece
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.swept import loft_outwards
from manipose_mj.assets.geometry import Shape


def sheet(
    middle: Float[np.ndarray, "u v 3"],
    thickness: Float[np.ndarray, "u v"],
    *,
    cuts: tuple[tuple[int, int, int], ...],
    rgba: Colour,
    density: float,
) -> Piece:
    """A massive sheet about a curved middle surface, closed by flat ends.

    Args:
      middle: Points of the surface [m]: stations along it, and points across each station.
      thickness: Across the surface [m]; the sides are as thick as it is there.
      cuts: Convex collision parts: of each stretch of stations its first and last and how many parts
        it has across.
      rgba: Its colour.
      density: [kg/m^3].
    """
    upper, lower = _faces(middle, thickness)
    loops = np.concatenate([upper, lower[:, ::-1]], axis=1)
    parts = [
        part for first, last, across in cuts for part in _stretch(upper, lower, first, last, across)
    ]
    return solid_piece(loft_outwards(loops), parts, rgba=rgba, density=density)


def _faces(
    middle: Float[np.ndarray, "u v 3"], thickness: Float[np.ndarray, "u v"]
) -> tuple[Float[np.ndarray, "u v 3"], Float[np.ndarray, "u v 3"]]:
    along, across = np.gradient(middle, axis=0), np.gradient(middle, axis=1)
    normals = np.cross(along, across)
    normals *= (thickness / 2 / np.linalg.norm(normals, axis=2))[..., None]
    return middle + normals, middle - normals


def _stretch(
    upper: np.ndarray, lower: np.ndarray, first: int, last: int, across: int
) -> list[Shape]:
    """Hulls side by side that share their edges; each takes three points along and five across."""
    stations = sorted({first, (first + last) // 2, last})
    edges = np.round(np.linspace(0, upper.shape[1] - 1, across + 1)).astype(int)
    parts = []
    for left, right in zip(edges[:-1], edges[1:], strict=True):
        columns = np.unique(np.round(np.linspace(left, right, 5)).astype(int))
        cell = np.ix_(stations, columns.tolist())
        parts.append(convex_part(np.concatenate([upper[cell], lower[cell]]).reshape(-1, 3)))
    return parts
