"""The turn about a front is told by the edges in its plane, and left alone where there are none."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.poses import rotation_about
from manipose_mj.ppf_jax.articulated.plane_edge_alignment import PlaneEdgeConfig, aligned_to_edges

_TURNED = jax.jit(
    lambda rotation, points, normals, mask: aligned_to_edges(
        rotation, points, normals, mask, PlaneEdgeConfig()
    )
)
_X = np.array([1.0, 0.0, 0.0])


def _front(rng, body, shape):
    """6,000 noisy points of a plane across the first axis of `body`, 1.2 m off; their normals; padding."""
    plane = rng.uniform([-0.4, -0.3], [0.4, 0.3], (6000, 2))
    plane = plane[shape(plane)]
    own = np.column_stack([rng.normal(0, 0.002, len(plane)), plane])
    points = np.zeros((6144, 3), np.float32)
    points[: len(own)] = own @ body.T + [0.1, 0.0, 1.2]
    normals = np.zeros_like(points)
    normals[: len(own)] = body[:, 0]
    return points, normals, np.arange(6144) < len(own)


@pytest.mark.sample(3)
@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("off", [-38.0, -7.3, 0.0, 12.6])
def test_a_rectangle_s_edges_right_a_frame_of_any_order(which, off):
    rng = np.random.default_rng(0)
    body = rotation_about(np.array([0.6, 0.0, 0.8]), 2.0)
    cloud = _front(rng, body, lambda plane: np.ones(len(plane), bool))
    turned = np.roll(body @ rotation_about(_X, np.radians(off)), which, axis=1)
    found = np.asarray(_TURNED(turned, *cloud))
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-5)
    assert np.linalg.det(found) == pytest.approx(1.0, abs=1e-5)
    between = np.roll(body, which, axis=1).T @ found
    assert np.degrees(np.arccos(np.clip((np.trace(between) - 1) / 2, -1, 1))) < 0.6


def test_where_another_plane_shows_it_is_left_to_that():
    body, rng = rotation_about(np.array([0.6, 0.0, 0.8]), 2.0), np.random.default_rng(2)
    points, normals, mask = _front(rng, body, lambda plane: np.ones(len(plane), bool))
    turned = body @ rotation_about(_X, np.radians(12.0))
    normals[:1500] = turned[:, 1]
    np.testing.assert_allclose(_TURNED(turned, points, normals, mask), turned, atol=1e-6)


def test_a_disc_has_no_edges_to_go_by():
    body = rotation_about(np.array([0.6, 0.0, 0.8]), 2.0)
    cloud = _front(
        np.random.default_rng(1), body, lambda plane: np.linalg.norm(plane, axis=1) < 0.3
    )
    np.testing.assert_allclose(_TURNED(body, *cloud), body, atol=1e-6)


def test_an_empty_cloud_gives_a_frame():
    empty = jnp.zeros((6144, 3)), jnp.zeros((6144, 3)), jnp.zeros(6144, bool)
    np.testing.assert_allclose(_TURNED(np.eye(3, dtype=np.float32), *empty), np.eye(3), atol=1e-6)
