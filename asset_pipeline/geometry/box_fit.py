"""A box for a part that is as good as one: a board, a bar, a plinth. Or its convex hull: a round leg."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import ConvexHull, KDTree, QhullError

from asset_pipeline.geometry.hull_reduction import reduced_hull
from asset_pipeline.geometry.surface_points import surface_points
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose


@dataclass(frozen=True)
class BoxFit:
    """When a box will do.

    Attributes:
      tolerance: How far below a face of the box the surface may lie [m].
      coverage: Over what share of each face it may not lie deeper.
      bins: The longer side of a face is judged in this many bins.
      pitch: Of the bins at least [m].
      thinnest: No box is thinner; a sheet without thickness gets this one [m].
      narrow: A board's edge narrower than this may be missing from its drawing [m].
      hull_vertices: Of a convex hull, at most.
    """

    tolerance: float = 0.0025
    coverage: float = 0.97
    bins: int = 40
    pitch: float = 0.002
    thinnest: float = 0.003
    narrow: float = 0.025
    hull_vertices: int = 32


FIT = BoxFit()


def fitted_box(mesh: trimesh.Trimesh) -> Shape | None:
    """The box of a part, along the frame's axes or else along its own; None where none fits.

    It fits where, seen from outside at each of its six faces, the surface lies within the tolerance
    of the face nearly everywhere. A hollow thing that is open somewhere, a frame or a bent handle
    fails.

    Args:
      mesh: Any triangle soup in the body frame [m].
    """
    vertices = np.asarray(mesh.vertices)[np.unique(mesh.faces)]
    for rotation in (np.eye(3), *_own_axes(vertices)):
        turned = trimesh.Trimesh(np.asarray(mesh.vertices) @ rotation, mesh.faces, process=False)
        corners = vertices @ rotation
        low, high = corners.min(axis=0), corners.max(axis=0)
        if _fills(turned, low, high):
            return box_between(low, high, rotation)
    return None


def fitted_hull(mesh: trimesh.Trimesh, spacing: float | None = None) -> Shape | None:
    """The convex hull of a part that has no other form, of at most 32 vertices; else None.

    Args:
      mesh: Any triangle soup in the body frame [m].
      spacing: Of the points that are compared; hollows not much deeper go unseen [m]. None: as coarse
        as the bins of a box.
    """
    vertices = np.asarray(mesh.vertices)[np.unique(mesh.faces)]
    try:
        if ConvexHull(vertices).volume < FIT.thinnest**3:
            return None
        hull = reduced_hull(vertices, FIT.hull_vertices)
    except QhullError:  # flat
        return None
    if spacing is None:
        spacing = max(float(np.ptp(vertices, axis=0).max()) / FIT.bins, FIT.pitch)
    own = KDTree(surface_points(mesh, spacing / 2))
    gaps, _ = own.query(surface_points(hull, spacing))
    if (gaps <= FIT.tolerance + spacing / 2).mean() < FIT.coverage:
        return None
    if hull.volume > FIT.coverage * float(np.prod(hull.extents)):
        return box_between(*hull.bounds)  # a board drawn from one side only
    return Shape("mesh", mesh=hull)


def box_between(
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    rotation: Float[np.ndarray, "3 3"] | None = None,
) -> Shape:
    """The box between two corners given in a frame with this rotation, `R_body_box`; never too thin."""
    turn = np.eye(3) if rotation is None else rotation
    half = np.maximum((high - low) / 2, FIT.thinnest / 2)
    return Shape("box", tuple(map(float, half)), compose(turn, turn @ ((low + high) / 2)))


def _own_axes(vertices: Float[np.ndarray, "n 3"]) -> list[Float[np.ndarray, "3 3"]]:
    try:
        with np.errstate(all="ignore"):  # trimesh divides by the volume of flat hulls
            to_box, _ = trimesh.bounds.oriented_bounds(vertices)
    except Exception:  # qhull's own type: flat or too few points
        return []
    rotation = np.asarray(to_box)[:3, :3].T
    # A turn of less than half a degree is noise of the drawing.
    if np.abs(np.abs(rotation).max(axis=0) - 1).max() < 4e-5:
        return []
    return [rotation]


def _fills(mesh: trimesh.Trimesh, low: np.ndarray, high: np.ndarray) -> bool:
    extents = high - low
    if (extents > FIT.pitch / 2).sum() < 2:
        return False  # a line or a point
    extents = np.maximum(extents, 1e-9)
    pitch = max(float(extents.max()) / FIT.bins, FIT.pitch)
    points = surface_points(mesh, pitch / 2)
    for axis in range(3):
        across = [i for i in range(3) if i != axis]
        if extents[across].min() <= FIT.narrow and axis != extents.argmin():
            continue
        counts = np.maximum(np.ceil(extents[across] / pitch), 1).astype(int)
        cells = ((points[:, across] - low[across]) / extents[across] * counts).astype(int)
        cells = np.ravel_multi_index(tuple(np.minimum(cells, counts - 1).T), tuple(counts))
        for depth in (points[:, axis] - low[axis], high[axis] - points[:, axis]):
            nearest = np.full(counts.prod(), np.inf)
            np.minimum.at(nearest, cells, depth)
            if (nearest <= FIT.tolerance).mean() < FIT.coverage:
                return False
    return True
