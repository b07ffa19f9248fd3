"""The handle of a door or a drawer that nobody named so: a part named knob, or what sticks out of the front of one part.

PartNet-Mobility names handles of furniture, refrigerators and dishwashers; an oven's door is one part with its handle.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from trimesh.visual import TextureVisuals

from asset_pipeline.sources.articulated_scan import HANDLE, PartMesh, ScanLink, Surface

# Faces within this angle of the front's normal are part of a front.
FACING = np.cos(np.deg2rad(15.0))
LAYER = 0.004  # faces this near to each other in depth are one front [m]
FRONT_SHARE = 0.15  # of the door's outline that a front covers
CLEAR = 0.01  # in front of it a handle begins; what lies nearer is a frame [m]
LEAST_DEPTH, LEAST_LENGTH = 0.015, 0.06  # of a handle [m]
# A bar of less depth has at least this share of its face behind it too, and as much room there as LEAST_DEPTH.
BACK_SHARE = 0.5
SLENDER = 2.0  # times longer than wide, at least
WIDEST = 0.075  # that a knob may be where it is narrower, for a hand that opens by 80 mm [m]
# Words in the names of parts that stand on a front and are no piece of it.
NO_BODY = {"knob", "control", "button", "switch", "dial"}
THINNEST = 0.01  # of a knob that nothing but its shape tells [m]


def face_normal(link: ScanLink, base: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "3"]:
    """Unit vector off the part's face: a drawer's way out; a panel's normal, away from the middle of the base.

    Args:
      link: What moves, shut.
      base: Lowest and highest corner of the base, in the same frame.
    """
    assert link.joint is not None
    if link.role == "drawer":
        axis = int(np.abs(link.joint.axis).argmax())
        sign = np.sign(link.joint.axis[axis])
    else:
        panel = [p for p in link.parts if p.name != HANDLE and not is_knob(p)] or link.parts
        bounds = mesh_bounds([p.mesh for p in panel])
        axis = int(np.ptp(bounds, axis=0).argmin())
        sign = np.sign(bounds.mean(axis=0)[axis] - base.mean(axis=0)[axis]) or -1.0
    return sign * np.eye(3)[axis]


def mesh_bounds(meshes: Sequence[trimesh.Trimesh]) -> Float[np.ndarray, "2 3"]:
    """The lowest and the highest corner of all."""
    bounds = np.array([mesh.bounds for mesh in meshes])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def is_knob(part: PartMesh) -> bool:
    """Whether a part is named a knob, and not that of a control."""
    words = _words(part)
    return "knob" in words and "control" not in words


def _words(part: PartMesh) -> set[str]:
    return set(re.findall(r"[a-z]+", part.name.lower()))


def with_handle(link: ScanLink, base: Float[np.ndarray, "2 3"]) -> ScanLink:
    """The link with its handle as a part of that name, where there is one and none has it; else the link itself.

    What is named a knob is the handle where it stands out far enough to be taken, but for a bar with room behind it.
    Of a drawer, a single knob that nobody named is it too.

    Args:
      link: What moves, shut, in metres; only doors and drawers have such handles.
      base: Lowest and highest corner of the base [m].
    """
    if link.role not in ("door", "drawer") or any(part.name == HANDLE for part in link.parts):
        return link
    named = [part for part in link.parts if _words(part) & NO_BODY]
    body = [part for part in link.parts if not _words(part) & NO_BODY]
    outwards = face_normal(link, base)
    front = _front(body, outwards)
    if front is None:
        return link
    knobs = [p for p in named if is_knob(p) and _is_knob(p.mesh, outwards, front)]
    rest, handle = _cut(body, outwards, front)
    if rest and handle is not None:
        bar = _is_handle(handle.mesh, outwards, front)
        if knobs:
            bar = bar and _is_bar(handle.mesh, outwards, front)
        elif link.role == "drawer":
            bar = bar or _is_single_knob(handle.mesh, outwards)
        if bar:
            return replace(link, parts=(*rest, *named, handle))
    if not knobs:
        return link
    held = {part.key for part in knobs}
    return replace(
        link,
        parts=tuple(replace(p, name=HANDLE) if p.key in held else p for p in link.parts),
    )


def body_bounds(link: ScanLink, base: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "2 3"] | None:
    """Lowest and highest corner of a link without its handle, named or not, and without what carries it there.

    Args:
      link: Base or moving link, shut, in metres.
      base: Lowest and highest corner of the base [m].

    Returns:
      `(2, 3)` [m]; None of a link that is nothing but a handle.
    """
    found = with_handle(link, base)
    meshes = [part.mesh for part in found.parts if part.name != HANDLE]
    if found is not link:  # then posts, and a knob's neck, may not be named either
        outwards = face_normal(link, base)
        front = _front([part for part in link.parts if not _words(part) & NO_BODY], outwards)
        assert front is not None
        around = mesh_bounds([part.mesh for part in found.parts if part.name == HANDLE])
        around = (around + [[-CLEAR], [CLEAR]])[:, outwards == 0]
        for mesh in meshes:
            corners = np.asarray(mesh.triangles)
            beside = corners[:, :, outwards == 0]
            behind = ((beside >= around[0]) & (beside <= around[1])).all(axis=(1, 2))
            mesh.update_faces(~(behind & ((corners @ outwards).max(axis=1) > front + CLEAR)))
            mesh.remove_unreferenced_vertices()
        meshes = [mesh for mesh in meshes if len(mesh.faces)]
    return mesh_bounds(meshes) if meshes else None


def _cut(
    parts: Sequence[PartMesh], outwards: Float[np.ndarray, "3"], front: float
) -> tuple[list[PartMesh], PartMesh | None]:
    """What stays of the parts, and all of them that sticks out of the front, if anything."""
    kept, cut = [], []
    for part in parts:
        for surface in part.surfaces:
            depth = np.asarray(surface.mesh.triangles) @ outwards
            sticks_out = depth.min(axis=1) > front + CLEAR
            kept.append((part, _faces(surface, ~sticks_out)))
            cut.append(_faces(surface, sticks_out))
    rest = [
        replace(part, surfaces=own)
        for part in parts
        if (own := tuple(s for owner, s in kept if owner is part and len(s.mesh.faces)))
    ]
    surfaces = tuple(s for s in cut if len(s.mesh.faces))
    return rest, PartMesh(HANDLE, HANDLE, surfaces) if surfaces else None


def _front(parts: Sequence[PartMesh], outwards: Float[np.ndarray, "3"]) -> float | None:
    """The depth of the outermost face that covers enough of the door's outline [m]."""
    meshes = [part.mesh for part in parts]
    if not meshes:
        return None
    outline = float(np.prod(np.ptp(mesh_bounds(meshes), axis=0)[outwards == 0]))
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


def _is_knob(mesh: trimesh.Trimesh, outwards: Float[np.ndarray, "3"], front: float) -> bool:
    """Whether what is named a knob stands out beyond the depth `front` [m] so that a hand can take it."""
    reach = float((np.asarray(mesh.vertices) @ outwards).max()) - front
    across = np.asarray(mesh.extents)[outwards == 0]
    return reach > LEAST_DEPTH and float(across.min()) <= WIDEST


def _is_single_knob(mesh: trimesh.Trimesh, outwards: Float[np.ndarray, "3"]) -> bool:
    """Whether all that sticks out is small, deep, and wide enough to be pulled."""
    extents = np.asarray(mesh.extents)
    across = np.sort(extents[outwards == 0])
    deep = float(extents[outwards != 0][0]) > LEAST_DEPTH
    return bool(deep and across[0] >= THINNEST and across[1] <= LEAST_LENGTH)


def _faces(surface: Surface, which: Bool[np.ndarray, " f"]) -> Surface:
    mesh = trimesh.Trimesh(
        np.asarray(surface.mesh.vertices), np.asarray(surface.mesh.faces)[which], process=False
    )
    if isinstance(surface.mesh.visual, TextureVisuals) and surface.mesh.visual.uv is not None:
        mesh.visual = TextureVisuals(uv=np.asarray(surface.mesh.visual.uv))
    mesh.remove_unreferenced_vertices()
    return replace(surface, mesh=mesh)
