"""Wavefront OBJ files with their materials, read as the small text files they are.

Nothing that a file names is opened but the material library beside it, and an image of the folder
that the caller passes: material libraries in the wild name absolute paths of their authors' machines.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, Int
from trimesh.visual import TextureVisuals

from asset_pipeline.sources.articulated_scan import Surface
from asset_pipeline.sources.files.surface_defects import face_defects
from asset_pipeline.sources.files.wavefront_lines import WavefrontLines, read_lines
from asset_pipeline.sources.files.wavefront_materials import Material, read_materials
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

MAX_BYTES = 64 * 2**20  # the largest part of PartNet-Mobility has 5
MAX_COORDINATE = 1e6  # published are models of size 2; beyond, squares lose all digits


def read_wavefront(path: Path, images: Path, lacking: list[str]) -> tuple[Surface, ...]:
    """The meshes in an OBJ file, one for each material, in the file's own frame and units.

    Polygons become fans of triangles; lines and points are left out, and may leave nothing. What looks
    damaged but can be used is logged in one warning, faces that point inwards are turned.

    Args:
      path: The file; its material library, if it names one, lies beside it.
      images: Folder of the textures; only their file names are taken from the library.
      lacking: Takes a phrase for each library, material and texture that is not there; an object may lack
        hundreds, which are worth one warning together.

    Raises:
      InputError: Missing, too large or no text; a line cannot be read; a face names a vertex that is
        not there; or a coordinate is NaN, infinite or gigantic.
    """
    lines = read_lines(path, max_bytes=MAX_BYTES)
    if (largest := float(np.abs(lines.vertices).max(initial=0))) > MAX_COORDINATE:
        raise InputError(
            f"{path}: a coordinate is {largest:.3g}; expected a part of an object of size 2 or so"
        )
    materials: dict[str, Material] = {}
    for library in lines.libraries:
        if (path.parent / library).exists():
            materials |= read_materials(path.parent / library, images)
        else:
            lacking.append(f"{path.parent / library} is not there")
    defects = list(lines.defects)
    for name in filter(None, lines.names):
        if name in materials and materials[name].lacks:
            lacking.append(f"{path}: {materials[name].lacks}")
        elif materials and name not in materials:
            lacking.append(f"{path}: material {name!r} is not in {' '.join(lines.libraries)}")
    triangles, owners = _fans(lines.sizes)
    if len(triangles):
        points = lines.corners[triangles]
        turned, odd = face_defects(lines.vertices, points[..., 0], _normals(lines, points[..., 2]))
        triangles[turned] = triangles[turned][:, ::-1]
        defects += odd
    if defects:
        log.warning("%s: %s", path, "; ".join(defects))
    return tuple(
        _surface(
            lines, triangles[lines.materials[owners] == index], materials.get(name, Material())
        )
        for index, name in enumerate(lines.names)
        if (lines.materials == index).any()
    )


def _fans(sizes: Int[np.ndarray, " f"]) -> tuple[Int[np.ndarray, "t 3"], Int[np.ndarray, " t"]]:
    """Triangles as numbers of corners, and the face of each."""
    owners = np.repeat(np.arange(len(sizes)), sizes - 2)
    starts = np.cumsum(sizes) - sizes
    before = np.cumsum(sizes - 2) - (sizes - 2)
    step = np.arange(len(owners)) - before[owners]
    first = starts[owners]
    return np.stack([first, first + step + 1, first + step + 2], axis=1), owners


def _normals(lines: WavefrontLines, index: Int[np.ndarray, "t 3"]) -> Float[np.ndarray, "t 3 3"]:
    """The stated normals of corners; NaN where there are none."""
    return np.vstack([lines.normals, np.full((1, 3), np.nan)])[index]


def _surface(
    lines: WavefrontLines, triangles: Int[np.ndarray, "t 3"], material: Material
) -> Surface:
    """The triangles on vertices of their own, one for each pair of place and texture coordinate."""
    corners = lines.corners[triangles.ravel(), :2]
    textured = material.texture is not None and bool((corners[:, 1] >= 0).all())
    _, first, index = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    # In the order of their first use.
    order = np.argsort(first)
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    own = corners[first[order]]
    mesh = trimesh.Trimesh(
        lines.vertices[own[:, 0]], rank[index.reshape(-1)].reshape(-1, 3), process=False
    )
    if textured:
        uv = lines.coordinates[own[:, 1]]
        mesh.visual = TextureVisuals(uv=np.where(np.isfinite(uv), uv, 0.0))
    return Surface(mesh, material.rgba, material.texture if textured else None)
