"""How well a scanned surface maps onto itself under a rotation or a reflection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from manipose_mj.poses import SymmetryGroup, rotation_about

# A symmetry holds when 95 % of the surface comes back to within this share of the bounding box's
# diagonal, and never less than the scans' own noise [m].
TOLERANCE = 0.025
NOISE = 0.0012
DENSE = 30_000
PROBES = 1_500
REGISTRATION_STEPS = 25
# None of these turns maps a regular polygon of fewer than 20 corners onto itself.
GENERIC_TURNS = np.deg2rad([11.3, 23.7, 41.9, 67.1, 97.3, 131.9, 163.7])


@dataclass(frozen=True)
class SurfaceProbe:
    """A surface as a dense cloud with normals, ready to be compared with moved copies of itself.

    Attributes:
      points: `(n, 3)` [m].
      normals: `(n, 3)`, unit.
      tree: Over `points`.
      tolerance: The residual below which a symmetry holds [m].
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    tree: cKDTree
    tolerance: float

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> SurfaceProbe:
        """Sample a mesh; deterministic."""
        points, faces = trimesh.sample.sample_surface(mesh, DENSE, seed=0)[:2]
        points = np.asarray(points)
        tolerance = max(NOISE, TOLERANCE * float(np.linalg.norm(mesh.extents)))
        return cls(points, np.asarray(mesh.face_normals)[faces], cKDTree(points), tolerance)

    def residual(self, motion: Float[np.ndarray, "3 3"], center: Float[np.ndarray, "3"]) -> float:
        """The 95th percentile of the distance [m] of moved points from the surface.

        `motion` is a rotation or a reflection about `center`, in the mesh frame. The distance is to
        the tangent plane of the nearest sample, so that the sampling's own spacing does not count.
        """
        probes = self.points[:: max(1, len(self.points) // PROBES)]
        moved = (probes - center) @ motion.T + center
        distance, nearest = self.tree.query(moved)
        plane = np.abs(np.einsum("ij,ij->i", moved - self.points[nearest], self.normals[nearest]))
        # Past an edge the tangent plane runs on where the surface does not.
        spacing = 2 * self.tolerance
        return float(np.percentile(np.where(distance > spacing, distance, plane), 95))

    def holds(self, motion: Float[np.ndarray, "3 3"], center: Float[np.ndarray, "3"]) -> bool:
        """Whether the motion maps the surface onto itself within the tolerance."""
        return self.residual(motion, center) <= self.tolerance

    def half_turn_axis(
        self, axis: Float[np.ndarray, "3"], center: Float[np.ndarray, "3"]
    ) -> Float[np.ndarray, "3"]:
        """The axis near `axis` about which half a turn maps the surface onto itself best.

        The surface, turned about `axis` through `center`, is registered to itself (point-to-plane
        ICP, the farthest tenth left out); the corrected motion's own axis is the answer. Damping
        keeps slides along the surface, which decide nothing, small.
        """
        probes = self.points[:: max(1, len(self.points) // (2 * PROBES))]
        rotation = rotation_about(axis, np.pi)
        translation = center - rotation @ center
        for _ in range(REGISTRATION_STEPS):
            moved = probes @ rotation.T + translation
            distance, nearest = self.tree.query(moved)
            near = distance <= np.percentile(distance, 90)
            moved, nearest = moved[near], nearest[near]
            normals, middle = self.normals[nearest], moved.mean(axis=0)
            scale = np.sqrt(((moved - middle) ** 2).sum(axis=1).mean())
            gap = np.einsum("ij,ij->i", self.points[nearest] - moved, normals)
            rows = np.hstack([np.cross((moved - middle) / scale, normals), normals])
            normal_matrix = rows.T @ rows
            damping = 1e-3 * np.trace(normal_matrix) / 6 * np.eye(6)
            step = np.linalg.solve(normal_matrix + damping, rows.T @ gap)
            turn = Rotation.from_rotvec(step[:3] / scale).as_matrix()
            rotation = turn @ rotation
            translation = turn @ (translation - middle) + middle + step[3:]
        found = Rotation.from_matrix(rotation).as_rotvec()
        return found * np.sign(found @ axis) / np.linalg.norm(found)


def mirror(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The reflection across the plane with this unit normal."""
    return np.eye(3) - 2 * np.outer(normal, normal)


def measured_symmetry(
    probe: SurfaceProbe,
    rotation: Float[np.ndarray, "3 3"],
    origin: Float[np.ndarray, "3"],
    *,
    textured: bool,
) -> SymmetryGroup:
    """The proper rotations, among those a label can have, that map the shape onto itself.

    Tried are every turn about the label's X, quarter turns and half turns about X, Y and Z. What
    holds generates the group. An axial shape with a texture has no flips: its print tells the ends
    apart, as the conventions say.

    Args:
      probe: The surface.
      rotation: Columns are the label's axes in the mesh frame.
      origin: `(3,)` [m], the label's origin in the mesh frame.
      textured: Whether the asset has a texture.
    """

    def holds(turn: np.ndarray) -> bool:
        return probe.holds(rotation @ turn @ rotation.T, origin)

    x, y, z = np.eye(3)
    if all(holds(rotation_about(x, angle)) for angle in GENERIC_TURNS):
        flip = np.diag([-1.0, 1.0, -1.0])
        return SymmetryGroup.about_x(ends_alike=not textured and holds(flip))
    turns = [rotation_about(axis, angle) for angle in (np.pi / 2, np.pi) for axis in (x, y, z)]
    held = [np.round(turn) for turn in turns if holds(turn)]
    return SymmetryGroup.generated(np.stack(held)) if held else SymmetryGroup.identity()
