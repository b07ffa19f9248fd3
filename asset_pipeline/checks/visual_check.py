"""Is what is seen of a built asset where it touches? Bounds and surfaces of every body, compared.

Collision shapes are fitted to the drawn or scanned surface, and what cameras see is a coarser copy of it at most:
where the two part, one of them was damaged on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.spatial import ConvexHull, cKDTree

from asset_pipeline.geometry.surface_points import surface_points
from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.visible_shapes import collision_shapes, visible_shapes

# Points lie this share of a body's longest side apart, and no nearer than this [m].
SPACING_SHARE, LEAST_SPACING = 1 / 60, 0.003
# Pushed off a face by this share of the spacing, a point is outside its own shape.
OFF_FACE = 0.1


@dataclass(frozen=True)
class VisualLimits:
    """How far apart the two may be. A length is the larger of a share of the body's longest side and so many metres.

    Attributes:
      bounds: Between the same sides of the bounding boxes. Sound assets keep within 2 mm.
      near: From a point of the collision surface to what is seen. Backs of knobs are drawn open: no less than
        their radius.
      bare: Share of the collision surface that has nothing near. Sound assets have none.
    """

    bounds: tuple[float, float] = (0.01, 0.005)
    near: tuple[float, float] = (0.03, 0.025)
    bare: float = 0.05


LIMITS = VisualLimits()


@dataclass(frozen=True)
class VisualMatch:
    """One body: what is seen of it against what touches.

    Attributes:
      body: Its name.
      apart: Largest distance between the same sides of the two bounding boxes [m].
      allowed: Of that [m].
      bare: Share of the surface of its collision shapes, where none covers another, with nothing seen near it.
    """

    body: str
    apart: float
    allowed: float
    bare: float


def visual_matches(folder: Path) -> list[VisualMatch]:
    """The comparison of every body that has both visual and collision shapes.

    Raises:
      InputError: The model or a mesh it names cannot be read, or nothing is to be seen.
    """
    seen, solid = visible_shapes(folder), collision_shapes(folder)
    return [_match(body, seen[body], solid[body]) for body in solid if solid[body] and seen[body]]


def visual_failures(folder: Path) -> list[str]:
    """A line for each body whose visual is not where its collision shapes are.

    Raises:
      InputError: The model or a mesh it names cannot be read, or nothing is to be seen.
    """
    failures = []
    for match in visual_matches(folder):
        if match.apart > match.allowed:
            failures.append(
                f"visual of {match.body!r} ends {1e3 * match.apart:.0f} mm from where its collision "
                f"shapes do; at most {1e3 * match.allowed:.0f} mm are allowed"
            )
        if match.bare > LIMITS.bare:
            failures.append(
                f"{100 * match.bare:.0f} % of the collision surface of {match.body!r} has no visual near it; "
                f"at most {100 * LIMITS.bare:.0f} % are allowed"
            )
    return failures


def _match(body: str, seen: Sequence[Shape], solid: Sequence[Shape]) -> VisualMatch:
    visible = _joined(seen)
    touching = _joined(solid)
    size = float(np.ptp(touching.bounds, axis=0).max())
    allowed, near = (max(share * size, least) for share, least in (LIMITS.bounds, LIMITS.near))
    spacing = max(SPACING_SHARE * size, LEAST_SPACING)
    points = _outer_points(solid, spacing)
    distance, _ = cKDTree(surface_points(visible, spacing)).query(
        points, distance_upper_bound=near + spacing
    )
    apart = float(np.abs(np.asarray(visible.bounds) - np.asarray(touching.bounds)).max())
    return VisualMatch(body, apart, allowed, float(np.isinf(distance).mean()))


def _outer_points(shapes: Sequence[Shape], spacing: float) -> Float[np.ndarray, "n 3"]:
    """Points evenly on the shapes' surfaces, without those inside another shape."""
    meshes = [shape.surface() for shape in shapes]
    points, owner, outside = [], [], []
    for index, mesh in enumerate(meshes):
        count = max(int(mesh.area / spacing**2), 1)
        found = trimesh.sample.sample_surface(mesh, count, seed=0)
        points.append(np.asarray(found[0]))
        owner += [index] * len(found[0])
        normals = np.asarray(mesh.face_normals)[np.asarray(found[1])]
        outside.append(points[-1] + OFF_FACE * spacing * normals)
    points, owner, outside = np.concatenate(points), np.array(owner), np.concatenate(outside)
    hidden = np.zeros(len(points), bool)
    for index, mesh in enumerate(meshes):
        planes = ConvexHull(np.asarray(mesh.vertices)).equations
        hidden |= _within(planes, outside) & (owner != index)
    return points[~hidden]


def _within(
    equations: Float[np.ndarray, "f 4"], points: Float[np.ndarray, "n 3"]
) -> Bool[np.ndarray, " n"]:
    """Which points lie in the convex hull with these half spaces."""
    return np.all(points @ equations[:, :3].T + equations[:, 3] <= 0, axis=1)


def _joined(shapes: Sequence[Shape]) -> trimesh.Trimesh:
    meshes = [shape.surface() for shape in shapes]
    bare = [trimesh.Trimesh(m.vertices, m.faces, process=False) for m in meshes]
    return cast(trimesh.Trimesh, trimesh.util.concatenate(bare))
