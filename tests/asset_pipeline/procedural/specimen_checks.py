"""What must hold of every rigid specimen of the procedural catalogue; each check asserts."""

from __future__ import annotations

import importlib
from functools import cache
from types import ModuleType

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import measured_symmetry
from asset_pipeline.procedural.revolution import MAX_PART_VERTICES
from asset_pipeline.procedural.specimen import Specimen
from manipose_mj.assets import catalogue
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.poses import invert, transform

MM = 1e-3


@cache
def made(category: str, index: int) -> Specimen:
    return catalogue.generate(category, index)


def module_of(category: str) -> ModuleType:
    return importlib.import_module(CATALOGUE[category].module)


def seen(specimen: Specimen) -> trimesh.Trimesh:
    """What is seen of it, in the label frame."""
    mesh = specimen.bodies[0].surface().copy()
    mesh.vertices = transform(invert(specimen.label.pose), np.asarray(mesh.vertices))
    return mesh


def check_label_box(specimen: Specimen) -> None:
    """The label's lengths are those of what is seen; its axes are right-handed."""
    low, high = seen(specimen).bounds
    assert np.abs(high - low - specimen.label.extents).max() < 0.1 * MM
    assert np.abs(np.linalg.det(specimen.label.rotation) - 1) < 1e-9
    if specimen.label.object_type != "functional":
        assert np.abs(high + low).max() < 0.2 * MM


def check_size(category: str, specimen: Specimen, mass: tuple[float, float]) -> None:
    """Its length is in the catalogue's range, its mass [kg] between two limits."""
    low, high = CATALOGUE[category].size
    assert low <= specimen.label.extents.max() <= high
    assert mass[0] <= specimen.bodies[0].mass_properties.mass <= mass[1]
    triangles = sum(len(shape.surface().faces) for shape in specimen.bodies[0].visual)
    assert triangles <= 12_000


def check_parts(specimen: Specimen, most: int = 40) -> None:
    """The collision parts are few, convex, closed and small."""
    parts = specimen.bodies[0].collision
    assert len(parts) <= most
    for shape in parts:
        if shape.mesh is None:
            assert min(shape.size) > 0
            continue
        vertices, mesh = np.asarray(shape.mesh.vertices), shape.mesh
        assert len(vertices) <= MAX_PART_VERTICES
        assert mesh.is_watertight and mesh.volume > 0
        above = np.einsum("fk,vfk->vf", mesh.face_normals, vertices[:, None] - mesh.triangles[:, 0])
        assert above.max() < 1e-7


def check_agreement(specimen: Specimen, within: float, gap: float = 0.7 * MM) -> None:
    """What is seen lies on the collision parts and they on it, up to `within` [m].

    Narrower gaps between parts than `gap` [m] are inside.
    """
    looks = specimen.bodies[0].surface()
    touched = trimesh.util.concatenate([s.surface(64) for s in specimen.bodies[0].collision])
    for one, other in ((looks, touched), (touched, looks)):
        points = _reachable(one, specimen, gap)
        assert trimesh.proximity.closest_point(other, points)[1].max() < within


def _reachable(surface: trimesh.Trimesh, specimen: Specimen, gap: float) -> np.ndarray:
    """Points of a surface that something outside can touch: faces between parts are left out."""
    points, faces = trimesh.sample.sample_surface(surface, 400, seed=1)
    probes = points + gap * surface.face_normals[faces]
    covered = np.zeros(len(points), bool)
    for shape in specimen.bodies[0].collision:
        mesh = shape.surface(64)
        offsets = np.einsum("fk,fk->f", mesh.face_normals, mesh.triangles[:, 0])
        covered |= (probes @ mesh.face_normals.T - offsets).max(axis=1) < 1e-6
    assert not covered.all()
    return points[~covered]


def check_symmetry(specimen: Specimen, within: float = 1.0 * MM) -> None:
    """The label's turns map what is seen onto itself, and the labeller measures no others."""
    mesh, group = seen(specimen), specimen.label.symmetry
    probe = SurfaceCloud.of(mesh)
    points, tree = probe.points[::20], cKDTree(probe.points)
    spacing = tree.query(probe.points[:2000], k=2)[0][:, 1].max()
    for turn in group.sampled(9):
        assert tree.query(points @ turn.T)[0].max() < within + spacing
    measured = measured_symmetry(probe, np.eye(3), np.zeros(3))
    assert measured.axial == group.axial
    assert len(measured.rotations) == len(group.rotations)


def check_repeatable(category: str, index: int, other: int) -> None:
    """The same index gives the same vertices, another index others."""
    first, again = made(category, index), catalogue.generate(category, index)
    one, two = first.bodies[0].surface().vertices, again.bodies[0].surface().vertices
    assert one.tobytes() == two.tobytes()
    assert made(category, other).label.extents.tolist() != first.label.extents.tolist()


def cross_section(mesh: trimesh.Trimesh, x: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner, across X, of what a plane at `x` cuts."""
    cut = trimesh.intersections.mesh_plane(mesh, [1.0, 0.0, 0.0], [x, 0.0, 0.0])
    points = np.asarray(cut).reshape(-1, 3)[:, 1:]
    return points.min(axis=0), points.max(axis=0)
