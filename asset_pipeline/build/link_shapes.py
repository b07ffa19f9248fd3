"""Convex collision shapes of a link of drawn furniture, hollow where it is hollow."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from asset_pipeline.geometry.box_fit import box_between, fitted_box, fitted_hull
from asset_pipeline.geometry.cell_boxes import cell_boxes
from asset_pipeline.geometry.slab_hulls import SPACING, slab_hulls
from asset_pipeline.sources.articulated_scan import HANDLE, PartMesh, ScanLink
from manipose_mj.assets.geometry import Shape

# Cells are this share of a link's longest side, within limits [m]; flat walls come out exact anyway.
CELL_SHARE = 1 / 110
CELL_RANGE = (0.003, 0.008)
COARSER = 1.3  # until there are no more boxes than MAX_BOXES
MAX_BOXES = 160


def link_shapes(link: ScanLink) -> dict[str, tuple[Shape, ...]]:
    """The collision shapes of each of a link's parts, by part name; what took more than one box or hull
    to fit is shared by all such parts and comes under the first one's name.

    Knobs and buttons are their hulls; boards are boxes, legs are hulls, handles slices of hulls; all the
    rest is covered by boxes on a grid together, so that walls drawn in pieces are one.
    """
    if link.role in ("knob", "button"):
        whole = _joined(link.parts)
        shape = fitted_hull(whole) or box_between(*whole.bounds)
        return {link.parts[0].name: (shape,)}
    found: dict[str, list[Shape]] = {}
    rest: list[PartMesh] = []
    for part in link.parts:
        if part.name == HANDLE:
            found.setdefault(part.name, []).extend(handle_shapes(part.mesh))
        elif shape := fitted_box(part.mesh) or fitted_hull(part.mesh):
            found.setdefault(part.name, []).append(shape)
        else:
            rest.append(part)
    if rest:
        found.setdefault(rest[0].name, []).extend(_cells(_joined(rest)))
    return {name: tuple(shapes) for name, shapes in found.items()}


def handle_shapes(mesh: trimesh.Trimesh) -> tuple[Shape, ...]:
    """A box or a hull for each connected piece of a handle that is one, slices for the others."""
    shapes: list[Shape] = []
    rest = []
    for piece in _pieces(mesh):
        if shape := fitted_box(piece) or fitted_hull(piece, SPACING):
            shapes.append(shape)
        else:
            rest.append(piece)
    for piece in rest:
        shapes += slab_hulls(piece)
    return tuple(shapes)


def _pieces(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """What hangs together by vertices; by edges, faces drawn from both sides would fall apart."""
    welded = trimesh.Trimesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), process=True)
    edges = welded.edges
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(len(welded.vertices),) * 2)
    count, labels = connected_components(graph, directed=False)
    own = labels[welded.faces[:, 0]]
    return [
        trimesh.Trimesh(welded.vertices, welded.faces[own == k], process=False)
        for k in range(count)
        if (own == k).any()
    ]


def _cells(mesh: trimesh.Trimesh) -> tuple[Shape, ...]:
    pitch = float(np.clip(CELL_SHARE * np.ptp(mesh.bounds, axis=0).max(), *CELL_RANGE))
    while True:
        shapes = cell_boxes(mesh, pitch, MAX_BOXES)
        if len(shapes) < MAX_BOXES:
            return shapes
        pitch *= COARSER


def _joined(parts: list[PartMesh] | tuple[PartMesh, ...]) -> trimesh.Trimesh:
    meshes = [p.mesh for p in parts]
    joined = trimesh.util.concatenate(meshes)
    assert isinstance(joined, trimesh.Trimesh)
    return joined
