"""Residuals, planes, axes and groups measured on shapes whose symmetry is known."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import (
    STRICT,
    axial_residual,
    holds,
    measured_symmetry,
    mirror,
    residual,
    turns_about_x,
)
from asset_pipeline.labelling.symmetry_fit import (
    around,
    half_turn_axis,
    mirror_planes,
    refined_plane,
)
from manipose_mj.poses import rotation_about

UP = np.array([0.0, 0.0, 1.0])
# Columns X, Y, Z of a label with X up and Y along the frame's y.
LABEL = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def noisy(mesh: trimesh.Trimesh, sigma: float = 0.0005) -> trimesh.Trimesh:
    """Cut to triangles of 3 mm, with noise on every vertex."""
    fine = mesh.copy()
    vertices, faces = trimesh.remesh.subdivide_to_size(fine.vertices, fine.faces, 0.004)[:2]
    fine = trimesh.Trimesh(vertices, faces)
    moved = fine.vertices + np.random.default_rng(0).normal(0, sigma, fine.vertices.shape)
    return trimesh.Trimesh(moved, fine.faces, process=False)


def test_smoothing_takes_the_noise_off_the_points_and_the_normals():
    mesh = noisy(trimesh.creation.box(extents=[0.10, 0.08, 0.06]))
    cloud = SurfaceCloud.of(mesh)
    inner = (np.abs(cloud.points[:, :2]) < 0.03).all(axis=1) & (cloud.points[:, 2] > 0)
    assert np.abs(cloud.points[inner, 2] - 0.03).std() < 0.0002
    lean = np.arccos(np.clip(cloud.normals[inner, 2], -1, 1))
    assert np.median(lean) < np.deg2rad(6)
    assert 0.0001 < cloud.noise < 0.0006


def test_normals_of_a_thin_wall_point_out_of_it_on_both_sides():
    cloud = SurfaceCloud.of(trimesh.creation.box(extents=[0.2, 0.2, 0.002]))
    flat = (np.abs(cloud.points[:, :2]) < 0.09).all(axis=1)
    assert (cloud.normals[flat, 2] * cloud.points[flat, 2] > 0).mean() > 0.99


def test_residual_is_the_distance_it_claims():
    cloud = SurfaceCloud.of(trimesh.creation.box(extents=[0.1, 0.06, 0.06]))
    assert residual(cloud, np.eye(3), np.zeros(3)) < 1e-9
    quarter = residual(cloud, rotation_about(UP, np.pi / 2), np.zeros(3))
    assert quarter == pytest.approx(0.02, abs=0.002)


@pytest.mark.parametrize("step", [0.0, 0.003])
def test_a_feature_of_3_mm_is_told_from_noise_of_half_a_millimetre(step):
    block = trimesh.creation.box(extents=[0.1, 0.06, 0.06])
    if step:
        pad = trimesh.creation.box(extents=[0.02, 0.05, 2 * step])
        block = trimesh.boolean.union([block, pad.apply_translation([0.04, 0, 0.03])])
    cloud = SurfaceCloud.of(noisy(block))
    assert holds(cloud, mirror(np.array([1.0, 0, 0])), np.zeros(3), STRICT) == (step == 0)


def test_the_half_turn_axis_is_found_from_ten_degrees_off():
    outline = np.array([(0, 0), (0.03, 0), (0.045, 0.1), (0, 0.1)])
    cone = trimesh.creation.revolve(outline, sections=64).apply_translation([0.3, -0.2, 0.1])
    lean = rotation_about(np.array([0.6, 0.8, 0]), np.deg2rad(10))
    cloud = SurfaceCloud.of(noisy(cone))
    axis, point = half_turn_axis(cloud, lean @ UP, cloud.points.mean(axis=0))
    assert abs(axis @ UP) > np.cos(np.deg2rad(0.2))
    np.testing.assert_allclose(point[:2], [0.3, -0.2], atol=3e-4)
    assert axial_residual(cloud, axis, point) < 0.001


def test_the_planes_of_a_box_are_found_from_any_start():
    turn = rotation_about(UP, 0.7)
    mesh = trimesh.creation.box(extents=[0.1, 0.06, 0.08])
    mesh.vertices = mesh.vertices @ turn.T + [0.1, 0.2, 0.3]
    cloud = SurfaceCloud.of(noisy(mesh))
    found = [refined_plane(cloud, *plane) for plane in mirror_planes(cloud, around(UP, 12))[:2]]
    for side in turn.T[:2]:
        near = max(found, key=lambda plane: abs(plane[0] @ side))
        assert abs(near[0] @ side) > np.cos(np.deg2rad(0.2))
        assert near[1] == pytest.approx(near[0] @ [0.1, 0.2, 0.3], abs=3e-4)


@pytest.mark.parametrize(
    ("mesh", "axial", "members"),
    [
        (trimesh.creation.box(extents=[0.04, 0.06, 0.1]), False, 4),
        (trimesh.creation.box(extents=[0.06, 0.06, 0.1]), False, 8),
        (trimesh.creation.box(extents=[0.06, 0.06, 0.06]), False, 24),
        (trimesh.creation.cylinder(0.03, 0.04, sections=6), False, 12),
        (trimesh.creation.cone(0.03, 0.1, sections=6).apply_translation([0, 0, -0.05]), False, 6),
        (trimesh.creation.cylinder(0.03, 0.1), True, 2),
        (trimesh.creation.cone(0.03, 0.1).apply_translation([0, 0, -0.05]), True, 1),
    ],
)
def test_groups_are_those_of_the_shapes(mesh, axial, members):
    group = measured_symmetry(SurfaceCloud.of(mesh), LABEL, np.zeros(3))
    assert group.axial == axial and len(group.rotations) == members


def test_a_tool_has_turns_about_its_axis_only():
    cloud = SurfaceCloud.of(trimesh.creation.box(extents=[0.06, 0.06, 0.1]))
    group = turns_about_x(cloud, LABEL, np.zeros(3))
    assert len(group.rotations) == 4
    np.testing.assert_allclose(group.rotations[:, 0, 0], 1)
