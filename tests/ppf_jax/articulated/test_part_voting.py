"""Votes for the body's frame and its parts lead to the true ones."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.poses import rotation_about
from manipose_mj.ppf_jax.articulated.body_frame import aligned, candidates
from manipose_mj.ppf_jax.articulated.part_network import (
    LENGTH,
    SLIDE_LENGTH,
    TURN,
    VOTES,
    PointVotes,
    taken,
)
from manipose_mj.ppf_jax.articulated.part_voting import PartVotingConfig, find_parts, frame_turn
from manipose_mj.ppf_jax.points.rotations import from_vector
from manipose_mj.ppf_jax.training.articulated_losses import ArticulatedLoss, varied


def _true_votes(targets, known) -> PointVotes:
    """As if every point on a moving part knew all."""
    count = len(known["moving"])
    values = {
        name: value if name == "turn" else jnp.where(known["moving"][:, None], value, 0.0)
        for name, value in targets.items()
    }
    logits = 20.0 * jax.nn.one_hot(known["classes"], 3)
    hinge = jnp.where(known["hinge"], 10.0, -10.0)
    scales = dict.fromkeys(VOTES, jnp.full(count, -3.0))
    return PointVotes(logits, hinge, values, scales, jnp.zeros(()))


@pytest.mark.full
@pytest.mark.parametrize("seed", range(6))
def test_true_votes_give_the_true_parts(sample, seed):
    """Turned, mirrored, enlarged: what points vote for stays one consistent piece of furniture."""
    cloud, targets, known = varied(
        sample, ArticulatedLoss(rolled=0.0, wrong_front=0.0), key=jax.random.key(seed)
    )
    votes = _true_votes(targets, known)
    # Frames are some degrees off; what is seen of a handle may be a part of it.
    config = PartVotingConfig(snap=0.0)
    parts = jax.jit(find_parts, static_argnums=2)(cloud, votes, config)
    seen = np.unique(np.asarray(sample.part[sample.part >= 0]))
    turn = from_vector(frame_turn(cloud, votes, PartVotingConfig()))
    for part in seen:
        row = int(np.argmax(np.asarray(sample.part) == part))
        centre = cloud.points[row] + LENGTH * targets["centre"][row]
        found = int(jnp.argmin(jnp.linalg.norm(parts.centre - centre, axis=1)))
        np.testing.assert_allclose(parts.centre[found], centre, atol=1e-3)
        y, axis = parts.rotation[found][:, 1], parts.axis[found]
        hinge = bool(sample.hinge[part])
        assert (parts.hinge[found] > 0.5) == hinge
        opening = float(parts.opening[found])
        if hinge:
            assert opening == pytest.approx(float(sample.opening[part]), abs=1e-3)
            y = rotation_about(np.asarray(axis, float), -opening) @ np.asarray(y, float)
            line = cloud.points[row] + LENGTH * targets["line"][row] - parts.line[found]
            across = line - (line @ axis) * axis
            assert float(jnp.linalg.norm(across)) < 2e-3
        else:
            assert opening == pytest.approx(
                SLIDE_LENGTH * float(targets["opening"][row, 0]), abs=1e-3
            )
            assert float(axis @ y) > 0.999
        # Shut, every handle looks out of the front, which is the frame's first axis once that is aligned.
        assert float(np.asarray(turn)[:, 0] @ np.asarray(y)) > 0.999
    assert float(jnp.abs(targets["turn"]).max()) * TURN < 0.3


@pytest.mark.full
@pytest.mark.parametrize(("across", "parts"), [(False, 1), (True, 2)])
def test_votes_spread_along_a_handle_are_one_part_and_across_it_two(sample, across, parts):
    """Half of a handle's points say 3 cm this way, half that way."""
    cloud, targets, known = varied(
        sample, ArticulatedLoss(rolled=0.0, wrong_front=0.0, stretch=0.0), key=jax.random.key(0)
    )
    on = np.asarray(known["classes"]) == 2
    of = np.asarray(sample.part)
    part = np.bincount(of[on]).argmax()
    row = int(np.argmax(on & (of == part)))
    x, y = (np.asarray(targets[name][row]) for name in ("x", "y"))
    way = np.cross(x, y) if across else x
    sides = np.where(np.arange(len(of)) % 2 == 0, 0.03, -0.03)[:, None] / LENGTH
    targets["centre"] = targets["centre"] + sides * way
    own = jnp.asarray(of == part)
    known = {name: jnp.where(own, value, 0) for name, value in known.items()}
    config = PartVotingConfig(snap=0.0)
    found = jax.jit(find_parts, static_argnums=2)(cloud, _true_votes(targets, known), config)
    assert int(jnp.sum(found.evidence[:, 2] > 0)) == parts


def test_planes_settle_the_frame():
    rng = np.random.default_rng(0)
    walls = []
    for axis in range(3):
        flat = rng.uniform(0.0, 0.5, (400, 3))
        flat[:, axis] = rng.normal(0.0, 0.002, 400)
        walls.append(flat)
    # Normals that lean towards the camera by some degrees.
    normals = np.repeat(np.eye(3), 400, axis=0) + [0.08, 0.08, 0.08]
    normals = normals + rng.normal(0.0, 0.08, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    truth = rotation_about(np.array([0.6, 0.0, 0.8]), 1.1)
    order = rng.permutation(1200)
    points = np.concatenate(walls)[order] @ truth.T
    normals = normals[order] @ truth.T
    start = truth @ rotation_about(np.array([0.0, 0.6, 0.8]), 0.12)
    mask = jnp.arange(1200) < 1100
    found, _ = jax.jit(aligned)(
        jnp.asarray(start, jnp.float32), jnp.asarray(points), jnp.asarray(normals), mask
    )
    cosine = (np.trace(truth.T @ np.asarray(found)) - 1) / 2
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))) < 0.3


def test_one_candidate_is_the_bodys_frame():
    truth = np.asarray(from_vector(jnp.array([0.3, -1.2, 0.5])))
    towards = truth @ np.array([0.8, 0.36, 0.48])
    frames = np.asarray(candidates(jnp.asarray(truth), jnp.asarray(towards)))
    np.testing.assert_allclose(frames[0], truth, atol=1e-6)
    for start in (truth[:, [2, 0, 1]], truth @ np.diag([-1.0, -1.0, 1.0]), frames[3]):
        others = np.asarray(candidates(jnp.asarray(start), jnp.asarray(towards)))
        assert (others[:, :, 0] @ towards > 0).all()
        np.testing.assert_allclose(np.linalg.det(others), 1.0, atol=1e-5)
        # The body's own, or half a turn about its front from it.
        alike = np.abs(np.einsum("ji,kji->ki", truth, others))
        right = (alike > 0.999).all(axis=1)
        assert right.sum() == 1 and truth[:, 0] @ others[right][0][:, 0] > 0.999


@pytest.mark.full
def test_gradients_of_taken_rows_are_those_of_indexing():
    rng = np.random.default_rng(0)
    rows = jnp.asarray(rng.normal(size=(7, 3)), jnp.float32)
    index = jnp.asarray(rng.integers(7, size=(40, 5)))
    weight = jnp.asarray(rng.normal(size=(40, 5, 3)), jnp.float32)
    plain = jax.grad(lambda r: jnp.sum(weight * r[index] ** 2))(rows)
    ours = jax.grad(lambda r: jnp.sum(weight * taken(r, index) ** 2))(rows)
    np.testing.assert_allclose(ours, plain, rtol=1e-5, atol=1e-5)
