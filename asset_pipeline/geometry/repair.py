"""Closed surfaces out of scans: what inertia and convex decomposition need."""

from __future__ import annotations

import manifold3d
import numpy as np
import trimesh
from jaxtyping import Float, Int

# Of edges that two faces share, from which on a surface has an inside.
NEARLY_CLOSED = 0.98
# A vertex as far from its nearest neighbour as this many times the edges around: on 32 scans as
# published the ratio is below 1.2.
SPIKE = 1.7
# From one face to the next, a cone of eight sides or more turns less; so do not all of a needle's few faces.
ROUND_TURN = np.deg2rad(48.0)
# Of the volume that bodies claim together, the share above which they reach into one another.
OVERLAP = 1e-9
# A face that hangs on one edge, and is longer than this many times the median edge, spans what it should not.
FLAP = 5.0


def closed(mesh: trimesh.Trimesh, tolerance: float = 0.0) -> trimesh.Trimesh | None:
    """The mesh as a closed, oriented surface; None where that takes more than stitching.

    Seams are welded, edges that four faces share are split (scans touch themselves), small
    holes are filled, and bodies that reach into one another become one; the faces that remain deviate
    by at most about `tolerance`.

    Args:
      mesh: A scan, its vertices split along texture seams; or a drawn mesh of several closed bodies.
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
    solid = _united(solid)
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

    Seen from outside, such faces are not drawn, and the volume that they enclose counts as negative. The walls of
    a cavity point into it, and stay so.

    Returns:
      How many faces were turned.
    """
    surface = _stitched(mesh)
    before = np.array(surface.faces)
    if (_edge_counts(surface) == 2).mean() < NEARLY_CLOSED:
        return 0
    if not surface.is_winding_consistent:
        trimesh.repair.fix_winding(surface)
    for piece in _pieces_inside_out(surface):
        surface.faces[piece] = surface.faces[piece][:, ::-1]
    turned = (np.asarray(surface.faces) != before).any(axis=1)
    mesh.faces[turned] = mesh.faces[turned][:, ::-1]
    return int(turned.sum())


def _pieces_inside_out(surface: trimesh.Trimesh) -> list[Int[np.ndarray, "faces"]]:
    """The faces of each piece whose faces point inwards, and of what lies in it as if it were its cavity.

    A piece that lies in another and points inwards is a cavity. Of one that is open nobody knows: it goes with all.
    """
    numbers = trimesh.graph.connected_component_labels(
        surface.face_adjacency, node_count=len(surface.faces)
    )
    order = np.argsort(numbers, kind="stable")
    pieces = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
    corners = np.asarray(surface.triangles)
    if len(pieces) == 1:
        return pieces if _volume(corners) < 0 else []
    lows = np.array([corners[piece].min(axis=(0, 1)) for piece in pieces])
    highs = np.array([corners[piece].max(axis=(0, 1)) for piece in pieces])
    volumes = np.array([_volume(corners[piece]) for piece in pieces])
    shared = (_faces_at_edges(surface) == 2).mean(axis=1)
    is_closed = np.array([shared[piece].mean() >= NEARLY_CLOSED for piece in pieces])

    def around(inner: int) -> list[int]:
        """The pieces that it lies in."""
        spans = (lows <= lows[inner]).all(axis=1) & (highs >= highs[inner]).all(axis=1)
        spans[inner] = False
        point = corners[pieces[inner][0], 0]
        return [
            i for i in np.flatnonzero(spans).tolist() if _winds_about(point, corners[pieces[i]])
        ]

    inwards = np.flatnonzero(is_closed & (volumes < 0)).tolist()
    turned = {i for i in inwards if not around(i)}
    if turned:
        outwards = np.flatnonzero(is_closed & (volumes > 0)).tolist()
        turned |= {i for i in outwards if not turned.isdisjoint(around(i))}
    if volumes.sum() < 0:
        turned |= set(np.flatnonzero(~is_closed).tolist())
    return [pieces[i] for i in sorted(turned)]


def _volume(triangles: Float[np.ndarray, "faces 3 3"]) -> float:
    """Negative where they point inwards; where the surface is open, of cones from the middle of its bounds."""
    middle = (triangles.min(axis=(0, 1)) + triangles.max(axis=(0, 1))) / 2
    return float(np.linalg.det(triangles - middle).sum()) / 6


def _winds_about(point: Float[np.ndarray, "3"], triangles: Float[np.ndarray, "faces 3 3"]) -> bool:
    """Whether a point is inside a surface: how often that winds about it, by the solid angles of its triangles.

    Source: Van Oosterom and Strackee, "The solid angle of a plane triangle", 1983.
    """
    to = triangles - point
    lengths = np.linalg.norm(to, axis=2)
    products = np.einsum("fij,fij->fi", to, np.roll(to, -1, axis=1))
    below = lengths.prod(axis=1) + (products * np.roll(lengths, 1, axis=1)).sum(axis=1)
    angles = 2 * np.arctan2(np.linalg.det(to), below)
    return abs(angles.sum()) > 2 * np.pi


def drop_flaps(mesh: trimesh.Trimesh) -> int:
    """Take out, in place, the long faces that hang on the surface by one edge, or by none.

    Such a face has a corner that belongs elsewhere; it leaves a hole of its own size.

    Returns:
      How many faces were taken out.
    """
    surface = _stitched(mesh)
    points = np.asarray(surface.vertices)[surface.edges_sorted]
    lengths = np.linalg.norm(points[:, 0] - points[:, 1], axis=1)
    alone = _faces_at_edges(surface) == 1
    long = lengths.reshape(-1, 3).max(axis=1) > FLAP * np.median(lengths)
    flaps = (alone.sum(axis=1) >= 2) & long
    if flaps.any() and not flaps.all():
        mesh.update_faces(~flaps)
        return int(flaps.sum())
    return 0


def spikes(mesh: trimesh.Trimesh) -> int:
    """How many vertices stick out of the surface like needles, as one does whose number was damaged.

    The tip of a cone is none: the edges that lead up to it are as long as those that end there, or it is round.
    """
    surface = _stitched(mesh)
    points, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    edges = np.asarray(surface.edges_unique)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    nearest, facing = np.full(len(points), np.inf), np.zeros(len(points))
    total, degree, neighbours = np.zeros(len(points)), np.zeros(len(points)), np.zeros_like(points)
    for own, other in (edges.T, edges.T[::-1]):
        np.minimum.at(nearest, own, lengths)
        np.add.at(total, own, lengths)
        np.add.at(degree, own, 1)
        np.add.at(neighbours, own, points[other])
    for corner in range(3):
        own, after, before = (faces[:, (corner + k) % 3] for k in range(3))
        np.maximum.at(facing, own, np.linalg.norm(points[after] - points[before], axis=1))
    # Of the other edges at its neighbours, the mean length.
    around = np.zeros(len(points))
    for own, other in (edges.T, edges.T[::-1]):
        np.add.at(around, own, (total[other] - lengths) / np.maximum(degree[other] - 1, 1))
    around /= np.maximum(degree, 1)
    # The middle of a fan is far from its neighbours, but in the midst of them.
    neighbours /= np.maximum(degree, 1)[:, None]
    sticks_out = np.linalg.norm(points - neighbours, axis=1) > nearest / 2
    # Where three faces meet the apex of a pyramid looks like a needle.
    long = nearest > SPIKE * np.maximum(facing, around)
    found = (degree > 3) & long & sticks_out
    if found.any():
        found &= _sharpest_turn(surface) > ROUND_TURN
    return int(found.sum())


def _sharpest_turn(mesh: trimesh.Trimesh) -> Float[np.ndarray, "vertices"]:
    """Of each vertex, the largest angle between two faces that share an edge which ends there [rad]."""
    turns = np.zeros(len(mesh.vertices))
    for ends in np.asarray(mesh.face_adjacency_edges).T:
        np.maximum.at(turns, ends, np.asarray(mesh.face_adjacency_angles))
    return turns


def _stitched(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same faces in the same order, on vertices of which no two are at the same place."""
    places, index = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    return trimesh.Trimesh(places, index.reshape(-1)[np.asarray(mesh.faces)], process=False)


def _edge_counts(mesh: trimesh.Trimesh) -> Int[np.ndarray, "edges"]:
    """Of every edge, the number of its faces."""
    return np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1]


def _faces_at_edges(mesh: trimesh.Trimesh) -> Int[np.ndarray, "faces 3"]:
    """Of each face's three edges, the number of faces that have them."""
    _, index, counts = np.unique(mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True)
    return counts[index.reshape(-1)].reshape(-1, 3)


def weld(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The geometry alone, vertices at the same place merged."""
    welded = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=True)
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    welded.update_faces(welded.nondegenerate_faces())
    return welded


def _manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold | None:
    data = manifold3d.Mesh64(
        np.array(mesh.vertices, np.float64, order="C"),
        np.array(mesh.faces, np.uint64, order="C"),
    )
    data.merge()
    solid = manifold3d.Manifold(data)
    return None if solid.status() != manifold3d.Error.NoError or solid.is_empty() else solid


def _united(solid: manifold3d.Manifold) -> manifold3d.Manifold:
    """The same volume with no surface inside it; as it is where its bodies keep clear of one another.

    Surfaces that enclose a negative volume are the cavities of the smallest bodies around them.
    """
    surfaces = sorted(solid.decompose(), key=lambda surface: surface.volume())
    bodies = [surface for surface in surfaces if surface.volume() > 0]
    if len(bodies) < 2:
        return solid
    for cavity in (_turned(surface) for surface in surfaces if surface.volume() <= 0):
        around = next((i for i, body in enumerate(bodies) if _spans(body, cavity)), None)
        if cavity is None or around is None:
            return solid
        bodies[around] -= cavity
    united = manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)
    if (
        united.status() != manifold3d.Error.NoError
        or united.volume() > (1 - OVERLAP) * solid.volume()
    ):
        return solid
    return united


def _turned(surface: manifold3d.Manifold) -> manifold3d.Manifold | None:
    """Inside out."""
    data = surface.to_mesh64()
    return _manifold(
        trimesh.Trimesh(data.vert_properties[:, :3], data.tri_verts[:, ::-1], process=False)
    )


def _spans(body: manifold3d.Manifold, other: manifold3d.Manifold | None) -> bool:
    if other is None:
        return False
    low, high = np.reshape(body.bounding_box(), (2, 3))
    other_low, other_high = np.reshape(other.bounding_box(), (2, 3))
    return bool((low <= other_low).all() and (other_high <= high).all())
