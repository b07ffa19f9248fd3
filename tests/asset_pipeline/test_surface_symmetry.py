"""Labels and symmetry groups measured on shapes whose symmetry is known."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.labelling.scan_label import scan_label
from asset_pipeline.labelling.surface_symmetry import SurfaceProbe
from manipose_mj.poses import rotation_about

UP = np.array([0.0, 0.0, 1.0])


def _frustum(lean: float = 0.0) -> trimesh.Trimesh:
    outline = np.array([(0, 0), (0.03, 0), (0.045, 0.1), (0, 0.1)])
    mesh = trimesh.creation.revolve(outline, sections=64)
    turn = np.eye(4)
    turn[:3, :3] = rotation_about(np.array([0.6, 0.8, 0]), lean)
    return mesh.apply_transform(turn)


def _mug(angle: float) -> trimesh.Trimesh:
    body = trimesh.creation.cylinder(0.04, 0.1)
    handle = trimesh.creation.box(extents=[0.04, 0.012, 0.06])
    handle.apply_translation([0.055, 0, 0])
    inside = trimesh.creation.cylinder(0.036, 0.1).apply_translation([0, 0, 0.005])
    mug = trimesh.boolean.difference([trimesh.boolean.union([body, handle]), inside])
    return mug.apply_transform(trimesh.transformations.rotation_matrix(angle, UP))


def test_frustum_is_axial_and_keeps_its_ends_apart():
    label = scan_label(_frustum(), "axial", UP, textured=False)
    assert label.symmetry.axial and len(label.symmetry.rotations) == 1
    np.testing.assert_allclose(label.extents, [0.1, 0.09, 0.09], atol=1e-3)
    np.testing.assert_allclose(label.origin, [0, 0, 0.05], atol=1e-3)


def test_cylinder_has_flips_only_without_texture():
    mesh = trimesh.creation.cylinder(0.03, 0.1)
    assert len(scan_label(mesh, "axial", UP, textured=False).symmetry.rotations) == 2
    assert len(scan_label(mesh, "axial", UP, textured=True).symmetry.rotations) == 1


def test_leaning_scan_gets_its_own_axis():
    axis = rotation_about(np.array([0.6, 0.8, 0]), 0.05) @ UP
    label = scan_label(_frustum(0.05), "axial", UP)
    assert np.arccos(label.rotation[:, 0] @ axis) < np.deg2rad(0.3)
    assert np.arccos(UP @ axis) > np.deg2rad(2.8)


@pytest.mark.parametrize(
    ("extents", "members"), [((0.04, 0.06, 0.1), 4), ((0.06, 0.06, 0.1), 8), ((0.06,) * 3, 24)]
)
def test_boxes_have_the_groups_of_their_sides(extents, members):
    label = scan_label(trimesh.creation.box(extents=extents), "mirror", UP)
    assert len(label.symmetry.rotations) == members and not label.symmetry.axial
    np.testing.assert_allclose(label.extents, sorted(extents)[::-1], atol=1e-4)
    assert np.linalg.det(label.rotation) == pytest.approx(1)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5, -1.9])
def test_mug_looks_towards_its_handle(angle):
    label = scan_label(_mug(angle), "mirror", UP)
    handle = np.array([np.cos(angle), np.sin(angle), 0])
    assert np.arccos(np.clip(label.rotation[:, 1] @ handle, -1, 1)) < np.deg2rad(3)
    np.testing.assert_allclose(label.rotation[:, 0], UP, atol=1e-9)
    assert len(label.symmetry.rotations) == 1


def test_screwdriver_points_from_grip_to_tip():
    grip = trimesh.creation.cylinder(0.015, 0.1)
    shaft = trimesh.creation.cylinder(0.003, 0.12).apply_translation([0, 0, 0.11])
    tool = trimesh.util.concatenate([grip, shaft])
    tool.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    label = scan_label(tool, "functional", UP)
    np.testing.assert_allclose(label.rotation[:, 0], [1, 0, 0], atol=1e-3)
    np.testing.assert_allclose(label.rotation[:, 1], UP, atol=1e-3)
    assert label.origin[0] == pytest.approx(0.05, abs=0.006)
    turned = scan_label(tool, "functional", UP, functional=np.array([-1.0, 0.2, 0]))
    np.testing.assert_allclose(turned.rotation[:, 0], [-1, 0, 0], atol=1e-3)


def test_residual_is_the_distance_it_claims():
    probe = SurfaceProbe.of(trimesh.creation.box(extents=[0.1, 0.06, 0.06]))
    shifted = probe.residual(np.eye(3), np.zeros(3))
    assert shifted < 1e-9
    quarter = probe.residual(rotation_about(UP, np.pi / 2), np.zeros(3))
    assert quarter == pytest.approx(0.02, abs=0.002)
