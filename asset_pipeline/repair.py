"""Closed surfaces out of scans: what inertia and convex decomposition need."""

from __future__ import annotations

import manifold3d
import numpy as np
import trimesh
from jaxtyping import Int

# Of edges that two faces share, from which on a surface has an inside.
NEARLY_CLOSED = 0.98


def closed(mesh: trimesh.Trimesh, tolerance: float = 0.0) -> trimesh.Trimesh | None:
    """The mesh as a closed, oriented surface; None where that takes more than stitching.

    Seams are welded, edges that four faces share are split (scans touch themselves), and small
    holes are filled; the faces that remain deviate by at most about `tolerance`.

    Args:
      mesh: A scan, its vertices split along texture seams.
      tolerance: How far simplification may move the surface [m]; 0 keeps all faces.
    """
    welded = weld(mesh)
    solid = _manifold(welded)
    if solid is None and len(welded.faces):
        trimesh.repair.fix_normals(welded)
        trimesh.repair.fill_holes(welded)
        solid = _manifold(welded)
    if solid is None or solid.volume() <= 0:
        return None
    if tolerance:
        solid = solid.simplify(tolerance)
    data = solid.to_mesh64()
    result = trimesh.Trimesh(data.vert_properties[:, :3], data.tri_verts, process=False)
    return result if len(result.faces) and result.volume > 0 else None


def open_edges(mesh: trimesh.Trimesh) -> int:
    """How many edges belong to one face only, seams of the texture apart: the rims of holes."""
    return int((_edge_counts(_stitched(mesh)) == 1).sum())


def turn_outwards(mesh: trimesh.Trimesh) -> int:
    """Turn the faces of a (nearly) closed surface that point inwards, in place.

    Seen from outside, such faces are not drawn, and the volume that they enclose counts as negative.

    Returns:
      How many faces were turned.
    """
    surface = _stitched(mesh)
    before = np.array(surface.faces)
    if (_edge_counts(surface) == 2).mean() < NEARLY_CLOSED:
        return 0
    if not surface.is_winding_consistent:
        trimesh.repair.fix_winding(surface)
    # Where it is open, the volume is that of cones from the origin.
    surface.vertices -= surface.bounds.mean(axis=0)
    if float(surface.volume) < 0:
        surface.invert()
    turned = (np.asarray(surface.faces) != before).any(axis=1)
    mesh.faces[turned] = mesh.faces[turned][:, ::-1]
    return int(turned.sum())


def _stitched(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same faces in the same order, on vertices of which no two are at the same place."""
    places, index = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    return trimesh.Trimesh(places, index.reshape(-1)[np.asarray(mesh.faces)], process=False)


def _edge_counts(mesh: trimesh.Trimesh) -> Int[np.ndarray, "edges"]:
    """Of every edge, the number of its faces."""
    return np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1]


def weld(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The geometry alone, vertices at the same place merged."""
    welded = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=True)
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    welded.update_faces(welded.nondegenerate_faces())
    return welded


def _manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold | None:
    data = manifold3d.Mesh64(
        np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.uint64)
    )
    data.merge()
    solid = manifold3d.Manifold(data)
    return None if solid.status() != manifold3d.Error.NoError or solid.is_empty() else solid
