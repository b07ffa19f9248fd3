"""Faces that convex bodies rest on, beside trimesh's, which looks at them one by one."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.geometry.toppling import rest_rotation, resting_faces


def _random_hull(seed):
    points = np.random.default_rng(seed).normal(size=(60, 3)) * [1.0, 2.0, 0.5]
    return trimesh.convex.convex_hull(points)


@pytest.mark.parametrize("seed", range(12))
def test_random_bodies_rest_as_trimesh_says(seed):
    hull = _random_hull(seed)
    center = hull.center_mass + np.random.default_rng(seed).normal(size=3) * 0.05
    normals, probabilities = resting_faces(hull, center)
    transforms, expected = trimesh.poses.compute_stable_poses(hull, center_mass=center, sigma=0.0)
    order, reference = np.argsort(-probabilities), np.argsort(-expected)
    np.testing.assert_allclose(probabilities[order], expected[reference], atol=1e-9)
    rotations = np.array([rest_rotation(n) for n in normals])
    np.testing.assert_allclose(rotations[order], transforms[reference, :3, :3], atol=1e-9)


def test_a_box_rests_on_all_its_sides_each_made_of_two_triangles():
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    normals, probabilities = resting_faces(box, np.zeros(3))
    assert len(normals) == 6
    assert probabilities.sum() == pytest.approx(1)
    across = np.abs(normals) @ box.extents
    assert (np.diff(probabilities[np.argsort(across, kind="stable")]) < 1e-9).all()


def test_a_leaning_body_does_not_stay_on_its_base():
    box = trimesh.creation.box((0.1, 0.1, 0.3))
    box.apply_transform([[1, 0, 0.5, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    normals, probabilities = resting_faces(box.convex_hull, np.zeros(3))
    assert probabilities.sum() == pytest.approx(1)
    assert np.abs(normals[:, 2]).max() < 0.9  # the centre of mass is beyond the edge of either end


def test_straight_down_and_up_are_turned_alike():
    np.testing.assert_allclose(rest_rotation(np.array([0.0, 0.0, -1.0])), np.eye(3))
    turned = rest_rotation(np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(turned @ [0, 0, 1], [0, 0, -1])
    assert np.linalg.det(turned) == pytest.approx(1)
