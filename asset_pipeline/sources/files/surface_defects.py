"""Whether the faces of a drawn part fit together, and which of them are turned the wrong way.

Modellers draw walls of no thickness, leave boxes open and put faces into each other, so little can be
asked of a part. What can: faces that have stated normals agree with them; a part drawn from both sides
(as all 458 PartNet-Mobility meshes at hand are) is so throughout; a closed one is closed throughout.
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from asset_pipeline.geometry.repair import open_edges, turn_outwards

# A flat face deviates by 17 deg at most from its stated normal in published parts.
MAX_TILT = np.deg2rad(20.0)
# Of faces without area: a third in published parts, two thirds in a box pressed flat.
MAX_EMPTY = 0.5
# Of faces drawn from both sides, from which on the others lack their reverse.
MOSTLY = 0.5
# Of the faces of a part drawn from both sides that point against their normals; published: 3 %.
MAX_AGAINST = 0.05
# A hole of so few edges was a face or two [edges]. Parts that are open by design have larger ones.
SMALL_HOLE = 5
# Faces less high than this share of the part have no direction to speak of.
SLIVER = 1e-4


def face_defects(
    points: Float[np.ndarray, "v 3"],
    triangles: Int[np.ndarray, "f 3"],
    normals: Float[np.ndarray, "f 3 3"],
) -> tuple[Bool[np.ndarray, " f"], list[str]]:
    """Which faces have to be turned, and what looks damaged, one phrase each.

    Args:
      points: Vertices.
      triangles: Their indices.
      normals: Stated for each corner; NaN where none is.
    """
    mesh = trimesh.Trimesh(points, triangles, process=False)
    count = len(triangles)
    size = float(np.ptp(points[triangles.ravel()], axis=0).max())
    sides = points[triangles] - points[np.roll(triangles, 1, axis=1)]
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    height = 2 * mesh.area_faces / np.where(longest > 0, longest, 1)
    solid = height > SLIVER * size
    defects = []
    if (empty := int((height <= 1e-9 * size).sum())) > MAX_EMPTY * count:
        defects.append(f"{empty} of {count} faces have no area")
    # NaN where nothing is stated, which is neither below nor above anything.
    tilt = _tilts(mesh, normals, solid)
    against = tilt > np.pi / 2
    tilted = int(((tilt > MAX_TILT) & (tilt < np.pi - MAX_TILT)).sum())
    if tilted:
        defects.append(f"{tilted} of {count} flat faces are tilted from their stated normals")
    reverse = _with_reverse(mesh)
    turned = np.zeros(count, bool)
    if reverse.mean() > MOSTLY:
        if missing := int((~reverse).sum()):
            defects.append(f"{missing} of {count} faces lack the reverse that the others have")
        if (wrong := int(against.sum())) > MAX_AGAINST * count:
            defects.append(f"{wrong} of {count} faces point against their stated normals")
        return turned, defects
    if 0 < (holes := open_edges(mesh)) <= SMALL_HOLE and 4 * holes < len(mesh.edges_unique):
        defects.append(f"the surface has a small hole ({holes} open edges)")
    outwards = mesh.copy()
    if turn_outwards(outwards):
        turned = (np.asarray(outwards.faces) != triangles).any(axis=1)
    elif open_edges(mesh):
        turned = against
    if turned.any():
        defects.append(f"{int(turned.sum())} of {count} faces pointed inwards; turned")
    return turned, defects


def _tilts(
    mesh: trimesh.Trimesh, normals: Float[np.ndarray, "f 3 3"], solid: Bool[np.ndarray, " f"]
) -> Float[np.ndarray, " f"]:
    """Angle [rad] between each flat face and its stated normal; NaN for the others."""
    flat = solid & (np.abs(normals - normals[:, :1]) < 1e-6).all(axis=(1, 2))
    points = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    own = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    stated = normals[:, 0]
    lengths = np.linalg.norm(own, axis=1) * np.linalg.norm(stated, axis=1)
    cosine = (own * np.nan_to_num(stated)).sum(axis=1) / np.where(lengths > 0, lengths, 1)
    return np.where(flat & (lengths > 0), np.arccos(np.clip(cosine, -1, 1)), np.nan)


def _with_reverse(mesh: trimesh.Trimesh) -> Bool[np.ndarray, " f"]:
    """Which faces have a second one on the same three places."""
    _, places = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    corners = np.sort(places.reshape(-1)[np.asarray(mesh.faces)], axis=1)
    _, index, counts = np.unique(corners, axis=0, return_inverse=True, return_counts=True)
    return counts[index.reshape(-1)] > 1
