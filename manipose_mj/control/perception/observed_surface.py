"""The surface of an object as its cloud shows it: completed by its symmetry and by the shape that was fitted to it.

The fitted shape says where surface is and which way it faces; the cloud says how far it lies off there.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, cKDTree
from trimesh.convex import convex_hull

from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.perception.objects.known_shapes import KnownShape
from manipose_mj.control.perception.objects.symmetric_completion import symmetry_turns
from manipose_mj.grasp_sampling.grasp_fit import ObjectCloud
from manipose_mj.grasp_sampling.touch_points import SurfacePoints, first_in_cells, union_points

_AROUND = 0.012  # points that far away along the surface tell where it lies [m]
_OFF = 0.012  # and no further off it; further ones are something that the fitted shape lacks [m]
_NEAREST = 24  # of them
_FEWEST = 4  # with fewer the fitted shape is believed
_SAME_SIDE = 0.5  # cosine between the normals of the cloud and of the fitted shape
_COARSE = 0.010  # for the hand's large boxes one point in each cell will do [m]


def observed_surface(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], shape: KnownShape
) -> ObjectCloud:
    """What grasps are sampled on.

    Args:
      points: Seen, in the label's frame [m].
      normals: Towards the cameras, in the label's frame.
      shape: Fitted to them.
    """
    rng = np.random.default_rng(0)
    hulls = tuple(Shape("mesh", mesh=convex_hull(hull)) for hull in shape.hulls)
    fitted = union_points(hulls, rng)
    points, normals = completed(points, normals, shape.label)
    offsets = _offsets(fitted, points, normals) if len(points) else np.zeros(len(fitted.points))
    touch = SurfacePoints(
        fitted.points + offsets[:, None] * fitted.normals,
        fitted.normals,
        fitted.spacing,
    )
    corners = np.concatenate([np.asarray(hull.surface().vertices) for hull in hulls])
    corners = corners[ConvexHull(corners).vertices]
    lacking = points[cKDTree(fitted.points).query(points)[0] > _OFF] if len(points) else points
    lacking = lacking[first_in_cells(lacking / fitted.spacing)] if len(lacking) else lacking
    obstacles = np.concatenate([touch.points, corners, lacking])
    coarse = np.concatenate([corners, obstacles[first_in_cells(obstacles / _COARSE)]])
    return ObjectCloud(touch, obstacles, coarse, shape.mass)


def completed(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], label: PoseLabel
) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "m 3"]]:
    """The points and normals, in the label's frame, and where its symmetry puts them as well.

    What is round is revolved, what has planes is mirrored.
    """
    turns = symmetry_turns(label.object_type, label.symmetry)
    return (
        np.concatenate([points @ turn.T for turn in turns]),
        np.concatenate([normals @ turn.T for turn in turns]),
    )


def _offsets(
    fitted: SurfacePoints, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "k"]:
    """How far each fitted point has to move along its normal to lie where the cloud does [m].

    The median over the points around, so that noise and outliers count little.
    """
    _, nearest = cKDTree(fitted.points).query(points)
    off = np.einsum("ni,ni->n", points - fitted.points[nearest], fitted.normals[nearest])
    facing = np.einsum("ni,ni->n", normals, fitted.normals[nearest]) > _SAME_SIDE
    tells = facing & (np.abs(off) < _OFF)
    offsets = np.zeros(len(fitted.points))
    if tells.sum() < _FEWEST:
        return offsets
    feet, off = fitted.points[nearest[tells]], off[tells]
    distance, index = cKDTree(feet).query(
        fitted.points, k=min(_NEAREST, len(feet)), distance_upper_bound=_AROUND
    )
    found = np.isfinite(distance)
    enough = found.sum(axis=1) >= _FEWEST
    around = np.where(found, off[np.where(found, index, 0)], np.nan)
    offsets[enough] = np.nanmedian(around[enough], axis=1)
    return offsets
