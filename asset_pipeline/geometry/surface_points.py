"""Points on a triangle surface, no gap between them larger than asked for."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.errors import InputError

MAX_POINTS = 20_000_000


def surface_points(mesh: trimesh.Trimesh, spacing: float) -> Float[np.ndarray, "n 3"]:
    """A lattice of points on every triangle, its corners and edges included.

    Rows run along the longest edge, so that slivers, of which drawn furniture is full, cost few.

    Args:
      mesh: Any triangle soup [m].
      spacing: Between neighbouring points, at most [m].

    Raises:
      InputError: That would take more than 20 million points.
    """
    corners = np.asarray(mesh.triangles)
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    first = edges.argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, order[..., None], axis=1), 1, 0)
    longest = np.take_along_axis(edges, first[:, None], axis=1)[:, 0]
    double_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    height = double_area / np.maximum(longest, 1e-12)
    # Steps slant where the apex is off the middle; both legs of a step stay below `spacing`.
    slant = np.minimum(edges.min(axis=1), longest)
    columns = np.ceil(longest / spacing).astype(int) + 1
    rows = np.ceil(np.maximum(height, np.where(height > 0.1 * spacing, slant, 0)) / spacing)
    rows = rows.astype(int) + 1
    if (count := int((columns * rows).sum())) > MAX_POINTS:
        raise InputError(
            f"surface of {len(corners)} faces takes {count} points; expected a plainer one"
        )
    found = []
    for shape in np.unique(np.stack([columns, rows], axis=1), axis=0):
        chosen = (columns == shape[0]) & (rows == shape[1])
        u = np.linspace(0, 1, shape[0])
        v = np.linspace(0, 1, shape[1])[:, None] if shape[1] > 1 else np.zeros((1, 1))
        weights = np.stack([(1 - u) * (1 - v), u * (1 - v), np.broadcast_to(v, (len(v), len(u)))])
        triangles = np.stack([a[chosen], b[chosen], c[chosen]], axis=1)
        points = np.einsum("kvu,tkd->tvud", weights, triangles)
        found.append(points.reshape(-1, 3))
    return np.concatenate(found) if found else np.empty((0, 3))
