"""A scanned surface as a smoothed cloud: what symmetries and sections are measured on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

SAMPLES = 16_000
NEIGHBOURS = 32
# What is told apart from a symmetric surface: not the scanner's noise, but a feature of 3 mm [m].
FEATURE = 0.003


@dataclass(frozen=True)
class SurfaceCloud:
    """Points spread evenly over a surface, each moved onto the plane through its neighbours.

    Vertex noise of half a millimetre crumples triangles of that size: single normals mean nothing.
    Fitted to `NEIGHBOURS` samples, about 0.2 % of the surface, points and normals do.

    Attributes:
      points: `(n, 3)` [m].
      normals: `(n, 3)`, unit, out of the material.
      flatness: `(n,)`, 1 on a plane or smooth surface, towards 0 on edges and thin wires.
      faces: `(n,)`, the triangle that each sample came from.
      noise: Standard deviation of the samples about the fitted planes [m].
      diagonal: Of the bounding box [m].
      tree: Over `points`.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    flatness: Float[np.ndarray, "n"]
    faces: Int[np.ndarray, "n"]
    noise: float
    diagonal: float
    tree: cKDTree

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> SurfaceCloud:
        """Sample a mesh; deterministic."""
        samples, faces = trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)[:2]
        samples, faces = np.asarray(samples), np.asarray(faces)
        facing = np.asarray(mesh.face_normals)[faces]
        near = cKDTree(samples).query(samples, NEIGHBOURS)[1]
        # The far side of a thin wall is near, but faces the other way.
        same_side = np.einsum("nki,ni->nk", facing[near], facing) > 0
        share = (same_side / same_side.sum(axis=1, keepdims=True))[..., None]
        around = samples[near]
        middle = (share * around).sum(axis=1)
        offsets = around - middle[:, None]
        variances, axes = np.linalg.eigh(np.swapaxes(share * offsets, 1, 2) @ offsets)
        normals = axes[:, :, 0]
        outward = (share * facing[near]).sum(axis=1)
        inward = np.einsum("ni,ni->n", normals, outward) < 0
        normals = np.where(inward[:, None], -normals, normals)
        height = np.einsum("ni,ni->n", samples - middle, normals)
        points = samples - height[:, None] * normals
        flatness = 1 - np.sqrt(
            np.clip(variances[:, 0], 0, None) / np.maximum(variances[:, 1], 1e-18)
        )
        return cls(
            points,
            normals,
            flatness,
            faces,
            noise=float(np.sqrt(np.median(np.clip(variances[:, 0], 0, None)))),
            diagonal=float(np.linalg.norm(np.ptp(points, axis=0))),
            tree=cKDTree(points),
        )

    def thinned(self, count: int) -> slice:
        """Every so many points, `count` of them or a few more."""
        return slice(None, None, max(1, len(self.points) // count))

    def enlarged(self, factor: float) -> SurfaceCloud:
        """The same surface, all lengths times `factor`."""
        points = factor * self.points
        return replace(
            self,
            points=points,
            noise=factor * self.noise,
            diagonal=factor * self.diagonal,
            tree=cKDTree(points),
        )

    def box(
        self, rotation: Float[np.ndarray, "3 3"]
    ) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Centre, in the mesh frame, and lengths of the box around the surface along the columns [m]."""
        local = self.points @ rotation
        low, high = local.min(axis=0), local.max(axis=0)
        return rotation @ ((low + high) / 2), high - low
