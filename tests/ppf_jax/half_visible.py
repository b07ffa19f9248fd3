"""Clouds of catalogue objects by the cheapest rule: the surface that faces the camera is seen."""

from __future__ import annotations

import numpy as np

from manipose_mj.assets import catalogue
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.poses import compose, quaternion_to_rotation
from manipose_mj.ppf_jax.points.clouds import LabelledCloud


def half_visible_clouds(
    category: str, indices: list[int], views: int, *, points: int = 400, seed: int = 0
) -> list[LabelledCloud]:
    """`views` clouds of each instance, turned evenly over SO(3), 0.5 to 1 m away."""
    rng = np.random.default_rng(seed)
    clouds = []
    for index in indices:
        specimen = catalogue.generate(category, index)
        mesh = specimen.bodies[0].surface()
        faces = np.asarray(mesh.triangles)
        for view in range(views):
            rotation = quaternion_to_rotation(rng.normal(size=4))
            slopes = rng.uniform(-0.3, 0.3, 2)
            offset = rng.uniform(0.5, 1.0) * np.array([*slopes, 1.0])
            rows = rng.choice(len(faces), 6 * points, p=mesh.area_faces / mesh.area)
            u, v = np.sort(rng.random((2, len(rows), 1)), axis=0)
            corners = faces[rows]
            surface = u * corners[:, 0] + (v - u) * corners[:, 1] + (1 - v) * corners[:, 2]
            seen = surface @ rotation.T + offset
            normals = np.asarray(mesh.face_normals)[rows] @ rotation.T
            facing = np.flatnonzero(np.sum(normals * seen, axis=1) < 0)[:points]
            pose = compose(rotation, offset) @ specimen.label.pose
            clouds.append(
                LabelledCloud(
                    points=seen[facing].astype(np.float32),
                    normals=normals[facing].astype(np.float32),
                    pose=pose.astype(np.float32),
                    extents=specimen.label.extents.astype(np.float32),
                    symmetry=specimen.label.symmetry,
                    name=f"{CATALOGUE[category].instance(index)}/{view}",
                    category=category,
                )
            )
    return clouds
