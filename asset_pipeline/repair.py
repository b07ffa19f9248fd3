"""Closed surfaces out of scans: what inertia and convex decomposition need."""

from __future__ import annotations

import manifold3d
import numpy as np
import trimesh


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
