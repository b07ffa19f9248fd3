"""Votes that know the truth give it back: exactly, with liars among them, and in two minds."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.poses import SymmetryGroup, quaternion_to_rotation, rotation_angle
from manipose_mj.ppf_jax.points.symmetry import (
    CommonSymmetry,
    common_symmetry,
    line_cosines,
    nearest_equivalent,
    vote_cosines,
)
from manipose_mj.ppf_jax.rigid.network import PairVotes
from manipose_mj.ppf_jax.rigid.voting import VotingConfig, agreement, fibonacci_sphere, vote

COUNT = 2000
ORIGIN = np.array([0.4, -0.3, 0.2])
ROTATION = quaternion_to_rotation(np.array([0.3, -0.5, 0.7, 0.2]))
CONFIG = VotingConfig()
voted = jax.jit(vote, static_argnums=(1, 2))


def _votes(group=None, *, liars=0.0, noise=0.0, seed=0, lines=False):
    """Honest votes for the label, a share of which is replaced by others with the same certainty."""
    rng = np.random.default_rng(seed)
    start, end = rng.normal(size=(2, COUNT, 3))
    along = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    mu = np.sum((ORIGIN - start) * along, axis=1)
    nu = np.linalg.norm(ORIGIN - start - mu[:, None] * along, axis=1)
    group = group or SymmetryGroup.identity()
    label = (jnp.asarray(along), jnp.asarray(ROTATION), group)
    cosines = [vote_cosines(*label)]
    if lines:
        cosines.append(line_cosines(*label))
    values = np.column_stack([mu, nu, *map(np.asarray, cosines)])
    values += noise * rng.normal(size=values.shape)
    lying = rng.random(COUNT) < liars
    values[lying] = rng.uniform(-1, 1, size=(lying.sum(), values.shape[1]))
    log_scale = np.full(values.shape, np.log(max(noise, 0.02)))
    leaves = (start, along, values, log_scale)
    return PairVotes(*(jnp.asarray(leaf, jnp.float32) for leaf in leaves))


def _degrees(hypotheses, group=None):
    members = (group or SymmetryGroup.identity()).rotations
    angles = rotation_angle(
        np.asarray(hypotheses.rotation, float)[:, None], (ROTATION @ members)[None]
    )
    return np.degrees(angles.min(axis=1))


def test_directions_are_spread_evenly():
    sphere = fibonacci_sphere(480)
    assert np.allclose(np.linalg.norm(sphere, axis=1), 1)
    gaps = np.degrees(np.arccos(np.clip(np.sort(sphere @ sphere.T, axis=1)[:, -2], -1, 1)))
    assert gaps.min() > 5 and gaps.max() < 11


@pytest.mark.parametrize(("liars", "noise", "bound"), [(0, 0, 0.1), (0.4, 0.05, 1.0)])
def test_the_first_hypothesis_is_the_label(liars, noise, bound):
    found = voted(_votes(liars=liars, noise=noise), CommonSymmetry(), CONFIG)
    assert found.rotation.shape == (CONFIG.axes_kept * CONFIG.turns_kept, 3, 3)
    assert _degrees(found)[0] < bound
    assert np.linalg.norm(np.asarray(found.origin)[0] - ORIGIN) < 0.02 * bound + 1e-3
    frames = np.asarray(found.rotation, float)
    assert np.allclose(frames @ frames.swapaxes(1, 2), np.eye(3), atol=1e-4)
    assert np.allclose(np.linalg.det(frames), 1, atol=1e-4)


def test_a_box_votes_for_lines_and_any_of_its_four_frames_will_do():
    group = SymmetryGroup.three_planes()
    symmetry = common_symmetry([group])
    assert symmetry == CommonSymmetry(unsigned_x=True, unsigned_y=True)
    assert _degrees(voted(_votes(group, noise=0.03), symmetry, CONFIG), group)[0] < 1


def test_a_square_box_is_found_by_votes_for_the_nearest_side():
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    group = SymmetryGroup.generated(np.stack([quarter]))
    symmetry = common_symmetry([group])
    assert symmetry == CommonSymmetry(unsigned_y=True)
    assert _degrees(voted(_votes(group, noise=0.03), symmetry, CONFIG), group).min() < 2


def test_two_minds_give_two_hypotheses():
    votes = _votes(noise=0.03)
    half = (np.arange(COUNT) % 5 < 2)[:, None]  # two fifths think that the object is upside down
    flip = np.array([1.0, 1.0, -1.0, 1.0], np.float32)
    torn = PairVotes(
        votes.start,
        votes.along,
        jnp.where(half, votes.values * flip, votes.values),
        votes.log_scale,
    )
    x = np.asarray(voted(torn, CommonSymmetry(), CONFIG).rotation)[:, :, 0] @ ROTATION[:, 0]
    assert x[0] > 0.999 and x.min() < -0.999


def test_where_the_ends_are_unknown_the_lines_still_give_the_axes():
    votes = _votes(noise=0.03, lines=True)
    blind = votes.values.at[:, 2:4].set(0.0)
    unsure = votes.log_scale.at[:, 2:4].set(0.0)
    found = voted(PairVotes(votes.start, votes.along, blind, unsure), CommonSymmetry(), CONFIG)
    x = np.asarray(found.rotation)[:, :, 0] @ ROTATION[:, 0]
    assert x[0] ** 2 > 0.999 and {-1, 1} <= set(np.sign(x[np.abs(x) > 0.999]))
    assert _degrees(found, SymmetryGroup.three_planes()).min() < 1
    assert _degrees(voted(_votes(noise=0.03, lines=True), CommonSymmetry(), CONFIG))[0] < 1


def test_a_line_is_of_both_ends_and_of_all_equivalent_axes():
    along = jnp.asarray(np.random.default_rng(0).normal(size=(50, 3)))
    along = along / jnp.linalg.norm(along, axis=1, keepdims=True)
    cosines = np.abs(np.asarray(along @ ROTATION))
    one = line_cosines(along, jnp.asarray(ROTATION), SymmetryGroup.identity())
    np.testing.assert_allclose(one, cosines[:, :2], atol=1e-6)
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    group = SymmetryGroup.generated(np.stack([quarter]))
    square = line_cosines(along, jnp.asarray(ROTATION), group)
    np.testing.assert_allclose(square[:, 1], cosines[:, 1:].max(axis=1), atol=1e-6)


def test_boxes_among_others_are_told():
    mixed = common_symmetry([SymmetryGroup.three_planes(), SymmetryGroup.identity()])
    assert mixed == CommonSymmetry(boxes=True)
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    tall = SymmetryGroup.generated(np.stack([quarter]))
    assert common_symmetry([tall, SymmetryGroup.identity()]) == CommonSymmetry()


def test_the_true_pose_satisfies_the_most_votes():
    votes = _votes(liars=0.3, noise=0.03)
    found = voted(votes, CommonSymmetry(), CONFIG)
    share = np.asarray(agreement(votes, found, CommonSymmetry()))
    assert share.shape == (8, 4) and np.all((share >= 0) & (share <= 1))
    assert np.argmin(_degrees(found)) in np.flatnonzero(
        share[:, 2:].sum(1) > 0.9 * share[:, 2:].sum(1).max()
    )


def test_votes_that_say_nothing_give_poses_all_the_same():
    nothing = jax.tree.map(jnp.zeros_like, _votes())
    found = voted(nothing, CommonSymmetry(), CONFIG)
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(found))


def test_the_nearest_equivalent_is_what_the_pose_error_measures():
    rng = np.random.default_rng(1)
    mixed = (SymmetryGroup.three_planes(), SymmetryGroup.about_x(ends_alike=True))
    for group in (*mixed, SymmetryGroup.about_x(), SymmetryGroup.identity()):
        for _ in range(5):
            estimate, truth = quaternion_to_rotation(rng.normal(size=(2, 4)))
            nearest = nearest_equivalent(jnp.asarray(estimate), jnp.asarray(truth), group)
            angle = float(rotation_angle(estimate, np.asarray(nearest, float)))
            sampled = truth @ group.sampled(720)
            assert angle == pytest.approx(rotation_angle(estimate, sampled).min(), abs=5e-3)
            assert rotation_angle(np.asarray(nearest, float), sampled).min() < 5e-3


@pytest.mark.full
def test_padding_changes_no_vote_and_no_nearest_label():
    rng = np.random.default_rng(0)
    along = jnp.asarray(rng.normal(size=(50, 3)), jnp.float32)
    truth = jnp.asarray(ROTATION, jnp.float32)
    estimate = jnp.asarray(SymmetryGroup.three_planes().rotations[3] @ ROTATION, jnp.float32)
    for group in (SymmetryGroup.three_planes(), SymmetryGroup.about_x(ends_alike=True)):
        padded = group.padded(7)
        for function in (vote_cosines, line_cosines):
            few, many = function(along, truth, group), function(along, truth, padded)
            np.testing.assert_allclose(few, many, atol=1e-6)
        few, many = (nearest_equivalent(estimate, truth, each) for each in (group, padded))
        np.testing.assert_allclose(few, many, atol=1e-6)
