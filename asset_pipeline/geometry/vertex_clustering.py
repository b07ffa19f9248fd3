"""Coarser triangle meshes by merging neighbouring vertices: whatever the mesh is, no point moves far.

Drawn furniture has faces drawn from both sides, sheets without thickness and edges of many faces. Edge collapse by
quadrics loses whole walls of it; merged vertices stay within one cell of a grid. Rossignac and Borrel,
"Multi-resolution 3D approximations for rendering complex scenes" (1993).
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float, Int

# From the finest grid [m], coarser by this factor each time.
FINEST, COARSER = 2.5e-4, 1.4


def coarser(mesh: trimesh.Trimesh, max_faces: int, max_cell: float) -> trimesh.Trimesh:
    """The mesh with at most `max_faces` faces, or as few as cells of `max_cell` leave.

    No vertex moves by more than a cell's diagonal. Texture coordinates are left out.

    Args:
      mesh: Any triangle soup [m].
      max_faces: From which on nothing is merged any more.
      max_cell: Side of the coarsest cell [m].
    """
    cell, found = FINEST, mesh
    while len(found.faces) > max_faces and cell <= max_cell:
        found = _merged(mesh, cell)
        cell *= COARSER
    return found


def _merged(mesh: trimesh.Trimesh, cell: float) -> trimesh.Trimesh:
    vertices = np.asarray(mesh.vertices)
    kept, owner = _representatives(vertices, cell)
    faces = _distinct(owner[np.asarray(mesh.faces)])
    merged = trimesh.Trimesh(vertices[kept], faces, process=False)
    merged.remove_unreferenced_vertices()
    return merged


def _representatives(
    vertices: Float[np.ndarray, "v 3"], cell: float
) -> tuple[Int[np.ndarray, " c"], Int[np.ndarray, " v"]]:
    """Of each occupied cell the vertex farthest from the middle, which keeps corners and rims; and every vertex's cell."""
    # Off by half a cell, so that walls at round coordinates do not lie on the border of two cells.
    keys = np.floor(vertices / cell + 0.5).astype(np.int64)
    _, owner = np.unique(keys, axis=0, return_inverse=True)
    owner = owner.reshape(-1)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    order = np.lexsort((-np.linalg.norm(vertices - middle, axis=1), owner))
    first = np.searchsorted(owner[order], np.arange(owner.max() + 1))
    return order[first], owner


def _distinct(faces: Int[np.ndarray, "f 3"]) -> Int[np.ndarray, "k 3"]:
    """Faces of three different corners, each once; a face and its reverse are two."""
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    turned = (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3
    return np.unique(np.take_along_axis(faces, turned, axis=1), axis=0)
