"""The handle of a door that is drawn as one part with it: what sticks out of the door's front.

PartNet-Mobility names handles of furniture, refrigerators and dishwashers; an oven's door is one part with its handle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from trimesh.visual import TextureVisuals

from asset_pipeline.build.link_shapes import HANDLE
from asset_pipeline.sources.articulated_scan import PartMesh, ScanLink, Surface

# Faces within this angle of the front's normal are part of a front.
FACING = np.cos(np.deg2rad(15.0))
LAYER = 0.004  # faces this near to each other in depth are one front [m]
FRONT_SHARE = 0.15  # of the door's outline that a front covers
CLEAR = 0.01  # in front of it a handle begins; what lies nearer is a frame [m]
LEAST_DEPTH, LEAST_LENGTH = 0.015, 0.06  # of a handle [m]
# A bar of less depth has at least this share of its face behind it too, and as much room there as LEAST_DEPTH.
BACK_SHARE = 0.5
SLENDER = 2.0  # times longer than wide, at least


def with_handle(link: ScanLink, outwards: Float[np.ndarray, "3"]) -> ScanLink:
    """The link with its handle as a part of its own, where one is drawn and not named; else the link itself.

    Args:
      link: A door, shut.
      outwards: Unit vector along an axis, off the door's face.
    """
    if any(part.name == HANDLE for part in link.parts):
        return link
    front = _front(link, outwards)
    if front is None:
        return link
    kept, cut = [], []
    for part in link.parts:
        for surface in part.surfaces:
            depth = np.asarray(surface.mesh.triangles) @ outwards
            sticks_out = depth.min(axis=1) > front + CLEAR
            kept.append((part, _faces(surface, ~sticks_out)))
            cut.append(_faces(surface, sticks_out))
    handle = PartMesh(HANDLE, HANDLE, tuple(s for s in cut if len(s.mesh.faces)))
    if not handle.surfaces or not _is_handle(handle.mesh, outwards, front):
        return link
    rest = [
        replace(part, surfaces=own)
        for part in link.parts
        if (own := tuple(s for owner, s in kept if owner is part and len(s.mesh.faces)))
    ]
    return replace(link, parts=(*rest, handle)) if rest else link


def _front(link: ScanLink, outwards: Float[np.ndarray, "3"]) -> float | None:
    """The depth of the outermost face that covers enough of the door's outline [m]."""
    meshes = [part.mesh for part in link.parts]
    bounds = np.array([mesh.bounds for mesh in meshes])
    extents = bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)
    outline = float(np.prod(extents[outwards == 0]))
    facing = [np.abs(np.asarray(m.face_normals) @ outwards) > FACING for m in meshes]
    depth = np.concatenate(
        [np.asarray(m.triangles_center)[f] @ outwards for m, f in zip(meshes, facing, strict=True)]
    )
    area = np.concatenate(
        [np.asarray(m.area_faces)[f] for m, f in zip(meshes, facing, strict=True)]
    )
    if not len(depth):
        return None
    layer = np.round(depth / LAYER).astype(int)
    covers = np.bincount(layer - layer.min(), area) > FRONT_SHARE * outline
    return (
        float(depth[layer == layer.min() + np.flatnonzero(covers)[-1]].max())
        if covers.any()
        else None
    )


def _is_handle(mesh: trimesh.Trimesh, outwards: Float[np.ndarray, "3"], front: float) -> bool:
    """Whether what sticks out beyond the depth `front` [m] is long, and deep or a bar."""
    extents = np.asarray(mesh.extents)
    across = np.sort(extents[outwards == 0])
    if across[1] <= max(LEAST_LENGTH, SLENDER * across[0]):
        return False
    return float(extents[outwards != 0][0]) > LEAST_DEPTH or _is_bar(mesh, outwards, front)


def _is_bar(mesh: trimesh.Trimesh, outwards: Float[np.ndarray, "3"], front: float) -> bool:
    """Whether there is room between what sticks out and the front; behind mouldings and panels there is none."""
    facing = np.asarray(mesh.face_normals) @ outwards
    clear = np.asarray(mesh.triangles_center) @ outwards > front + LEAST_DEPTH
    area = np.asarray(mesh.area_faces)
    behind, before = area[(facing < -FACING) & clear].sum(), area[facing > FACING].sum()
    return bool(behind > BACK_SHARE * before)


def _faces(surface: Surface, which: Bool[np.ndarray, " f"]) -> Surface:
    mesh = trimesh.Trimesh(
        np.asarray(surface.mesh.vertices), np.asarray(surface.mesh.faces)[which], process=False
    )
    if isinstance(surface.mesh.visual, TextureVisuals) and surface.mesh.visual.uv is not None:
        mesh.visual = TextureVisuals(uv=np.asarray(surface.mesh.visual.uv))
    mesh.remove_unreferenced_vertices()
    return replace(surface, mesh=mesh)
