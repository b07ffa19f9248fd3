"""Transforms, quaternions and the symmetric pose error, in NumPy and in JAX."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from manipose_mj import poses
from manipose_mj.poses import SymmetryGroup, compose, pose_error, rotation_about

X, Y, Z = np.eye(3)
GROUPS = {
    "identity": SymmetryGroup.identity(),
    "axial": SymmetryGroup.about_x(),
    "axial, ends alike": SymmetryGroup.about_x(ends_alike=True),
    "two planes": SymmetryGroup.two_planes(),
    "three planes": SymmetryGroup.three_planes(),
    "square": SymmetryGroup.generated(
        np.stack([rotation_about(X, np.pi / 2), np.diag([-1.0, 1.0, -1.0])])
    ),
}
quaternions = arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 1e-2)
vectors = arrays(float, 3, elements=st.floats(-10, 10))


def _rotations(*shape: int, seed: int = 0) -> np.ndarray:
    count = int(np.prod(shape))
    return Rotation.random(count, rng=np.random.default_rng(seed)).as_matrix().reshape(*shape, 3, 3)


def _poses(*shape: int, seed: int = 0) -> np.ndarray:
    return compose(
        _rotations(*shape, seed=seed), np.random.default_rng(seed).normal(size=(*shape, 3))
    )


@settings(deadline=None)
@given(quaternions, vectors, vectors)
def test_a_pose_and_its_inverse_undo_each_other(quaternion, translation, point):
    pose = compose(poses.quaternion_to_rotation(quaternion), translation)
    np.testing.assert_allclose(poses.invert(pose) @ pose, np.eye(4), atol=1e-12)
    there = poses.transform(pose, point[None])
    np.testing.assert_allclose(there[0], (pose @ np.append(point, 1))[:3], atol=1e-12)
    np.testing.assert_allclose(poses.transform(poses.invert(pose), there)[0], point, atol=1e-11)


@settings(deadline=None)
@given(quaternions)
def test_quaternions_are_wxyz_and_survive_the_round_trip(quaternion):
    rotation = poses.quaternion_to_rotation(quaternion)
    expected = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    np.testing.assert_allclose(rotation, expected, atol=1e-12)
    back = poses.rotation_to_quaternion(rotation)
    assert back[0] >= 0
    assert abs(np.linalg.norm(back) - 1) < 1e-12
    unit = quaternion / np.linalg.norm(quaternion)
    assert abs(abs(back @ unit) - 1) < 1e-12


@pytest.mark.parametrize("axis", [X, Y, Z, np.array([0.6, 0.0, -0.8])])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi / 2, np.pi - 1e-9, np.pi])
def test_quaternions_of_special_turns(axis, angle):
    rotation = rotation_about(axis, angle)
    back = poses.quaternion_to_rotation(poses.rotation_to_quaternion(rotation))
    np.testing.assert_allclose(back, rotation, atol=1e-14)


def test_vectors_are_position_then_quaternion():
    vector = np.array([1.0, 2.0, 3.0, np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
    pose = poses.vector_to_pose(vector)
    np.testing.assert_allclose(pose[:3, 3], [1, 2, 3])
    np.testing.assert_allclose(pose[:3, :3] @ Y, Z, atol=1e-15)  # a quarter turn about X
    np.testing.assert_allclose(poses.pose_to_vector(pose), vector)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-3, 1.0, 3.0])
def test_the_angle_keeps_its_digits_near_zero(angle):
    assert poses.rotation_angle(np.eye(3), rotation_about(Z, angle)) == pytest.approx(
        angle, rel=1e-4 if angle < 1e-10 else 1e-7, abs=1e-16
    )


def test_translation_error_is_between_origins_whatever_the_symmetry():
    truth = _poses()
    for group in GROUPS.values():
        estimate = truth.copy()
        estimate[:3, 3] += [0.03, -0.04, 0.0]
        translation, rotation = pose_error(estimate, truth, group)
        assert translation == pytest.approx(0.05)
        assert rotation == pytest.approx(0, abs=1e-7)


# A turn of the estimate in the label frame, and what remains of it under each group [deg].
CLOSED_FORMS = [
    ("identity", X, 180, 180),
    ("identity", Z, 40, 40),
    ("axial", X, 77, 0),
    ("axial", Y, 180, 180),
    ("axial", Z, 25, 25),
    ("axial, ends alike", X, 77, 0),
    ("axial, ends alike", Z, 180, 0),
    ("axial, ends alike", Y, 170, 10),
    ("axial, ends alike", Y, 90, 90),
    ("two planes", X, 180, 0),
    ("two planes", X, 150, 30),
    ("two planes", Y, 180, 180),
    ("three planes", X, 180, 0),
    ("three planes", Y, 180, 0),
    ("three planes", Z, 170, 10),
    ("three planes", X, 90, 90),
    ("square", X, 90, 0),
    ("square", X, 130, 40),
    ("square", X, 45, 45),
    ("square", Y, 180, 0),
    ("square", Y, 90, 90),
]


@pytest.mark.parametrize(("group", "axis", "turn", "remaining"), CLOSED_FORMS)
def test_rotation_error_is_what_the_symmetry_leaves(group, axis, turn, remaining):
    truth = _poses(seed=3)
    estimate = truth @ compose(rotation_about(axis, radians(turn)), np.zeros(3))
    _, rotation = pose_error(estimate, truth, GROUPS[group])
    assert np.degrees(rotation) == pytest.approx(remaining, abs=1e-5)


@pytest.mark.parametrize("name", ["axial", "axial, ends alike"])
def test_the_closed_form_is_the_minimum_over_many_turns(name):
    group, truth, estimate = GROUPS[name], _poses(20, seed=1), _poses(20, seed=2)
    _, closed = pose_error(estimate, truth, group)
    turned = truth[:, None, :3, :3] @ group.sampled(720)
    searched = poses.rotation_angle(estimate[:, None, :3, :3], turned).min(axis=1)
    assert (searched >= closed - 1e-9).all()
    np.testing.assert_allclose(searched, closed, atol=radians(0.5))


@pytest.mark.parametrize("name", GROUPS)
def test_groups_are_closed_and_their_members_change_no_error(name):
    group, truth, estimate = GROUPS[name], _poses(seed=5), _poses(seed=6)
    _, before = pose_error(estimate, truth, group)
    members = group.sampled(8)
    for member in members:
        turn = compose(member, np.zeros(3))
        np.testing.assert_allclose(pose_error(estimate @ turn, truth, group)[1], before, atol=1e-9)
        assert np.linalg.det(member) == pytest.approx(1)
        products = members @ member
        gaps = poses.rotation_angle(products[:, None], members[None]).min(axis=1)
        assert gaps.max() < 1e-6


def test_a_square_section_generates_eight_turns_and_a_cube_twenty_four():
    assert len(GROUPS["square"].rotations) == 8
    quarter_turns = np.stack([rotation_about(X, np.pi / 2), rotation_about(Y, np.pi / 2)])
    assert len(SymmetryGroup.generated(quarter_turns).rotations) == 24


def test_turns_that_generate_no_finite_group_are_refused():
    with pytest.raises(ValueError, match="finite"):
        SymmetryGroup.generated(rotation_about(X, 1.0)[None])


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_batches_have_the_shape_and_values_of_single_poses(name, shape):
    estimate, truth = _poses(*shape, seed=7), _poses(*shape, seed=8)
    both = pose_error(estimate, truth, GROUPS[name])
    assert both[0].shape == both[1].shape == shape
    for index in np.ndindex(shape):
        single = pose_error(estimate[index], truth[index], GROUPS[name])
        assert both[0][index] == pytest.approx(float(single[0]))
        assert both[1][index] == pytest.approx(float(single[1]))
    assert poses.invert(truth).shape == (*shape, 4, 4)
    assert poses.pose_to_vector(truth).shape == (*shape, 7)
    np.testing.assert_allclose(poses.vector_to_pose(poses.pose_to_vector(truth)), truth, atol=1e-12)


@pytest.mark.parametrize("name", GROUPS)
def test_jax_agrees_with_numpy_and_compiles(name):
    jax = pytest.importorskip("jax")
    estimate, truth = _poses(16, seed=9), _poses(16, seed=10)
    compiled = jax.jit(lambda a, b: pose_error(a, b, GROUPS[name]))
    theirs = compiled(jax.numpy.asarray(estimate), jax.numpy.asarray(truth))
    for own, other in zip(pose_error(estimate, truth, GROUPS[name]), theirs, strict=True):
        assert isinstance(other, jax.Array)
        np.testing.assert_allclose(own, other, atol=2e-3)


def test_jax_converts_as_numpy_does():
    jax = pytest.importorskip("jax")
    pose, points = _poses(5, seed=11), np.random.default_rng(0).normal(size=(5, 4, 3))
    given = jax.numpy.asarray(pose)
    for function in (poses.invert, poses.pose_to_vector):
        np.testing.assert_allclose(function(given), function(pose), atol=1e-5)
    moved = poses.transform(given, jax.numpy.asarray(points))
    np.testing.assert_allclose(moved, poses.transform(pose, points), atol=1e-5)
    vectors = poses.pose_to_vector(given)
    np.testing.assert_allclose(poses.vector_to_pose(vectors), pose, atol=1e-5)


def test_padding_a_group_changes_no_error():
    estimate, truth = _poses(10, seed=12), _poses(10, seed=13)
    for group in GROUPS.values():
        padded = group.padded(len(group.rotations) + 3)
        assert padded.axial == group.axial and len(padded.rotations) == len(group.rotations) + 3
        for own, other in zip(
            pose_error(estimate, truth, group), pose_error(estimate, truth, padded), strict=True
        ):
            np.testing.assert_array_equal(own, other)
    with pytest.raises(ValueError, match="a group of 4 does not fit into 2"):
        GROUPS["three planes"].padded(2)


@pytest.mark.parametrize("how", ["numpy", "jit", "vmap"])
def test_every_world_has_a_symmetry_of_its_own(how):
    estimate, truth = _poses(len(GROUPS), seed=14), _poses(len(GROUPS), seed=15)
    groups = SymmetryGroup.stack(list(GROUPS.values()))
    assert groups.rotations.shape == (6, 8, 3, 3) and groups.axial.tolist()[:3] == [0, 1, 1]
    if how == "numpy":
        found, tolerance = pose_error(estimate, truth, groups), 0.0
    else:
        jax = pytest.importorskip("jax")
        from manipose_mj.tasks import pytrees as _  # noqa: F401

        run = jax.jit(pose_error) if how == "jit" else jax.jit(jax.vmap(pose_error))
        found, tolerance = run(estimate, truth, groups), 1e-5
    for i, group in enumerate(GROUPS.values()):
        single = pose_error(estimate[i], truth[i], group)
        np.testing.assert_allclose([error[i] for error in found], single, rtol=0, atol=tolerance)
